"""Rotor speeds of logs that have commands alone, from relative thrusts: their unknown scale is that
at which thrust carries the vehicle in flight.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ....dynamics.vehicle import Vehicle
from ....runtime.errors import InputError
from ..streams import Stream

Array = NDArray[np.float64]

_STEEPEST = 0.2  # cosine of the tilt below which a sample says nothing


def balanced_speeds(
    path: Path,
    relative: Stream,
    vehicle: Vehicle,
    in_flight: NDArray[np.bool_],
    accelerometer: Stream | None,
    pose: Stream | None,
) -> tuple[Stream, str]:
    """Return rotor speeds (N, 4) in rad/s whose thrust, in flight and on the median, is what the
    vehicle needs, and the note that says so.

    Thrust that is needed is mass times the accelerometer along the thrust axis, without one the
    weight over the cosine of the tilt, without either the weight.

    Args:
        path: the file, for errors.
        relative: thrusts (N, 4) in the kit's order, of any unit.
        vehicle: its mass, weight and k.
        in_flight: (N,) which samples count.
        accelerometer: m/s2, body, z along thrust.
        pose: (M, 7) position and scalar-first quaternion.

    Raises:
        InputError: no sample is in flight.
    """
    t, total = relative.t, relative.values.sum(axis=1)
    usable = in_flight & (total > 0.0)
    needed, by, span = np.full(len(t), vehicle.weight), "its weight", t
    if accelerometer is not None and len(accelerometer.t) >= 2:
        sensed = accelerometer.forward()[0]
        needed, span = vehicle.mass * sensed.at(t)[:, 2], sensed.t
        by = "its mass times the accelerometer along the thrust axis"
    elif pose is not None:
        whole = np.isfinite(pose.values).all(axis=1)
        seen = Stream(pose.name, pose.t[whole], pose.values[whole]).forward()[0]
        q = seen.at(t)[:, 3:]
        upright = 1.0 - 2.0 * (q[:, 1] ** 2 + q[:, 2] ** 2)  # cosine of the tilt
        needed, span = vehicle.weight / np.where(upright > _STEEPEST, upright, np.nan), seen.t
        by = "its weight over the cosine of the tilt"
    usable &= (t >= span[0]) & (t <= span[-1]) & np.isfinite(needed) & (needed > 0.0)
    if not usable.any():
        raise InputError(f"{path}: {relative.name}: no sample in flight; expected motors that run")
    scale = float(np.median(needed[usable] / total[usable]))
    return Stream(relative.name, t, np.sqrt(scale * relative.values / vehicle.k)), (
        f"thrust model: the unknown scale is set so that thrust in flight balances {vehicle.name} "
        f"({vehicle.weight:.4g} N) on the median, by {by}: {scale:.4g} N a motor at full command. "
        f"Mass or a factor on thrust cannot be found from this log; rotor speeds are "
        "sqrt(thrust / k) of commands, without the motors' lag"
    )
