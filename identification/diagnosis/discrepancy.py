"""A dictionary of columns for an effect outside the library: one of these is its variable.

The columns are of the filter's predicted state: none holds the noise of the pose to come.
"""

import itertools
from collections.abc import Iterable

import numpy as np

from ..logs.table import Array, ArrayMap, NamedArrays, Rows, median_step
from ..motion.signals import Signals, in_body
from ..motion.smoothing import filtered
from .coefficients import weight_and_torque
from .column import Column, Columns, Part, Product, along_axis
from .regression import RegressedFlights

HEIGHTS = (0.2, 0.6)  # m above the lowest place: where a bump falls off
# Hz: a load on a cable of 0.1 to 1.5 m, and a part on a soft mount
LOAD_HZ = (0.4, 0.55, 0.75, 1.0, 1.4)
MOUNT_HZ = (1.0, 1.6, 2.5, 4.0, 6.0)
DAMPING_RATIO = 0.08  # of both
# times ``sets.UNKNOWN_SIZES``: change of an effect's coefficients, as a share of its own wrench,
# with one standard deviation of a variable
SHARE_OF_EFFECT = 30.0


def _scaled(x: Array) -> Array:
    x = x - x.mean()
    size = np.sqrt(np.mean(np.square(x)))
    return x / size if size > 1e-9 else np.zeros_like(x)


def discrepancy_columns(
    whole: Signals, rotors: Array, ends: Rows, flights: RegressedFlights
) -> Columns:
    """Return accelerations (n, 6) by column, each of a standard deviation of the weight, or of the
    weight times the arm.

    Args:
        whole: the signals of all pieces.
        rotors: (n, 4) accelerations by the rotors' thrust and torques: m/s2, rad/s2, body.
        ends: the pieces' ends without the last.
        flights: the vehicle's flights.
    """
    t, position, rotation = whole.t, whole.position, whole.rotation
    rate = whole.angular_velocity
    body = in_body(whole.velocity, rotation)
    # from the sample before: later samples hold the poses' noise
    change = np.diff(rotors, axis=0, prepend=rotors[:1])
    size = weight_and_torque(flights.vehicle) / flights.inertias
    one = Product.ones(len(t))
    torques = range(3, 6)
    out: Columns = {}

    def add(group: str, name: str, x: Array, channels: Iterable[int] = range(6)) -> None:
        z = _scaled(x)
        for i in channels if z.any() else ():
            column = Product(size[i], z, *along_axis(i, rotation))
            out[Column("", name, Part.UNKNOWN, i, group)] = column

    for i, axis in enumerate("xyz"):
        along = body[:, i]
        add("velocity", f"velocity {axis}", along)
        add("velocity", f"squared velocity {axis}", along * np.abs(along))
        add("rotors", f"angular velocity {axis}", rate[:, i])
        add("rotors", f"torque {axis}", rotors[:, 1 + i], torques)
        add("rotors", f"change of torque {axis}", change[:, 1 + i], (3 + i,))
    add("rotors", "thrust", rotors[:, 0])
    add("rotors", "change of thrust", change[:, 0], (2, *torques))
    for a, b in ((0, 1), (1, 2), (0, 2)):
        axes = f"{'xyz'[a]} and {'xyz'[b]}"
        add("velocity", f"velocities {axes}", body[:, a] * body[:, b])
        add("rotors", f"angular velocities {axes}", rate[:, a] * rate[:, b], torques)
    for i, name in enumerate(("x", "y", "height")):
        add("place", name, position[:, i])
    for height in HEIGHTS:
        above = position[:, 2].min() - position[:, 2]
        add("place", f"height below {height:g} m", np.exp(above / height))
    heading = heading_of(rotation)
    add("place", "heading's sine", np.sin(heading))
    add("place", "heading's cosine", np.cos(heading))
    for i, axis in enumerate("xy"):
        add("place", f"tilt {axis}", rotation[:, 2, i])
    turn = np.pi * (t - t[0]) / max(t[-1] - t[0], 1e-9)
    for i in (1, 2, 3):
        add("time", f"time {i}", np.cos(i * turn))
    period = median_step(t)
    for hertz, i in itertools.product(MOUNT_HZ, range(3)):
        swing = _resonance(rotors[:, 1 + i], hertz, period, ends)
        add("resonance", f"a part that swings at {hertz:g} Hz", swing, (3 + i,))
    for i in range(6):
        made = Product(size[i], one, one[:, None], i)
        out[Column("", "a constant", Part.UNKNOWN, i, "constant")] = made
    for hertz in LOAD_HZ:
        swing = _resonance(whole.acceleration[:, :2], hertz, period, ends)
        made = Product(size[0] / max(swing.std(), 1e-9), one, swing)
        load = f"a load that swings at {hertz:g} Hz"
        out[Column("", load, Part.UNKNOWN, 0, "resonance")] = made
    return out


def heading_of(rotation: Array) -> Array:
    """Return the headings (n,), rad, of attitudes (n, 3, 3)."""
    return np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])


def _resonance(drive: Array, hertz: float, period: float, ends: Rows) -> Array:
    """Return the reaction (n, ...) of a pendulum or a spring to the acceleration of its base."""
    # s'' = -a - rate^2 s - 2 damping rate s'; the pull is rate^2 s + 2 damping rate s'
    rate = 2.0 * np.pi * hertz
    back = np.array([0.0, 4.0 * DAMPING_RATIO * rate / period, rate**2])
    both = np.append(-back, back)
    both[3] = 4.0 / period**2
    # the bilinear transform of both
    section = both @ np.kron(np.eye(2), [[1, -2, 1], [1, 0, -1], [1, 2, 1]])
    return np.concatenate([filtered(x, section / section[3]) for x in np.split(drive, ends)])


def variables(whole: Signals, rotors: Array) -> NamedArrays:
    """Return the variables (n,) of a changing coefficient by name, of mean zero and standard
    deviation one.
    """
    position = whole.position
    heading = heading_of(whole.rotation)
    speed = np.linalg.norm(whole.velocity, axis=1)
    raw = {
        "speed": speed,
        "speed, squared": speed**2,
        "climb rate": whole.velocity[:, 2],
        "height": position[:, 2],
        "position x": position[:, 0],
        "position y": position[:, 1],
        "heading's sine": np.sin(heading),
        "heading's cosine": np.cos(heading),
        "time": whole.t,
        "thrust": rotors[:, 0],
        "yaw rate": whole.angular_velocity[:, 2],
    }
    return {name: z for name, x in raw.items() if (z := _scaled(x)).any()}


def changing_columns(parts: ArrayMap, followed: ArrayMap) -> Columns:
    """Return columns of coefficients changing with a variable.

    Args:
        parts: wrench of each effect of a set (n, channels).
        followed: ``variables``.
    """
    shares = {effect: SHARE_OF_EFFECT * part for effect, part in parts.items()}
    return {
        Column("", f"{effect} with {name}", Part.CHANGING, 0, "changing coefficient"): Product(
            1.0, x, share
        )
        for (effect, share), (name, x) in itertools.product(shares.items(), followed.items())
    }
