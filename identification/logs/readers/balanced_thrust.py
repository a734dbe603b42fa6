"""Rotor speeds of logs that have commands alone, from relative thrusts: their unknown scale is that
at which thrust carries the vehicle in flight.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ....dynamics.vehicle import Vehicle
from ....runtime.errors import InputError
from ..flight_phases import flying
from ..log_map import Commands
from ..mapped_log import Recording
from ..streams import Stream, readable

Array = NDArray[np.float64]

_STEEPEST = 0.2  # cosine of the tilt below which a sample says nothing


def relative_thrusts(commands: Stream, model: Commands) -> Stream:
    """Return thrusts (N, 4), of any unit, that a map assumes of commands (N, 4), 0 to 1."""
    least, most = model.thrust_span
    a = np.clip((np.clip(commands.values, 0.0, 1.0) - least) / (most - least), 0.0, None)
    factor = model.thrust_factor
    return Stream(commands.name, commands.t, (1.0 - factor) * a + factor * a * a)


def with_balanced_speeds(
    recording: Recording, vehicle: Vehicle | None, landed: Stream | None = None
) -> Recording:
    """Return a recording with rotor speeds (N, 4) in rad/s whose thrust, in flight and on the
    median, is what the vehicle needs; as it is where rotor speeds were measured, or the vehicle is
    not known or has a motor curve.

    Thrust that is needed is mass times the accelerometer along the thrust axis, without one the
    weight over the cosine of the tilt, without either the weight.

    Args:
        recording: with commands, and what its map assumes of them.
        vehicle: its mass, weight and k.
        landed: (M, 1) 1 where the vehicle stood, a value held until the next; None, or never in
            flight: thrust above half its high level is flight.

    Raises:
        InputError: no sample is in flight.
    """
    streams, model = recording.streams, recording.log_map.commands
    if "rotors" in streams or vehicle is None or vehicle.motor_curve is not None or model is None:
        return recording
    relative = relative_thrusts(streams["commands"], model)
    t, total = relative.t, relative.values.sum(axis=1)
    usable = _in_flight(t, total, landed) & (total > 0.0)
    needed, by, span = np.full(len(t), vehicle.weight), "its weight", t
    if (sensed := readable(streams.get("accelerometer"))) is not None:
        needed, span = vehicle.mass * sensed.at(t)[:, 2], sensed.t
        by = "its mass times the accelerometer along the thrust axis"
    elif (pose := readable(streams.get("position"))) is not None:
        q = pose.at(t)[:, 3:]
        upright = 1.0 - 2.0 * (q[:, 1] ** 2 + q[:, 2] ** 2)  # cosine of the tilt
        needed, span = vehicle.weight / np.where(upright > _STEEPEST, upright, np.nan), pose.t
        by = "its weight over the cosine of the tilt"
    usable &= (t >= span[0]) & (t <= span[-1]) & np.isfinite(needed) & (needed > 0.0)
    if not usable.any():
        raise InputError(
            f"{recording.path}: {relative.name}: no sample in flight; expected motors that run"
        )
    scale = float(np.median(needed[usable] / total[usable]))
    speeds = Stream(relative.name, t, np.sqrt(scale * relative.values / vehicle.k))
    note = (
        f"thrust model: the unknown scale is set so that thrust in flight balances {vehicle.name} "
        f"({vehicle.weight:.4g} N) on the median, by {by}: {scale:.4g} N a motor at full command. "
        f"Mass or a factor on thrust cannot be found from this log; rotor speeds are "
        "sqrt(thrust / k) of commands, without the motors' lag"
    )
    return replace(recording, streams={**streams, "rotors": speeds}, notes=[*recording.notes, note])


def _in_flight(t: Array, total: Array, landed: Stream | None) -> NDArray[np.bool_]:
    """Return at which times (N,) in s of total thrusts (N,) the vehicle flies."""
    if landed is not None and len(landed.t):
        before = np.searchsorted(landed.t, t, side="right") - 1
        found: NDArray[np.bool_] = (landed.values[np.maximum(before, 0), 0] == 0.0) & (total > 0.0)
        if found.any():
            return found
    return flying(total)
