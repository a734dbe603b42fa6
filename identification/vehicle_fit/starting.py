"""Where a fit starts: plain least squares, axis by axis, in which every coefficient is linear."""

import numpy as np
from numpy.typing import NDArray

from ...runtime.errors import InputError
from .channels import Piece
from .columns import Drive, rotor_columns

Array = NDArray[np.float64]


def first_thrust(pieces: list[Piece], drive: Drive, weight: float) -> list[float]:
    """Return the size of each basis coefficient at which it alone would carry the weight."""
    totals = [rotor_columns(piece, drive) for piece in pieces]
    return [
        weight / max(float(np.mean(np.concatenate([t[f"T{j}"] for t in totals]))), 1e-12)
        for j in range(len(drive.exponents))
    ]


def first_gains(pieces: list[Piece], drive: Drive, thrust: list[float]) -> Array:
    """Return the angular acceleration per torque (3,) in 1/(kg m2), roughly: about x and y the
    inertia's inverse, about z that times torque over thrust (m).
    """
    gains = []
    for i, letter in enumerate("XYZ"):
        cross = power = 0.0
        for piece in pieces:
            columns = rotor_columns(piece, drive)
            torque = sum(a * columns[f"{letter}{j}"] for j, a in enumerate(thrust))
            assert isinstance(torque, np.ndarray)
            # turning is the integral of torque: compared where neither is differentiated
            spin = np.cumsum(torque - torque.mean()) * piece.period
            rate = piece.angular_velocity[:, i]
            cross += float(np.sum(_swing(spin, piece.period) * _swing(rate, piece.period)))
            power += float(np.sum(np.square(_swing(spin, piece.period))))
        gains.append(cross / power if power > 0.0 else 0.0)
    return np.array(gains)


def _swing(x: Array, period: float) -> Array:
    """Return what of ``x`` (n,) is faster than about 0.5 Hz."""
    from scipy.signal import butter, sosfiltfilt

    sections = butter(2, [1.0 * period, min(0.9, 16.0 * period)], btype="bandpass", output="sos")
    return np.asarray(sosfiltfilt(sections, x))


def check_order(gains: Array) -> None:
    """Raise InputError where roll and pitch turn against their rotors."""
    for axis, gain in zip(("roll", "pitch"), gains, strict=False):
        if gain < 0.0:
            raise InputError(
                f"{axis} turns against the torque of its rotors; expected rotors in the order "
                "front-left, rear-left, rear-right, front-right, and body axes forward, left, up"
            )
