"""From a vehicle's parameters to the coefficients of the columns, axis by axis.

Specific force, body axes, at the sensor (or the pose's point), which lies at ``r`` from the centre
of mass: ``f = (T e3 + drag) / m + w' x r + w x (w x r) + bias``, with the thrust axis tilted a
little. Angular acceleration: ``w' = J^-1 (torque - w x J w) + bias``.

Parameters (``theta``) are numbers near 1 or 0: what they multiply is in ``Scales``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

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


def coefficients(p: Mapping[str, float], names: Sequence[str], mass: float, powers: int) -> Array:
    """Return the coefficients (6, c) of the columns for parameters in SI units."""
    place = {name: i for i, name in enumerate(names)}
    out = np.zeros((6, len(names)))
    get = p.get
    thrust = [get(f"a{j}", 0.0) for j in range(powers)]
    for j, a in enumerate(thrust):
        out[0, place[f"T{j}"]] = get("tilt x", 0.0) * a / mass
        out[1, place[f"T{j}"]] = get("tilt y", 0.0) * a / mass
        out[2, place[f"T{j}"]] = a / mass
    for i, axis in enumerate(_AXES):
        out[i, place["1"]] = get(f"force bias {axis}", 0.0)
        for kind in ("rotor drag", "linear drag", "quadratic drag"):
            if f"{kind} {axis}" in place:
                out[i, place[f"{kind} {axis}"]] = get(f"{kind} {axis}", 0.0) / mass
    if "lift" in place:
        out[2, place["lift"]] = get("lift", 0.0) / mass
    _lever(out, place, np.array([get(n, 0.0) for n in LEVERS]))

    moment = np.zeros((3, len(names)))  # torque about the centre of mass
    for j, a in enumerate(thrust):
        moment[0, place[f"X{j}"]] += a
        moment[0, place[f"T{j}"]] -= a * get("cy", 0.0)
        moment[1, place[f"Y{j}"]] += a
        moment[1, place[f"T{j}"]] += a * get("cx", 0.0)
        moment[2, place[f"Z{j}"]] += a * get("reach", 0.0)
    moment[2, place["spin up"]] = get("Jr", 0.0)
    moment[0, place["spin x"]], moment[1, place["spin y"]] = get("Jr", 0.0), get("Jr", 0.0)
    inertia = inertia_of(p)
    _gyroscopic(moment, place, inertia)
    for i, axis in enumerate(_AXES):
        moment[i, place[f"w{axis}"]] -= get(f"damping {axis}", 0.0)
    out[3:] = np.linalg.solve(inertia, moment)
    for i, axis in enumerate(_AXES):
        out[3 + i, place["1"]] += get(f"turn bias {axis}", 0.0)
    return out


def _lever(out: Array, place: Mapping[str, int], r: Array) -> None:
    """Add ``w' x r + w x (w x r)`` to the force's coefficients."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[i, place[f"dw{_AXES[j]}"]] += r[k]
        out[i, place[f"dw{_AXES[k]}"]] -= r[j]
        for n in range(3):
            a, b = sorted((i, n))
            out[i, place[f"w{_AXES[a]}w{_AXES[b]}"]] += r[n]
        for n in range(3):
            out[i, place[f"w{_AXES[n]}w{_AXES[n]}"]] -= r[i]


def _gyroscopic(moment: Array, place: Mapping[str, int], inertia: Array) -> None:
    """Add ``-w x J w`` to the moment's coefficients."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        for n in range(3):
            for sign, a, row in ((-1.0, j, k), (1.0, k, j)):
                first, second = sorted((a, n))
                moment[i, place[f"w{_AXES[first]}w{_AXES[second]}"]] += sign * inertia[row, n]


def jacobian(model: Model, theta: Array, names: Sequence[str]) -> tuple[Array, Array]:
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
