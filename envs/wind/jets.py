"""Winds of rotors: walls of fans whose speeds change, and the wash of another vehicle.

Each rotor blows the mean jet of ``dynamics.mean_jet``. The momentum fluxes of overlapping jets add:
``u^2 = sum u_i^2``. This is Reichardt's hypothesis, also behind the mean jet. The air drawn in adds
as velocity.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from ...dynamics.mean_jet import AIR_DENSITY, jet_table
from ...runtime.arrays import Array
from ...runtime.errors import InputError
from .field import CompiledWind, number, vector
from .turbulence import waves

TABLE_PERIOD = 0.02  # s, of the tables of places and speeds


JETS = np.dtype(
    [
        # addresses: the jet's tables (COUNT_X, COUNT_R), the rotors' places (place_steps, jets, 3)
        # m and speeds (steps, jets) m/s, and the gusts' plane waves (waves, 7)
        *[(name, "i8") for name in ("axial", "radial", "places", "speeds", "modes")],
        *[(name, "i8") for name in ("place_steps", "steps", "jets", "waves")],
        ("axes", "f8", (3, 3)),  # rows: the jets' axes in the world, the one along the jets first
        ("advection", "f8", (3,)),  # m/s, of the gusts
    ]
)


def _axes(direction: Array) -> Array:
    """Return axes (3, 3), rows, the first along ``direction``."""
    along = direction / np.linalg.norm(direction)
    helper = np.array([0.0, 0.0, 1.0]) if abs(along[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    side = np.cross(helper, along)
    side /= np.linalg.norm(side)
    return np.stack([along, side, np.cross(along, side)])


class _Jets(CompiledWind):
    def __init__(
        self,
        direction: Array,
        places: Array,
        speeds: Array,
        radius: float,
        hub_radius: float,
        gusts: tuple[float, float, int | np.random.Generator],
    ) -> None:
        turbulence, gust_length, seed = gusts
        number(turbulence, "turbulence", least=0.0)
        number(gust_length, "gust_length", 0.0)
        table = np.zeros((0, 7))
        if turbulence > 0.0:
            sizes = np.full(3, turbulence), np.full(3, gust_length)
            table = waves(np.random.default_rng(seed), "dryden", *sizes, 24, 0.4 * gust_length)
        self.axes = axes = _axes(direction)  # rows: along the jet, and two across
        self.places, self.speeds = np.ascontiguousarray(places), np.ascontiguousarray(speeds)
        self.radius = radius
        parameters = np.zeros(1, dtype=JETS)
        w = parameters[0]
        tables = (*jet_table(radius, hub_radius), self.places, self.speeds, table)
        w["place_steps"], (w["steps"], w["jets"]) = len(places), speeds.shape
        # gusts travel with the shear layer's eddies, at half the speed of the jet
        w["waves"], w["axes"] = len(table), axes
        w["advection"] = 0.5 * speeds.max() * axes[0]
        super().__init__("jets", parameters, dict(zip(JETS.names or (), tables, strict=False)))


class FanWall(_Jets):
    """A wall of fans side by side, each with a speed of its own over time.

    Args:
        speeds: U0 of each fan's jet, m/s: (rows * columns,), or (steps, rows * columns) every
            0.02 s, as from ``switching``; the last row holds on. Fans are counted row by row from
            the bottom, each row from left to right as seen by the wind.
        rows: number of fans above each other.
        columns: number of fans side by side.
        pitch: m, from fan to fan.
        centre: (3,) m, of the wall.
        direction: (3,), downwind.
        radius: m, of a fan; its hub has ``hub_radius``.
        hub_radius: m.
        turbulence: standard deviation of the gusts as a share of the local speed along the jet.
        gust_length: m, correlation length of the gusts.
        seed: for the gusts.

    Raises:
        InputError: an impossible shape or number.
    """

    def __init__(
        self,
        speeds: ArrayLike,
        rows: int = 3,
        columns: int = 3,
        pitch: float = 0.6,
        centre: ArrayLike = (0.0, 0.0, 1.2),
        direction: ArrayLike = (1.0, 0.0, 0.0),
        radius: float = 0.28,
        hub_radius: float = 0.06,
        turbulence: float = 0.10,
        gust_length: float = 0.25,
        seed: int | np.random.Generator = 0,
    ) -> None:
        if rows < 1 or columns < 1:
            raise InputError(f"wind: FanWall: expected rows and columns, got {rows} and {columns}")
        heading = vector(direction, "direction")
        if not np.any(heading):
            raise InputError("wind: FanWall: direction must not be zero")
        table = np.atleast_2d(np.asarray(speeds, dtype=np.float64))
        fits = table.ndim == 2 and table.shape[1] == rows * columns
        if not (fits and np.all(np.isfinite(table)) and table.min() >= 0.0):
            raise InputError(
                f"wind: FanWall: speeds must be numbers from 0 on, shape ({rows * columns},) or "
                f"(steps, {rows * columns}), got shape {table.shape}"
            )
        number(radius, "radius, above hub_radius,", number(hub_radius, "hub_radius", least=0.0))
        number(pitch, "pitch", 0.0)
        axes = _axes(heading)
        right, up = (pitch * (np.arange(n) - 0.5 * (n - 1)) for n in (columns, rows))
        aside = vector(centre, "centre") - right[None, :, None] * axes[1]
        places = aside + up[:, None, None] * axes[2]
        gusts = turbulence, gust_length, seed
        super().__init__(heading, places.reshape(1, -1, 3), table, radius, hub_radius, gusts)


def switching(
    rng: np.random.Generator,
    fans: int,
    seconds: float,
    speed: tuple[float, float] = (2.0, 6.0),
    every: tuple[float, float] = (1.5, 4.0),
    on: float = 0.6,
    lag: float = 0.3,
) -> Array:
    """Return speeds (steps, fans) m/s of fans switched at random, for ``FanWall``.

    Each fan by itself is on with probability ``on``, at a speed drawn from ``speed``. A new draw
    follows after a time drawn from ``every`` (s). The fan has a first-order ``lag`` (s).
    """
    steps = math.ceil(seconds / TABLE_PERIOD) + 1
    table = np.zeros((steps, fans))
    keep = math.exp(-TABLE_PERIOD / lag) if lag > 0 else 0.0
    for fan in range(fans):
        k = 0
        while k < steps:
            value = rng.uniform(*speed) if rng.random() < on else 0.0
            end = k + max(1, round(rng.uniform(*every) / TABLE_PERIOD))
            table[k:end, fan] = value
            k = end
    for k in range(1, steps):
        table[k] = table[k] + keep * (table[k - 1] - table[k])
    return table


class VehicleWash(_Jets):
    """The wash of another multirotor above: one jet straight down.

    Momentum theory: rotors of the disc area A and the thrust T draw air through with
    ``v = sqrt(T / (2 rho A))``. The wake below has contracted to A / 2 and sinks with 2 v. From
    there on the wake spreads as the mean jet does.

    Args:
        path: the other vehicle's places (steps, 3) m every 0.02 s, and then its last place; or the
            place (3,) of its hover.
        thrust: N.
        rotor_radius: m.
        rotors: number of rotors.
        turbulence: share of the wash's local speed.
        gust_length: m.
        seed: for the gusts.

    Raises:
        InputError: an impossible shape or number.
    """

    def __init__(
        self,
        path: ArrayLike,
        thrust: float = 4.56,
        rotor_radius: float = 0.1,
        rotors: int = 4,
        turbulence: float = 0.15,
        gust_length: float = 0.15,
        seed: int | np.random.Generator = 0,
    ) -> None:
        places = np.atleast_2d(np.asarray(path, dtype=np.float64))
        if places.ndim != 2 or places.shape[1] != 3 or not np.all(np.isfinite(places)):
            raise InputError(
                f"wind: VehicleWash: path must be finite numbers in m, shape (3,) or (steps, 3), "
                f"got shape {places.shape}"
            )
        if rotors < 1:
            raise InputError(f"wind: VehicleWash: expected rotors, got {rotors}")
        radius = number(rotor_radius, "rotor_radius", 0.0)
        area = rotors * math.pi * radius**2
        drawn = math.sqrt(number(thrust, "thrust", 0.0) / (2.0 * AIR_DENSITY * area))
        down, speeds = np.array([0.0, 0.0, -1.0]), np.array([[2.0 * drawn]])
        wake, gusts = math.sqrt(0.5 * rotors) * radius, (turbulence, gust_length, seed)
        super().__init__(down, places[:, None, :], speeds, wake, 0.0, gusts)
