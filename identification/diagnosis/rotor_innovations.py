"""The rotors' innovations: thrust and torques not predicted by the flight's past.

A flight loop with a gyro answers a gust before the pose shows it, and a measured rotor speed has
noise and rounding. Both reach the likelihood through the rotors' own innovations: the part of
thrust and torques predicted neither by past rotor speeds nor by the filter's state. The pose
confirms a share of it later, as a gust or as an error of measurement. This share is the gain of the
joint filter of rotors and pose. Like the loop it is unknown, so it is fitted beside the effects: an
effect shows in the predictable part of the rotors alone. (Joint input-output identification: L.
Ljung, System Identification, 2nd edition, 1999, section 13.5.)
"""

import math

import numpy as np
from scipy.special import ndtr

from ..logs.table import Array, Mask, Rows
from ..motion.signals import in_body
from .causal_filter import Track, level
from .raw_poses import Poses

# past samples of the rotors in a prediction: a loop's own filter has a memory. Of 23 flights whose
# loops saw more than their logs, 7 got a wrong probable set with 4 samples, and 4 with 20
LAGS = 20
# of a regression on rounded speeds. Of 34 hovers, half by a foreign simulator, the likeliest set is
# the true one on 16 without rounds, and on 19 with 5. More rounds come nearer to the true speeds,
# but the rest of the error then follows the loop: with 12, fewer sets were right
ROUNDS = 5
# share of a predictor's square added to it, against predictors nearly alike, and constant ones
RIDGE = 1e-6
# the axis of the pose driven by each of thrust and torques
DRIVEN = (2, 3, 4, 5)


def rotor_innovations(poses: Poses, track: Track) -> Array:
    """Return the rotors' innovations (n, 4), as accelerations: along body z (m/s2) and about the
    body's axes (rad/s2). The first samples of a piece, with too short a past, have none.

    Args:
        poses: the pieces as measured.
        track: as the filter sees them.
    """
    # the track has the rotors between samples; the accelerations are linear in squared speeds
    speeds = poses.rotor_speeds
    inside = np.diff(poses.sample) == 1
    between = np.square(0.5 * (speeds[:-1] + speeds[1:]))[inside]
    effectiveness = np.linalg.lstsq(between, track.rotors[:-1][inside], rcond=None)[0]
    rotors: Array = np.square(speeds) @ effectiveness
    later = poses.sample >= LAGS
    rotors[later] -= _predicted(track, rotors, later)
    rotors[~later] = 0.0
    return rotors


def unrounded(poses: Poses, track: Track, step: float) -> Array:
    """Return the corrections of rotor speeds (n, 4), rad/s, from the log's multiples of ``step`` to
    the expected speeds.

    In hover a rotor speed moves by less than a step, and its rounding follows the flight loop like
    a damping. The prediction from the past, within the logged step, is most of the speed: a
    regression on intervals, by expectation and maximisation (M. D. Burridge, Journal of the Royal
    Statistical Society B 43 (1981), 41-45).
    """
    later = poses.sample >= LAGS
    logged = poses.rotor_speeds[later]
    speeds = poses.rotor_speeds.copy()
    variance = np.zeros_like(logged)
    for _ in range(ROUNDS):
        z = _predicted(track, speeds, later)
        left = np.square(speeds[later] - z) + variance
        std = np.maximum(np.sqrt(left.mean(axis=0)), 1e-6 * step)
        low, high = ((logged + x * step - z) / std for x in (-0.5, 0.5))
        mass = np.maximum(ndtr(high) - ndtr(low), 1e-12)
        a, b = (np.exp(-0.5 * x * x) / math.sqrt(2.0 * math.pi) for x in (low, high))
        # of a normal density between two bounds
        mean = np.clip((a - b) / mass, low, high)
        speeds[later] = z + std * mean
        spread = 1.0 + (low * a - high * b) / mass - mean**2
        variance = np.square(std) * np.clip(spread, 0.0, 1.0)
    return speeds - poses.rotor_speeds


def _predicted(track: Track, rotors: Array, later: Mask) -> Array:
    """Return the least-squares predictions of some of the rotors (n, 4): of later samples of each
    piece.
    """
    z = _known_before(track, rotors, np.flatnonzero(later))
    y = rotors[later]
    # in place: ten minutes take 0.1 GB
    z -= z.mean(axis=0)
    z /= np.maximum(np.sqrt(np.einsum("ij,ij->j", z, z) / len(z)), 1e-12)
    normal = z.T @ z
    normal += RIDGE * len(z) * np.eye(len(normal))
    predicted: Array = z @ np.linalg.solve(normal, z.T @ y)
    predicted += y.mean(axis=0) / (1.0 + RIDGE)
    return predicted


def _known_before(track: Track, rotors: Array, at: Rows) -> Array:
    """Return everything known before the rotors of samples (m, c): their past, ``rotors`` (n, 4),
    and the filter's state.
    """
    before = at - 1
    turn = track.rotation[before]
    body = in_body(track.velocity[before], turn)
    state = np.hstack([turn[:, 2, :2], body, track.angular_velocity[before]])
    i, j = np.triu_indices(state.shape[1])
    # along the heading and to its left, and about the body's axes
    back = track.heading * [1.0, -1.0]
    seen = np.hstack([level(back, x) for x in np.hsplit(track.innovations, 2)])
    return np.column_stack(
        [
            *(rotors[at - lag] for lag in range(1, LAGS + 1)),
            state,
            track.position[before],
            track.acceleration[before] - track.model[before],
            seen[before],
            # the loop may have read this sample's pose before the rotors were logged
            seen[at],
            state[:, i] * state[:, j],
        ]
    )
