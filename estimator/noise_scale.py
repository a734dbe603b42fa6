"""Noise of measured poses beside the declared noise, and advice to the user."""

import numpy as np
from numpy.typing import ArrayLike

from .tuning import UKFTuning

# multiples of the declared standard deviation that need no word: a wrench follows twice as late or
# is twice as restless beyond them
QUIET, LOUD = 0.5, 2.0


def noise_warning(scales: ArrayLike, tuning: UKFTuning, file: bool) -> str:
    """Say what is to be set where poses are noisier or calmer than declared; empty: nothing.

    Args:
        scales: (2,) attitude and position, medians over some seconds.
        tuning: the filter's, with the declared noise.
        file: whether the vehicle file declares the noise; else a tuning does.
    """
    attitude, position = np.asarray(scales, dtype=np.float64).tolist()
    declared = "vehicle file's" if file else "tuning's"
    words = []
    for what, scale, noise, shown, unit, fields in (
        ("Position", position, tuning.position_noise, 1e3, "mm", ("sigma_pos_m", "position_noise")),
        (
            "Attitude",
            attitude,
            tuning.attitude_noise,
            1.0,
            "rad",
            ("sigma_att_rad", "attitude_noise"),
        ),
    ):
        if QUIET <= scale <= LOUD:
            continue
        std = float(np.sqrt(np.mean(np.square(noise))))
        name = f"mocap {fields[0]}" if file else fields[1]
        words.append(
            f"{what} noise is {scale:.2g} times the {declared} {shown * std:.3g} {unit}: set "
            f"{name} to {scale * std:.2g}"
        )
    return ". ".join(words)
