"""What any flight may have beside effects where rotors are known by commands: columns in standard
deviations of their priors, which are integrated out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...dynamics.effects import Role, playing
from ..inference.turning_delay import rotor_delay
from ..motion.smoothing import CUTOFFS, low_pass
from .force_rows import ForceRows

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NuisanceSettings:
    """Standard deviations of what differs from flight to flight."""

    thrust: float = 0.02  # relative, of a flight against the others: cells, propellers, air
    drift: float = 0.003  # relative, of thrust over a flight, beside the fade and the battery's sag
    delay: float = 0.02  # s, of commands
    frame_tilt: float = 0.01  # rad, of the motion capture's vertical
    thrust_axis: float = 0.01  # rad, of the rotors' mean axis
    accelerometer_bias: float = 0.3  # m/s2, of a MEMS sensor between warm and cold
    accelerometer_scale: float = 0.02  # relative


NUISANCES = NuisanceSettings()


def force_nuisances(rows: ForceRows) -> dict[str, Array]:
    """Return columns (n, channels) by name, each in standard deviations of its prior.

    Where the delay of commands is known from how the vehicle turns, that of its thrust may still
    differ: the flight loop answers vertical motion.
    """
    flights = rows.flights
    several = len(flights.logs) > 1
    out: dict[str, Array] = {}
    begins = np.flatnonzero(flights.start)
    pieces = flights.pieces({})
    for i in range(len(flights.logs)):
        here = np.zeros(len(flights.t))
        here[flights.log == i] = 1.0
        if not here.any():
            continue
        thrust, slope = np.zeros(len(flights.t)), np.zeros(len(flights.t))
        rotation = np.concatenate([p.signals.rotation[p.rows] for p in pieces])
        for begin, piece in zip(begins, pieces, strict=True):
            own = slice(begin, begin + len(piece.rows))
            s = piece.signals
            specific = flights.vehicle.rotor_wrench(s.rotor_speeds)[:, 0] / flights.vehicle.mass
            smooth = low_pass(specific, CUTOFFS.residual_hz, s.period)
            thrust[own], slope[own] = smooth[piece.rows], np.gradient(smooth, s.period)[piece.rows]
        thrust, slope = thrust * here, slope * here
        time = flights.t - flights.t[here > 0][0]
        w = 2.0 * time / max(float(time[here > 0][-1]), 1e-9) - 1.0
        use = NUISANCES
        none = np.zeros((len(here), 3))

        def along(axis: int, size: Array) -> Array:
            return np.asarray(size[:, None] * np.eye(3)[axis])

        if several:
            out[f"thrust {i}"] = use.thrust * rows.from_body(along(2, thrust))
        out[f"drift {i}"] = use.drift * rows.from_body(along(2, thrust * w))
        out[f"bend {i}"] = use.drift * rows.from_body(along(2, thrust * (1.5 * w * w - 0.5)))
        if rows.fixed:
            out[f"delay {i}"] = use.delay * rows.from_body(along(2, -slope))
        level = flights.vehicle.gravity * here[:, None]
        for axis, name in enumerate("xy"):
            tilted = use.frame_tilt * level * rotation[:, axis, :]
            if not flights.inertial:
                out[f"frame tilt {name} {i}"] = rows.from_body(tilted, none)
            out[f"thrust axis {name} {i}"] = use.thrust_axis * rows.from_body(along(axis, thrust))
        if rows.has_accelerometer:
            for axis, name in enumerate("xyz"):
                bias = use.accelerometer_bias * along(axis, here)
                out[f"accelerometer bias {name} {i}"] = rows.from_body(none, bias)
            scaled = use.accelerometer_scale * along(2, thrust)
            out[f"accelerometer scale {i}"] = rows.from_body(none, scaled)
        elif flights.inertial:
            for axis, name in enumerate("xyz"):
                bias = flights.bias_std(i)[axis] * along(axis, here)
                out[f"accelerometer bias {name} {i}"] = rows.from_body(bias)
    return out


def calibrations(library: Sequence[str]) -> list[str]:
    """Return the effects of a library that any vehicle has whose rotors are known by commands: how
    much thrust a command makes and when, how it bends, and how it goes with voltage and time.

    They are fitted in every set, and are no discovery. Of thrust and mass a flight shows the ratio:
    one of them is enough.
    """
    roles = (Role.THRUST_CURVE, Role.THRUST_OVER_VOLTAGE, Role.THRUST_OVER_TIME)
    thrust = playing(Role.THRUST, among=library) or playing(Role.MASS, among=library)
    delay = rotor_delay(library)
    return [*thrust, *playing(*roles, among=library), *([delay] if delay else [])]
