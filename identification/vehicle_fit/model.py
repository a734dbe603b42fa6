"""From a vehicle's parameters to the coefficients of the columns, axis by axis.

Specific force, body axes, at the sensor (or the pose's point), at ``r`` from the centre of
mass: ``f = (T e3 + drag) / m + w' x r + w x (w x r) + bias``, with the thrust axis tilted a
little. Angular acceleration: ``w' = J^-1 (torque - w x J w) + bias``.

Parameters (``theta``) are numbers near 1 or 0; ``Model.scale`` holds the unit of each. Lag, time
offset and voltage exponent change the columns themselves, and stand in SI units.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from ...dynamics.vehicle import SPIN
from ...runtime.arrays import Array
from ..logs.table import NamedArrays, NamedNumbers, Names, Values
from .channels import Sources
from .geometry import GRAVITY, Geometry
from .spectra import BAND

T = TypeVar("T", float, Array)
# parameters inside the columns themselves: s, 1, s; in the order of their columns
NONLINEAR = ("lag", "gamma", "delay")
# inertia in logarithms: positive, and with intervals of ratios
LOGARITHMIC = ("Jx", "Jy", "Jz")
ROWS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")  # force, and torque about the centre of mass
PAIRS = [(i, j) for i in range(3) for j in range(i, 3)]  # of axes
_CROSS = np.cross(np.eye(3)[:, None], np.eye(3))  # e_ijk of a cross product
# symmetric matrices (6, 3, 3): each picks a pair from the products of angular velocities
_PICK = np.array([np.outer(*np.eye(3)[[i, j]]) for i, j in PAIRS])
_PICK = np.maximum(_PICK, np.swapaxes(_PICK, 1, 2))


@dataclass(frozen=True, eq=False)
class Model:
    """The columns' settings, the fitted parameters, and their sizes."""

    mass: float  # kg
    geometry: Geometry
    sources: Sources
    exponents: tuple[int, ...] = (2,)  # of the basis functions of thrust; "a2" is that of 2
    voltage_ref: float = 0.0  # V; 0: voltage is not used
    opposite: bool = False  # rotors turn against their usual senses
    band: float = BAND  # Hz: force and turning are compared up to here
    # s: the rotors' columns are set back by so much before the segments are cut. The offset's rest
    # is a phase in each segment; the window stays
    late: float = 0.0
    # rad/s, standard deviation of one measured speed; not known of speeds behind a lag
    speed_noise: float = 0.0
    free: Names = ()
    # one unit of a parameter in SI units; 1 where none is given
    scale: Values = field(default_factory=dict)
    prior: Values = field(default_factory=dict)  # standard deviation about 0, SI units

    @property
    def commands(self) -> bool:
        """Whether the rotors are known by their commands, not by their speeds."""
        return self.sources.rotors == "commands"

    @property
    def weight(self) -> float:
        """Weight, N."""
        return self.mass * GRAVITY

    @property
    def spin(self) -> Array:
        """Turning senses (4,)."""
        return -SPIN if self.opposite else SPIN

    @property
    def shares(self) -> NamedArrays:
        """Each rotor's share (4,) in thrust T and in the torques x, y and z, m."""
        x, y = self.geometry.positions[:, :2].T
        return {"T": np.ones(4), "x": y, "y": -x, "z": -self.spin}

    def values(self, theta: Array) -> NamedNumbers:
        """Return the free parameters in SI units."""
        return {
            name: float(self.scale.get(name, 1.0) * (np.exp(x) if name in LOGARITHMIC else x))
            for name, x in zip(self.free, theta, strict=True)
        }

    def with_more(self, theta: Array, *names: str) -> tuple["Model", Array]:
        """Return the model with further parameters, and the start: 0 for each of them."""
        return replace(self, free=(*self.free, *names)), np.append(theta, np.zeros(len(names)))


def inertia_of(p: Values) -> Array:
    """Return the inertia (3, 3)."""
    xy, xz, yz = (p.get(n, 0.0) for n in ("Jxy", "Jxz", "Jyz"))
    return np.array([[p["Jx"], xy, xz], [xy, p["Jy"], yz], [xz, yz, p["Jz"]]])


def coefficients(model: Model, p: Values, names: Names) -> Array:
    """Return the coefficients (6, c) of the columns for parameters in SI units; the first ten are
    the constant, angular acceleration, and the products of angular velocities.
    """
    inertia, lever = inertia_of(p), np.array([p["rx"], p["ry"], p["rz"]])
    out = np.zeros((6, len(names)))
    for column, name in enumerate(names):
        place, _, parameter = name.partition(" ")
        if place in ROWS:
            out[ROWS.index(place), column] = p.get(parameter, 0.0)
    thrust = np.array([p["tilt x"], p["tilt y"], 1.0, -p["cy"], p["cx"], 0.0])
    for e in model.exponents:
        out[:, names.index(f"T{e}")] = p[f"a{e}"] * thrust
        for row, (axis, reach) in enumerate(zip("xyz", (1.0, 1.0, p["reach"]), strict=True), 3):
            column = names.index(f"{axis}{e}")
            out[row, column] = p[f"a{e}"] * reach
            # the slow part stands behind
            out[row, column + 1] = -p.get(f"answered {axis}", 0.0) * out[row, column]
    out[:3] /= model.mass
    out[:3, 1:4] = _CROSS @ lever
    out[:3, 4:10] = (_PICK @ lever).T - np.outer(lever, _PICK.trace(axis1=1, axis2=2))
    out[3:, 4:10] = -np.einsum("ijk,pkj->ip", _CROSS, inertia @ _PICK)
    out[3:] = np.linalg.solve(inertia, out[3:])
    out[:, 0] = [p.get(f"{kind} bias {a}", 0.0) for kind in ("force", "turn") for a in "xyz"]
    return out


def slopes(of: Callable[[Array], T], theta: Array) -> tuple[T, Array]:
    """Return a function's value (...) and derivatives (p, ...) by the free parameters (p,)."""
    here = of(theta)
    return here, np.array([(of(theta + e) - here) / 1e-6 for e in 1e-6 * np.eye(len(theta))])
