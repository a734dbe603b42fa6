"""From a vehicle's parameters to the coefficients of the columns, axis by axis.

Specific force, body axes, at the sensor (or the pose's point), at ``r`` from the centre of
mass: ``f = (T e3 + drag) / m + w' x r + w x (w x r) + bias``, with the thrust axis tilted a
little. Angular acceleration: ``w' = J^-1 (torque - w x J w) + bias``.

Parameters (``theta``) are numbers near 1 or 0; ``Model.scale`` holds the unit of each. Lag, time
offset and voltage exponent change the columns themselves, and stand in SI units.
"""

from dataclasses import dataclass, replace

import numpy as np

from ...runtime.arrays import Array
from ..logs.table import ArrayPair, NamedNumbers, Names, Values
from .geometry import GRAVITY

_AXES = "xyz"
NONLINEAR = ("lag", "delay", "gamma")  # s, s, 1
# inertia in logarithms: positive, and with intervals of ratios
LOGARITHMIC = ("Jx", "Jy", "Jz")
# e_ijk of a cross product
_CROSS = np.zeros((3, 3, 3))
_CROSS[[0, 1, 2], [1, 2, 0], [2, 0, 1]], _CROSS[[0, 1, 2], [2, 0, 1], [1, 2, 0]] = 1.0, -1.0


@dataclass(frozen=True)
class Model:
    """The fitted parameters, and their sizes."""

    mass: float  # kg
    powers: int
    free: Names
    scale: Values  # one unit of a parameter in SI units; 1 where none is given
    prior: Values  # standard deviation about 0, SI units

    @property
    def weight(self) -> float:
        """Weight, N."""
        return self.mass * GRAVITY

    def values(self, theta: Array) -> NamedNumbers:
        """Return the free parameters in SI units."""
        return {
            name: float(self.scale.get(name, 1.0) * (np.exp(x) if name in LOGARITHMIC else x))
            for name, x in zip(self.free, theta, strict=True)
        }

    @property
    def nonlinear(self) -> Names:
        """Names of the parameters inside the columns themselves."""
        return tuple(name for name in self.free if name in NONLINEAR)

    def with_more(self, theta: Array, *names: str) -> tuple["Model", Array]:
        """Return the model with further parameters, and the start: 0 for each of them."""
        return replace(self, free=(*self.free, *names)), np.append(theta, np.zeros(len(names)))


def inertia_of(p: Values) -> Array:
    """Return the inertia (3, 3)."""
    xy, xz, yz = (p.get(n, 0.0) for n in ("Jxy", "Jxz", "Jyz"))
    return np.array([[p["Jx"], xy, xz], [xy, p["Jy"], yz], [xz, yz, p["Jz"]]])


def coefficients(model: Model, p: Values, names: Names) -> Array:
    """Return the coefficients (6, c) of the columns for parameters in SI units."""
    mass = model.mass
    place = {name: i for i, name in enumerate(names)}
    inertia, lever = inertia_of(p), np.array([p["rx"], p["ry"], p["rz"]])
    out = np.zeros((6, len(names)))
    moment = out[3:]  # about the centre of mass

    def add(rows: Array, i: int, column: str, parameter: str, size: float = 1.0) -> None:
        if parameter in p:
            rows[i, place[column]] += size * p[parameter]

    for j in range(model.powers):
        a, thrust = p[f"a{j}"], place[f"T{j}"]
        out[:3, thrust] += np.array([p["tilt x"], p["tilt y"], 1.0]) * a / mass
        moment[:2, thrust] += a * np.array([-p["cy"], p["cx"]])
        for i, letter in enumerate("XYZ"):
            moment[i, place[f"{letter}{j}"]] += a * (p["reach"] if letter == "Z" else 1.0)
    for i, axis in enumerate(_AXES):
        out[:3, place[f"dw{axis}"]] = _CROSS[:, i] @ lever
        for j, other in enumerate(_AXES[i:], i):
            products = np.zeros((3, 3))  # angular velocities' products in this column
            products[i, j] = products[j, i] = 1.0
            column = place[f"w{axis}w{other}"]
            out[:3, column] = products @ lever - np.trace(products) * lever
            moment[:, column] = -np.einsum("ijk,kj", _CROSS, inertia @ products)
        add(out, i, "1", f"force bias {axis}")
        add(moment, i, f"w{axis}", f"damping {axis}", -1.0)
        add(moment, i, f"spin {axis}", "Jr")
        for kind in ("rotor drag", "linear drag", "quadratic drag"):
            add(out, i, f"{kind} {axis}", f"{kind} {axis}", 1.0 / mass)
    for i, axis in enumerate("xy"):
        add(moment, 2, f"moment of rotor drag {axis}", f"rotor drag {axis}")
        for kind in ("rotor drag z", "lift"):
            add(moment, i, f"moment {axis} of {kind}", kind)
    add(out, 2, "lift", "lift", 1.0 / mass)
    # the columns of rotor drag are minus the sum of speeds times velocity
    add(moment, 0, "rotor drag y", "flapping")
    add(moment, 1, "rotor drag x", "flapping", -1.0)
    for name in names:
        if name.startswith("slow "):
            i, answering = "XYZ".index(name[5]), place[name.removeprefix("slow ")]
            add(moment, i, name, f"answered {_AXES[i]}", -moment[i, answering])
    moment[:] = np.linalg.solve(inertia, moment)
    moment[:, place["1"]] += [p[f"turn bias {axis}"] for axis in _AXES]
    return out


def jacobian(model: Model, theta: Array, names: Names) -> ArrayPair:
    """Return the coefficients (6, c) and their derivatives (p, 6, c) by the free parameters."""

    def at(x: Array) -> Array:
        return coefficients(model, model.values(x), names)

    here = at(theta)
    return here, np.array([(at(theta + e) - here) / 1e-6 for e in 1e-6 * np.eye(len(theta))])
