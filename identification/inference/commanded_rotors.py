"""Logs whose turn rates are worked out from commands (PWM, thrust): what of them a regression may
use, and what it must allow.

Such a flight's thrust is known but for a factor that changes from one flight to the next
(propellers, cells), its motion capture may have been set up anew in between, and its rotors'
moments are those that somebody asked for. So only the time in the air counts, torque is left out,
and each of several flights has a thrust scale and a lean of its own. They are deviations: their
mean over the flights is zero, so that what the flights have in common remains for effects to
explain.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...dynamics.vehicle import Vehicle
from ..logs.flight_log import FlightLog, with_rows
from ..logs.flight_phases import FLIGHT, flight_phases
from ..motion.signals import Signals
from ..motion.smoothing import CUTOFFS, low_pass

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CommandedSettings:
    """What a regression allows for where rotor speeds are worked out from commands."""

    period: float = 0.02  # s, of the samples that are used
    # factor on what an effect of ``SECOND_CHOICE_EFFECTS`` explains, where it is compared
    second_choice_factor: float = 0.8
    # typical size and range of a flight's deviation from the others: relative, and rad
    thrust_scale_size: tuple[float, float] = (0.02, 0.5)
    tilt_size: tuple[float, float] = (0.01, 0.2)


COMMANDED = CommandedSettings()
THRUST_SCALE, TILT_X, TILT_Y = "thrust scale", "tilt x", "tilt y"
DEVIATION_SIZES = {
    THRUST_SCALE: COMMANDED.thrust_scale_size,
    TILT_X: COMMANDED.tilt_size,
    TILT_Y: COMMANDED.tilt_size,
}
# of effects that are alike, those that must explain a little more than the others: a force beside
# an error of measurement, and a mass beside the scale of thrust, which is known to be unknown
SECOND_CHOICE_EFFECTS = frozenset({"constant_force", "thrust_axis_tilt", "mass", "clock_offset"})

# effects of which force alone says nothing, or of which a law of thrust that is itself a guess says
# nothing
NOT_FROM_COMMANDS = frozenset(
    {
        "rotor_efficiency",
        "com_offset",
        "inertia",
        "constant_torque",
        "rate_damping",
        "flapping_moment",
        "rotor_inertia",
    }
)
# effects that say nearly the same of a flight in closed loop that hardly turns in yaw: one of each
# kind is enough
_ALIKE = (
    frozenset({"world_tilt", "thrust_axis_tilt", "constant_force"}),
    frozenset({"motor_lag", "latency", "clock_offset"}),
    frozenset({"rotor_drag", "body_drag"}),
    frozenset({"thrust_scale", "mass"}),
)
# what bends the law of thrust further, once it is known to follow the battery's voltage: without
# that they would take up whatever thrust lacks
AFTER_SAG = frozenset({"thrust_curvature", "thrust_fade"})


def in_flight(log: FlightLog, vehicle: Vehicle) -> FlightLog:
    """Return the rows of a log between take-off and landing; the log itself where it shows neither,
    or no flight at all.
    """
    seen = log.valid
    if not seen.any():
        return log
    height = np.interp(log.t, log.t[seen], log.position[seen, 2])
    flight = [
        p for p in flight_phases(log.t, height, log.rotor_speeds, vehicle) if p.name == FLIGHT
    ]
    if not flight:
        return log
    return with_rows(log, (log.t >= flight[0].start) & (log.t <= flight[0].end))


def thinned(signals: Signals) -> Signals:
    """Return signals at 50 Hz or a little more, with the turn rates through the filter that the
    pose went through.
    """
    step = max(1, int(COMMANDED.period / signals.period + 1e-6))
    if step == 1:
        return signals
    at = np.arange(0, len(signals.t), step)
    smooth = np.maximum(low_pass(signals.rotor_speeds, CUTOFFS.pose_hz, signals.period), 0.0)
    return Signals(
        signals.t[at],
        step * signals.period,
        signals.position[at],
        signals.rotation[at],
        signals.velocity[at],
        signals.acceleration[at],
        signals.rate[at],
        signals.angular_acceleration[at],
        smooth[at],
        None if signals.voltage is None else signals.voltage[at],
    )


def mates(effect: str) -> frozenset[str]:
    """Return the effects that say nearly the same as this one."""
    return next((group - {effect} for group in _ALIKE if effect in group), frozenset())


def takes_back(setting: Mapping[str, Mapping[str, float]], weight: float) -> bool:
    """Return whether a constant force works against the thrust's scale, by half as much or more: a
    guess against a guess.
    """
    force, scale = (
        setting.get("constant_force", {}).get("fz", 0.0),
        setting.get("thrust_scale", {}).get("s", 0.0),
    )
    return force * scale < 0.0 and abs(force) > 0.5 * abs(scale) * weight


def deviations(count: int) -> list[tuple[str, str]]:
    """Return the columns of the deviations of ``count`` flights; none of a single one."""
    return [("", f"{kind} {i}") for kind in DEVIATION_SIZES for i in range(1, count)]


def deviation(setting: Mapping[str, Mapping[str, float]], kind: str, log: int, count: int) -> float:
    """Return by how much flight ``log`` of ``count`` deviates from what they have in common; 0 for
    a flight that is no part.
    """
    values = setting.get("", {})
    if log >= count or count < 2:
        return 0.0
    # coefficient i sets flight i apart from those before it: the columns are orthogonal and each
    # sums to zero
    return float(
        sum(
            values.get(f"{kind} {i}", 0.0) * (1.0 if log == i else -1.0 / i if log < i else 0.0)
            for i in range(1, count)
        )
    )


def size_of(name: str) -> tuple[float, float] | None:
    """Return typical size and range of a deviation, None for any other column."""
    return next(
        (size for kind, size in DEVIATION_SIZES.items() if name.startswith(kind + " ")), None
    )


def shared(setting: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, float]]:
    """Return a setting without deviations: what holds for any flight of the vehicle."""
    return {
        effect: {name: x for name, x in values.items() if effect or size_of(name) is None}
        for effect, values in setting.items()
    }


def commanded(logs: Sequence[FlightLog]) -> bool:
    """Return whether any log's turn rates are worked out from commands."""
    return any(log.commanded for log in logs)
