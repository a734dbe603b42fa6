"""What any flight may have beside effects: columns in standard deviations of their priors, which
are integrated out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...dynamics.effects import Role, playing
from ..motion.smoothing import low_pass
from .priors import MODEL_ERROR, PRIORS
from .rows import Rows
from .time_offsets import timing_of
from .turning_delay import rotor_delay

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NuisanceSettings:
    """Standard deviations of what differs from flight to flight."""

    thrust: float = 0.02  # relative, of a flight against the others: cells, propellers, air
    drift: float = 0.003  # relative, of thrust over a flight, beside the fade and the battery's sag
    delay: float = 0.02  # s, of commands
    tilt: float = 0.01  # rad, of the motion capture's vertical, and of the rotors' mean axis
    accelerometer_bias: float = 0.3  # m/s2, of a MEMS sensor between warm and cold
    accelerometer_scale: float = 0.02  # relative
    stopped: float = 0.1  # s, in which a flight loop stops an angular velocity that it did not want


NUISANCES = NuisanceSettings()


def row_nuisances(rows: Rows) -> dict[str, Array]:
    """Return columns (n, channels) by name, each in standard deviations of its prior."""
    out: dict[str, Array] = {}
    for i in range(len(rows.flights.logs)):
        here = np.zeros(len(rows.flights.t))
        here[rows.flights.log == i] = 1.0
        if here.any():
            of = _Flown(rows, i, here)
            out |= _of_sensors(of)
            out |= _of_commands(of) if rows.flights.commanded else _of_rotors(of)
    if not rows.flights.commanded:
        out |= _of_timing(rows)
    return out


class _Flown:
    """A flight, and what its rotors deliver by the declared vehicle.

    Attributes:
        here: (samples,) 1 in this flight, 0 in others.
        thrust: (samples,) specific, m/s2.
        slope: (samples,) its derivative, m/s3.
        turning: (samples, 3) angular acceleration by the rotors, rad/s2.
        rotation: (samples, 3, 3) body to world.
    """

    def __init__(self, rows: Rows, number: int, here: Array) -> None:
        self.rows, self.number, self.here = rows, number, here
        flights = rows.flights
        vehicle, pieces = flights.vehicle, flights.pieces({})
        self.rotation = np.concatenate([p.signals.rotation[p.rows] for p in pieces])
        wrench, slope = [], []
        for p in pieces:
            s = p.signals
            smooth = low_pass(vehicle.rotor_wrench(s.rotor_speeds), flights.residual_hz, s.period)
            wrench.append(smooth[p.rows])
            slope.append(np.gradient(smooth[:, 0], s.period)[p.rows])
        both = np.concatenate(wrench) * here[:, None]
        self.thrust = both[:, 0] / vehicle.mass
        self.turning = both[:, 1:] / np.diagonal(vehicle.inertia)
        self.slope = np.concatenate(slope) * here / vehicle.mass
        self.none = np.zeros((len(here), 3))

    @staticmethod
    def along(axis: int, size: Array) -> Array:
        return np.asarray(size[:, None] * np.eye(3)[axis])


def _of_commands(of: _Flown) -> dict[str, Array]:
    """Return what differs between flights whose rotors are known by commands.

    Where the delay of commands is known from how the vehicle turns, that of its thrust may still
    differ: the flight loop answers vertical motion.
    """
    rows, flights, use, i = of.rows, of.rows.flights, NUISANCES, of.number
    time = flights.t - flights.t[of.here > 0][0]
    w = 2.0 * time / max(float(time[of.here > 0][-1]), 1e-9) - 1.0
    out = {}
    if len(flights.logs) > 1:
        out[f"thrust {i}"] = use.thrust * rows.from_body(of.along(2, of.thrust))
    out[f"drift {i}"] = use.drift * rows.from_body(of.along(2, of.thrust * w))
    bend = of.thrust * (1.5 * w * w - 0.5)
    out[f"bend {i}"] = use.drift * rows.from_body(of.along(2, bend))
    if rows.fixed:
        out[f"delay {i}"] = use.delay * rows.from_body(of.along(2, -of.slope))
    level = flights.vehicle.gravity * of.here[:, None]
    for axis, name in enumerate("xy"):
        if not flights.inertial:
            tilted = use.tilt * level * of.rotation[:, axis, :]
            out[f"frame tilt {name} {i}"] = rows.from_body(tilted, of.none)
        aside = use.tilt * of.along(axis, of.thrust)
        out[f"thrust axis {name} {i}"] = rows.from_body(aside)
    return out


def _of_rotors(of: _Flown) -> dict[str, Array]:
    """Return by how much the model of measured rotors is wrong.

    A torque's gain is biased low by the share of its column that is noise of the rotor speeds
    (errors in variables).
    """
    rows, i = of.rows, of.number
    noise = rows.flights.rotor_noise
    out = {}
    varying = of.thrust - of.here * of.thrust[of.here > 0].mean()
    out[f"{MODEL_ERROR} of thrust's changes {i}"] = noise[0] * rows.from_body(of.along(2, varying))
    for axis, name in enumerate("xyz"):
        force = PRIORS.model_error * of.along(axis, of.thrust)
        out[f"{MODEL_ERROR} of force {name} {i}"] = rows.from_body(force)
        gain = np.hypot(PRIORS.model_error, noise[1 + axis])
        torque = gain * of.along(axis, of.turning[:, axis])
        out[f"{MODEL_ERROR} of torque {name} {i}"] = rows.from_body(of.none, torque=torque)
    return out


@dataclass(frozen=True, eq=False)
class Follower:
    """A signal that follows disturbances, because the flight loop answers them, or because it is
    the motion that they make.

    Attributes:
        name: of the signal.
        size: (n,) m/s2 or rad/s2: of an angular velocity, what makes it within the time in which
            the loop stops it.
        channels: of the rows, in which the disturbances act.
    """

    name: str
    size: Array
    channels: tuple[int, ...]

    def column(self, rows: Rows, size: Array) -> Array:
        """Return a column (n, channels) that is ``size`` (n,) where the disturbances act."""
        out = np.zeros((len(size), rows.channels))
        out[:, self.channels] = size[:, None]
        return out


def followers(rows: Rows) -> list[Follower]:
    """Return the signals of measured rotors and of the motion that follow disturbances."""
    flights = rows.flights
    inertias = np.array([flights.vehicle.mass, *np.diagonal(flights.vehicle.inertia)])
    wrench = flights.rotor_wrench({}) / inertias
    rates = np.concatenate(
        [
            low_pass(p.signals.angular_velocity, flights.residual_hz, p.signals.period)[p.rows]
            for p in flights.pieces({})
        ]
    )
    rates /= NUISANCES.stopped
    torque = rows.channels - 3
    force = tuple(range(2, torque, 3))
    return [
        Follower("thrust", wrench[:, 0], force),
        *(Follower(f"torque {x}", wrench[:, 1 + i], (torque + i,)) for i, x in enumerate("xyz")),
        *(Follower(f"rate {x}", rates[:, i], (torque + i,)) for i, x in enumerate("xyz")),
    ]


def answered(rows: Rows, signals: Sequence[Follower], disturbance: Array) -> dict[str, Array]:
    """Return what disturbances are where a signal follows them: a share of it.

    A signal that follows a disturbance ``d`` explains the share ``var(d) / var(signal)`` of itself
    as one, whatever the loop. In hover that is all of it, and next to nothing where the flight is
    far from one.

    Args:
        rows: of the flights.
        signals: that follow.
        disturbance: (n, channels) what is one, as far as it is known.
    """
    out = {}
    for signal in signals:
        size = signal.size - signal.size[rows.fit].mean()
        own = disturbance[rows.fit][:, list(signal.channels)]
        share = min(float(own.var(axis=0).max() / max(size[rows.fit].var(), 1e-12)), 1.0)
        out[f"answer by {signal.name}"] = signal.column(rows, share * size)
    return out


def _of_sensors(of: _Flown) -> dict[str, Array]:
    rows, flights, use, i = of.rows, of.rows.flights, NUISANCES, of.number
    out = {}
    if rows.has_accelerometer:
        for axis, name in enumerate("xyz"):
            bias = use.accelerometer_bias * of.along(axis, of.here)
            out[f"accelerometer bias {name} {i}"] = rows.from_body(of.none, bias)
        scaled = use.accelerometer_scale * of.along(2, of.thrust)
        out[f"accelerometer scale {i}"] = rows.from_body(of.none, scaled)
    elif flights.inertial:
        for axis, name in enumerate("xyz"):
            bias = flights.bias_std(i)[axis] * of.along(axis, of.here)
            out[f"accelerometer bias {name} {i}"] = rows.from_body(bias)
    return out


def _of_timing(rows: Rows) -> dict[str, Array]:
    """Return what signals that are apart in time do, to first order."""
    out = {}
    for column, x in rows.columns({}, rows.flights.time_offsets).items():
        timing = timing_of(column, rows.flights.filtered)
        assert timing is not None
        out[column[1]] = timing.size * x
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
