"""Which channels of the logs carry a finding: those in which it leaves its trace, and those that
its effect model reads.

Both are computed. The trace is the share of the effect's deviance in the balance of forces and in
that of torques; what the model reads shows where its wrench changes with an input.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...dynamics.effects import get
from ..motion.residual import acting_wrench
from ..motion.signals import Signals
from .regression import Flights, Setting, without

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ChannelSettings:
    """From when on a channel carries an effect, and by how much inputs are changed to see it."""

    least_share: float = 0.05  # of the effect's deviance, in the forces or in the torques
    least_change: float = 0.01  # of the effect's wrench, as an input changes
    speed: float = 1.05  # factor on rotor speeds
    voltage: float = 0.97  # factor
    position: float = 0.1  # m
    velocity: float = 0.5  # m/s
    angle: float = 0.1  # rad
    rate: float = 0.3  # rad/s
    most_samples: int = 2000  # of the first piece: enough to see a change


CHANNELS = ChannelSettings()
ORDER = (
    "position",
    "attitude",
    "accelerometer",
    "gyro",
    "rotor speeds",
    "motor commands",
    "battery voltage",
)


def carrying_channels(flights: Flights, setting: Setting, effect: str) -> tuple[str, ...]:
    """Return the channels that carry a named effect at a setting, in the order of ``ORDER``: those
    in which it leaves its trace, and those that its model reads.
    """
    found = {*_traces(flights, setting, effect), *_read(flights, setting, effect)}
    return tuple(channel for channel in ORDER if channel in found)


def _traces(flights: Flights, setting: Setting, effect: str) -> Iterator[str]:
    """Yield the channels in which an effect leaves its trace."""
    part = flights.residual(without(setting, effect)) - flights.residual(setting)
    noise = np.mean(np.square(flights.sensor_noise), axis=0) + 1e-30
    power = np.mean(np.square(part), axis=0) / noise
    whole = max(float(power.sum()), 1e-30)
    if power[:3].sum() / whole > CHANNELS.least_share:
        yield "accelerometer" if flights.inertial else "position"
    if power[3:].sum() / whole > CHANNELS.least_share and not flights.commanded:
        yield "gyro" if flights.inertial else "attitude"


def _read(flights: Flights, setting: Setting, effect: str) -> Iterator[str]:
    """Yield the channels that an effect's model reads."""
    if get(effect).kind == "sensing":
        yield from ("position", "attitude")
        return
    s = flights.pieces(setting)[0].signals.at(slice(CHANNELS.most_samples))
    own = _wrench(flights, setting, effect, s)
    size = float(np.sqrt(np.mean(np.square(own), axis=0)).sum())
    placed = any(np.isfinite(log.position).any() for log in flights.logs)
    names = {
        "rotor speeds": "motor commands" if flights.commanded else "rotor speeds",
        "position": "position" if placed else "accelerometer",
        "velocity": "position" if placed else "accelerometer",
        "attitude": "gyro" if flights.inertial else "attitude",
        "angular velocity": "gyro" if flights.inertial else "attitude",
    }
    for name, changed in _changed(s):
        moved = _wrench(flights, setting, effect, changed) - own
        change = float(np.sqrt(np.mean(np.square(moved), axis=0)).sum())
        if change > CHANNELS.least_change * max(size, 1e-12):
            yield names.get(name, name)


def _changed(s: Signals) -> Iterator[tuple[str, Signals]]:
    """Yield signals with one input changed, and the input's name."""
    yield "rotor speeds", replace(s, rotor_speeds=CHANNELS.speed * s.rotor_speeds)
    if s.voltage is not None:
        yield "battery voltage", replace(s, voltage=CHANNELS.voltage * s.voltage)
    yield "position", replace(s, position=s.position + CHANNELS.position)
    yield "velocity", replace(s, velocity=s.velocity + CHANNELS.velocity)
    turn = Rotation.from_rotvec([CHANNELS.angle, -CHANNELS.angle, CHANNELS.angle]).as_matrix()
    yield "attitude", replace(s, rotation=s.rotation @ turn)
    yield "angular velocity", replace(s, angular_velocity=s.angular_velocity + CHANNELS.rate)


def _wrench(flights: Flights, setting: Setting, effect: str, s: Signals) -> Array:
    """Return what an effect adds (n, 6) by the rotor speeds, both in body axes: force over the
    weight, torque over the weight times the arm.
    """
    vehicle = flights.vehicle
    a, b = (
        acting_wrench(s, flights.amended(x), vehicle)[0]
        for x in (setting, without(setting, effect))
    )
    off = a - b
    force = np.einsum("nji,nj->ni", s.rotation, off[:, :3])
    return np.column_stack([force / vehicle.weight, off[:, 3:] / (vehicle.weight * vehicle.arm_l)])
