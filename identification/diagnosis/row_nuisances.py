"""What any flight may have beside effects: columns in standard deviations of their priors, which
are integrated out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .log_offsets import ROTOR_TIME_OFFSET
from .priors import MODEL_ERROR, PRIORS
from .rows import Rows

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NuisanceSettings:
    """Standard deviations of what differs from flight to flight."""

    thrust: float = 0.02  # relative, of a flight against what is usual: cells, propellers, air
    drift: float = 0.003  # relative, of thrust over a flight, beside the fade and the battery's sag
    delay: float = 0.02  # s, of commands
    tilt: float = 0.01  # rad, of the motion capture's vertical, and of the rotors' mean axis
    accelerometer_bias: float = 0.3  # m/s2, of a MEMS sensor between warm and cold
    accelerometer_scale: float = 0.02  # relative
    stopped: float = 0.1  # s, in which a flight loop stops an angular velocity that it did not want


NUISANCES = NuisanceSettings()


def row_nuisances(rows: Rows) -> dict[str, Array]:
    """Return columns (n, channels) by name, each in standard deviations of its prior.

    Of thrust at a command they are the differences between flights: what all flights share is the
    thrust's own coefficient, and a column nearly like its own would with it be a lag or a drag.
    """
    out: dict[str, Array] = {}
    count = len(rows.flights.logs)
    for i in range(count):
        here = np.zeros(len(rows.flights.t))
        here[rows.flights.log == i] = 1.0
        if here.any():
            of = _Flown(rows, i, here)
            out |= _of_sensors(of)
            out |= _of_commands(of) if rows.flights.commanded else _of_rotors(of)
    differ = [name for name in (f"thrust {i}" for i in range(count)) if name in out]
    shared = sum(out[name] for name in differ) / max(len(differ), 1)
    out |= {name: out[name] - shared for name in differ}
    offsets = rows.flights.offsets
    found = rows.columns({}, offsets)
    return out | {c[1]: offsets[c].size * x for c, x in found.items()}


class _Flown:
    """A flight, and what its rotors deliver by the declared vehicle.

    Attributes:
        here: (samples,) 1 in this flight, 0 in others.
        thrust: (samples,) specific, m/s2.
        turning: (samples, 3) angular acceleration by the rotors, rad/s2.
        none: (samples, 3) zero.
    """

    def __init__(self, rows: Rows, number: int, here: Array) -> None:
        self.rows, self.number, self.here = rows, number, here
        rotors = rows.flights.rotor_wrench({}) / rows.flights.inertias[2:] * here[:, None]
        self.thrust, self.turning = rotors[:, 0], rotors[:, 1:]
        self.none = np.zeros((len(here), 3))

    @staticmethod
    def along(axis: int, size: Array) -> Array:
        return np.asarray(size[:, None] * np.eye(3)[axis])


def _of_commands(of: _Flown) -> dict[str, Array]:
    """Return what differs between flights whose rotors are known by commands.

    From one sample to the next rotors may be held or not, and lag: half a period is not known.
    Where the delay of commands is known from how the vehicle turns, that of its thrust may still
    differ: the flight loop answers vertical motion.
    """
    rows, flights, use, i = of.rows, of.rows.flights, NUISANCES, of.number
    time = flights.t - flights.t[of.here > 0][0]
    w = 2.0 * time / max(float(time[of.here > 0][-1]), 1e-9) - 1.0
    out = {f"thrust {i}": use.thrust * rows.from_body(of.along(2, of.thrust))}
    out[f"drift {i}"] = use.drift * rows.from_body(of.along(2, of.thrust * w))
    bend = of.thrust * (1.5 * w * w - 0.5)
    out[f"bend {i}"] = use.drift * rows.from_body(of.along(2, bend))
    late = rows.columns({}, [ROTOR_TIME_OFFSET])[ROTOR_TIME_OFFSET]
    delay = 0.5 * flights.pieces({})[0].signals.period + (use.delay if rows.fixed else 0.0)
    out[f"delay {i}"] = delay * rows.at_rows(of.here)[:, None] * late
    level = flights.vehicle.gravity * of.here[:, None]
    for axis, name in enumerate("xy"):
        if not flights.inertial:
            tilted = use.tilt * level * rows.rotation[:, axis, :]
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


def followers(rows: Rows) -> list[Follower]:
    """Return the signals of rotors and of the motion that follow disturbances.

    A flight loop answers a sideways disturbance by tilting, and the noise of a measured tilt looks
    like one that it answers: in hover, tilt is hardly anything else. It answers the velocity that a
    vertical disturbance makes by thrust, and its acceleration by a change of thrust. The change is
    in the size of thrust's own variation. Of commands tilt alone is one: with thrust beside it,
    flights of NanoBench were predicted worse than by constant thrust (.28 for .14 m/s2).
    """
    flights = rows.flights
    torque = rows.channels - 3 * rows.with_torques
    along = [tuple(range(axis, torque, 3)) for axis in range(3)]
    tilt = rows.at_rows(flights.vehicle.gravity * rows.rotation[:, 2, :2])
    tilts = [Follower(f"tilt {x}", tilt[:, i], along[i]) for i, x in enumerate("xy")]
    if not rows.with_torques:
        return tilts
    delivered = flights.rotor_wrench({}) / flights.inertias[2:]
    change = np.concatenate([np.gradient(delivered[run, 0]) for run in flights.runs])
    change *= delivered[:, 0].std() / max(float(change.std()), 1e-12)
    wrench = rows.at_rows(np.column_stack([delivered, change]))
    turned = [p.smooth(p.signals.angular_velocity) for p in flights.pieces({})]
    rates = rows.at_rows(np.concatenate(turned) / NUISANCES.stopped)
    return [
        *tilts,
        Follower("thrust", wrench[:, 0], along[2]),
        Follower("change of thrust", wrench[:, 4], along[2]),
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
        column = out[f"answer by {signal.name}"] = np.zeros((len(size), rows.channels))
        column[:, signal.channels] = share * size[:, None]
    return out


def _of_sensors(of: _Flown) -> dict[str, Array]:
    rows, use, i = of.rows, NUISANCES, of.number
    out = {}
    if rows.has_accelerometer:
        for axis, name in enumerate("xyz"):
            bias = use.accelerometer_bias * of.along(axis, of.here)
            out[f"accelerometer bias {name} {i}"] = rows.from_body(of.none, bias)
        scaled = use.accelerometer_scale * of.along(2, of.thrust)
        out[f"accelerometer scale {i}"] = rows.from_body(of.none, scaled)
    return out
