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


def coefficients(p: Values, names: Names, mass: float, powers: int) -> Array:
    """Return the coefficients (6, c) of the columns for parameters in SI units."""
    place, get = {name: i for i, name in enumerate(names)}, p.get
    inertia, lever = inertia_of(p), np.array([get(f"r{a}", 0.0) for a in _AXES])
    out, moment = np.zeros((6, len(names))), np.zeros((3, len(names)))  # moment: about the centre
    for i, axis in enumerate(_AXES):
        out[:3, place[f"dw{axis}"]] = _CROSS[:, i] @ lever
        for j, other in enumerate(_AXES[i:], i):
            products = np.zeros((3, 3))  # angular velocities' products in this column
            products[i, j] = products[j, i] = 1.0
            column = place[f"w{axis}w{other}"]
            out[:3, column] = products @ lever - np.trace(products) * lever
            moment[:, column] = -np.einsum("ijk,kj", _CROSS, inertia @ products)
    tilt = np.array([get("tilt x", 0.0), get("tilt y", 0.0), 1.0])
    for j in range(powers):
        a, thrust = get(f"a{j}", 0.0), place[f"T{j}"]
        out[:3, thrust] += tilt * a / mass
        moment[:2, thrust] += a * np.array([-get("cy", 0.0), get("cx", 0.0)])
        for i, lever_arm in enumerate((1.0, 1.0, get("reach", 0.0))):
            moment[i, place[f"{'XYZ'[i]}{j}"]] += a * lever_arm
    for i, axis in enumerate(_AXES):
        out[i, place["1"]] += get(f"force bias {axis}", 0.0)
        moment[i, place[f"w{axis}"]] -= get(f"damping {axis}", 0.0)
        for kind in ("rotor drag", "linear drag", "quadratic drag"):
            if (value := get(f"{kind} {axis}")) is not None:
                out[i, place[f"{kind} {axis}"]] += value / mass
    for axis in "xy" if "rotor drag x" in p else "":
        moment[2, place[f"moment of rotor drag {axis}"]] += p[f"rotor drag {axis}"]
    for kind in ("rotor drag z", "lift"):
        for i, axis in enumerate("xy" if kind in p else ""):
            moment[i, place[f"moment {axis} of {kind}"]] += p[kind]
    if "lift" in p:
        out[2, place["lift"]] += p["lift"] / mass
    for i, direction in enumerate(("x", "y", "up")):
        moment[i, place[f"spin {direction}"]] += get("Jr", 0.0)
    if "flapping" in p:  # the columns of rotor drag are minus the sum of speeds times velocity
        moment[0, place["rotor drag y"]] += p["flapping"]
        moment[1, place["rotor drag x"]] -= p["flapping"]
    for i, axis in enumerate(_AXES):
        if answered := get(f"answered {axis}", 0.0):
            for name in (n for n in names if n.startswith(f"slow {axis.upper()}")):
                moment[i, place[name]] -= answered * moment[i, place[name.removeprefix("slow ")]]
    out[3:] = np.linalg.solve(inertia, moment)
    for i, axis in enumerate(_AXES):
        out[3 + i, place["1"]] += get(f"turn bias {axis}", 0.0)
    return out


def jacobian(model: Model, theta: Array, names: Names) -> ArrayPair:
    """Return the coefficients (6, c) and their derivatives (p, 6, c) by the free parameters."""

    def at(x: Array) -> Array:
        return coefficients(model.values(x), names, model.mass, model.powers)

    here = at(theta)
    return here, np.array([(at(theta + e) - here) / 1e-6 for e in 1e-6 * np.eye(len(theta))])
