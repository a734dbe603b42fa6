"""From a vehicle's parameters to the coefficients of the columns, axis by axis.

Specific force, body axes, at the sensor (or the pose's point), which lies at ``r`` from the centre
of mass: ``f = (T e3 + drag) / m + w' x r + w x (w x r) + bias``, with the thrust axis tilted a
little. Angular acceleration: ``w' = J^-1 (torque - w x J w) + bias``.

Parameters (``theta``) are numbers near 1 or 0: what they multiply is in ``Scales``.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LEVERS = ("rx", "ry", "rz")
_AXES = "xyz"


@dataclass(frozen=True)
class Model:
    """Which parameters are fitted, their sizes, and those that are fixed."""

    mass: float  # kg
    powers: int
    free: tuple[str, ...]
    scale: Mapping[str, float]  # what one unit of a parameter is, in SI units
    fixed: Mapping[str, float] = field(default_factory=dict)  # SI units
    prior: Mapping[str, float] = field(default_factory=dict)  # standard deviation about 0, SI units

    def values(self, theta: Array) -> dict[str, float]:
        """Return all parameters in SI units; those neither free nor fixed are zero."""
        out = dict(self.fixed)
        for name, x in zip(self.free, theta, strict=True):
            scale = self.scale[name]
            out[name] = float(scale * np.exp(x)) if name in LOGARITHMIC else float(scale * x)
        return out


# inertia in logarithms: positive, and with intervals of ratios
LOGARITHMIC = ("Jx", "Jy", "Jz")


def inertia_of(p: Mapping[str, float]) -> Array:
    """Return the inertia (3, 3)."""
    xy, xz, yz = (p.get(n, 0.0) for n in ("Jxy", "Jxz", "Jyz"))
    return np.array([[p["Jx"], xy, xz], [xy, p["Jy"], yz], [xz, yz, p["Jz"]]])


def coefficients(p: Mapping[str, float], names: tuple[str, ...], mass: float, powers: int) -> Array:
    """Return the coefficients (6, c) of the columns for parameters in SI units."""
    place, lever, gyroscopic = _structure(names)
    get = p.get
    inertia = inertia_of(p)
    out = np.empty((6, len(names)))
    out[:3] = np.tensordot([get(n, 0.0) for n in LEVERS], lever, 1)
    moment = np.tensordot(inertia.ravel(), gyroscopic, 1)  # torque about the centre of mass
    for j in range(powers):
        a = get(f"a{j}", 0.0)
        thrust = place[f"T{j}"]
        out[0, thrust] += get("tilt x", 0.0) * a / mass
        out[1, thrust] += get("tilt y", 0.0) * a / mass
        out[2, thrust] += a / mass
        moment[0, place[f"X{j}"]] += a
        moment[0, thrust] -= a * get("cy", 0.0)
        moment[1, place[f"Y{j}"]] += a
        moment[1, thrust] += a * get("cx", 0.0)
        moment[2, place[f"Z{j}"]] += a * get("reach", 0.0)
    for i, axis in enumerate(_AXES):
        out[i, place["1"]] += get(f"force bias {axis}", 0.0)
        moment[i, place[f"w{axis}"]] -= get(f"damping {axis}", 0.0)
        for kind in ("rotor drag", "linear drag", "quadratic drag"):
            if (value := get(f"{kind} {axis}")) is not None:
                out[i, place[f"{kind} {axis}"]] += value / mass
    if "lift" in p:
        out[2, place["lift"]] += p["lift"] / mass
    spin = get("Jr", 0.0)
    moment[2, place["spin up"]] += spin
    moment[0, place["spin x"]] += spin
    moment[1, place["spin y"]] += spin
    out[3:] = np.linalg.solve(inertia, moment)
    for i, axis in enumerate(_AXES):
        out[3 + i, place["1"]] += get(f"turn bias {axis}", 0.0)
    return out


@lru_cache(maxsize=16)
def _structure(names: tuple[str, ...]) -> tuple[dict[str, int], Array, Array]:
    """Return the columns' places; the force's coefficients (3, 3, c) for each part of the lever,
    ``w' x r + w x (w x r)``; and the torque's (9, 3, c) for each part of the inertia, ``-w x J w``.
    """
    place = {name: i for i, name in enumerate(names)}

    def product(a: int, b: int) -> int:
        first, second = sorted((a, b))
        return place[f"w{_AXES[first]}w{_AXES[second]}"]

    lever, gyroscopic = np.zeros((3, 3, len(names))), np.zeros((9, 3, len(names)))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        lever[k, i, place[f"dw{_AXES[j]}"]] += 1.0
        lever[j, i, place[f"dw{_AXES[k]}"]] -= 1.0
        for n in range(3):
            lever[n, i, product(i, n)] += 1.0
            lever[i, i, product(n, n)] -= 1.0
            gyroscopic[3 * k + n, i, product(j, n)] -= 1.0
            gyroscopic[3 * j + n, i, product(k, n)] += 1.0
    return place, lever, gyroscopic


def jacobian(model: Model, theta: Array, names: tuple[str, ...]) -> tuple[Array, Array]:
    """Return the coefficients (6, c) and their derivatives (p, 6, c) by the free parameters."""

    def at(x: Array) -> Array:
        return coefficients(model.values(x), names, model.mass, model.powers)

    here = at(theta)
    slopes = np.empty((len(theta), *here.shape))
    for i in range(len(theta)):
        step = np.zeros(len(theta))
        step[i] = 1e-6
        slopes[i] = (at(theta + step) - here) / 1e-6
    return here, slopes
