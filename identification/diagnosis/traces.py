"""The evidence of a finding in the logs: the quantity it follows most closely, the channels with
its trace, and the channels its effect model reads.

All are computed. The trace is the share of the effect's deviance in the balances of forces and of
torques. A model reads an input if its wrench changes with it.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from ...dynamics.effects import get
from ..findings import CHANNELS, Signature
from ..logs.table import Array, Names
from ..motion.signals import Signals, in_body
from ..motion.smoothing import mean_square
from .coefficients import Setting, weight_and_torque, without
from .discrepancy import heading_of
from .regression import RegressedFlights

# least shares for a channel to carry an effect: of its deviance, in the forces or in the torques,
# and of its wrench, with a changed input
LEAST_SHARE = 0.05
LEAST_CHANGE = 0.01
ORDER = (
    "position",
    "attitude",
    "accelerometer",
    "gyro",
    "rotor speeds",
    "motor commands",
    "battery voltage",
)


def signature(
    flights: RegressedFlights, setting: Setting, effect: str, share: Array, after: Array
) -> Signature:
    """Return the channel of an effect's largest part, against the quantity it follows most closely.

    Args:
        flights: the vehicle's flights.
        setting: coefficients of all effects.
        effect: its name.
        share: of the effect in the residual (rows, 6).
        after: the residual (rows, 6) with all effects.
    """
    noise = np.maximum(flights.sensor_noise.std(axis=0), 1e-12)
    size = share.std(axis=0) / noise
    channel = int(np.argmax(size if np.any(size > 0.3) else np.abs(share).mean(axis=0) / noise))
    y = share[:, channel]
    name, x = max(
        _explanatory_variables(flights, setting),
        key=lambda d: abs(np.corrcoef(d[1], y)[0, 1]) if y.std() > 1e-9 else 0.0,
    )
    return Signature(effect, CHANNELS[channel], name, x, y + after[:, channel], y)


def _explanatory_variables(flights: RegressedFlights, setting: Setting) -> list[tuple[str, Array]]:
    """Return the explanatory variables of a force at the rows, named with their units."""
    position = flights.at_rows("position", setting)
    rotation = flights.at_rows("rotation", setting)
    pieces = flights.pieces(setting)
    rate = np.concatenate([p.smooth(p.signals.angular_velocity) for p in pieces])
    body = in_body(flights.at_rows("velocity", setting), rotation)
    speed = np.linalg.norm(body, axis=1)
    heading = heading_of(rotation)
    in_axes = (("body velocity", "m/s", body), ("angular velocity", "rad/s", rate))
    named = {
        f"{name} {axis} ({unit})": along
        for name, unit, x in (*in_axes, ("world position", "m", position[:, :2]))
        for axis, along in zip("xyz", x.T, strict=False)
    }
    named |= {
        "speed (m/s)": speed,
        "squared speed (m2/s2)": speed**2,
        "height (m)": position[:, 2],
        "sine of the heading": np.sin(heading),
        "cosine of the heading": np.cos(heading),
        "time (s)": flights.at_rows("t", setting),
    }
    if flights.rotor_speeds_vary:
        named["thrust (N)"] = flights.rotor_wrench(setting)[:, 0]
    if all(p.signals.voltage is not None for p in pieces):
        named["battery voltage (V)"] = flights.at_rows("voltage", setting)
    return [(name, x) for name, x in named.items() if x.std() > 1e-9]


def carrying_channels(flights: RegressedFlights, setting: Setting, effect: str) -> Names:
    """Return the channels that carry a named effect at a setting, in the order of ``ORDER``: the
    channels with its trace, and the channels read by its model.
    """
    part = flights.residual(without(setting, effect)) - flights.residual(setting)
    noise = mean_square(flights.sensor_noise) + 1e-30
    force, torque = (mean_square(part) / noise).reshape(2, 3).sum(axis=1)
    least = LEAST_SHARE * max(force + torque, 1e-30)
    place, turn = ("accelerometer", "gyro") if flights.inertial else ("position", "attitude")
    carrying = {*_read(flights, setting, effect)}
    if force > least:
        carrying.add(place)
    if torque > least and not flights.commanded:
        carrying.add(turn)
    return tuple(channel for channel in ORDER if channel in carrying)


def _read(flights: RegressedFlights, setting: Setting, effect: str) -> Iterator[str]:
    """Yield the channels read by an effect's model."""
    if get(effect).kind == "sensing":
        yield from ("position", "attitude")
        return
    less = without(setting, effect)
    unit = weight_and_torque(flights.vehicle, 1.0)

    def added(s: Signals) -> Array:
        """Return the effect's wrench (n, 6) in body axes, over the weight and the weight times the
        arm.
        """
        off = flights.acting(s, setting) - flights.acting(s, less)
        return np.column_stack([in_body(off[:, :3], s.rotation), off[:, 3:]]) / unit

    s = flights.pieces(setting)[0].signals.at(slice(2000))  # enough to see a change
    own = added(s)
    least = LEAST_CHANGE * max(np.sqrt(mean_square(own)).sum(), 1e-12)
    placed = any(np.isfinite(log.position).any() for log in flights.logs)
    place = "position" if placed else "accelerometer"
    turn = "gyro" if flights.inertial else "attitude"
    rotors = "motor commands" if flights.commanded else "rotor speeds"
    turned = s.rotation @ Rotation.from_rotvec([0.1, -0.1, 0.1]).as_matrix()
    # inputs, changed by some per cent, or by their variation in a calm flight (SI units)
    changed = [
        (rotors, {"rotor_speeds": 1.05 * s.rotor_speeds}),
        (place, {"position": s.position + 0.1}),
        (place, {"velocity": s.velocity + 0.5}),
        (turn, {"rotation": turned}),
        (turn, {"angular_velocity": s.angular_velocity + 0.3}),
    ]
    if s.voltage is not None:
        changed.append(("battery voltage", {"voltage": 0.97 * s.voltage}))
    for channel, moved in changed:
        if np.sqrt(mean_square(added(replace(s, **moved)) - own)).sum() > least:
            yield channel
