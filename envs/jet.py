"""The jet of a drum fan, and what it does to a vehicle in it.

Axial speed: the momentum of an annular disc spread by a Gaussian that widens with the distance x, a jet still in its
shear layer: ``u^2 = U0^2 (disc of radius 0.45 less hub of radius 0.10) * Gaussian of width 0.12 x / sqrt 2``. The momentum
flux is the same at every x, and the radial inflow (entrainment) follows from continuity. The convolution of a disc with
a Gaussian is a non-central chi-square distribution.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ..dynamics.compiled import Record, compiled

Array = NDArray[np.float64]

STATIONS = 12  # where the wind acts on the vehicle: four rotors and a ring of eight on the hull
HULL_RADIUS = 0.26  # m
AIR_DENSITY = 1.2  # kg/m3
_SPREAD = 0.12
_X = (0.2, 0.05, 137)  # first, step, count of the table's distances, m
_R = (0.0, 0.02, 151)  # of its radii, m


@dataclass(frozen=True)
class Fan:
    """A drum fan at (0, y, height) that blows along +x, and the drag of the vehicle that it blows at."""

    speed: float = 3.6  # m/s, U0 of the jet
    radius: float = 0.45  # m
    hub_radius: float = 0.10  # m
    height: float = 1.2  # m
    turbulence: float = 0.10  # standard deviation of the gusts, as a share of the local axial speed
    gust_length: float = 0.25  # m, over which gusts at two stations are correlated
    gust_time: float = 0.10  # s, over which they last
    rotor_drag: float = 0.020  # N/(m/s), each rotor, in its plane
    hull_area: float = 0.060  # m2, drag area of the whole hull


FAN = np.dtype([
    ("speed", "f8"), ("height", "f8"), ("turbulence", "f8"), ("rotor_drag", "f8"), ("hull_area", "f8"),
    ("keep", "f8"),  # share of a gust that lasts over a tick
    ("mixing", "f8", (STATIONS, STATIONS)),  # lower root of the correlation between stations
    ("stations", "f8", (STATIONS, 3)),  # m, body frame, from the geometric centre
    ("gusts", "f8", (STATIONS, 3)),  # unit variance
    ("y", "f8"),  # m, where the fan is
])


@cache
def jet_table(radius: float, hub_radius: float) -> tuple[Array, Array]:
    """Return axial and radial speed for U0 = 1 over the grid of distances and radii, each (137, 151)."""
    from scipy.special import chndtr

    x = _X[0] + _X[1] * np.arange(_X[2])
    r = _R[0] + _R[1] * np.arange(_R[2])
    # one more distance on either side, so that the derivative along x is central everywhere
    fine = np.concatenate([[x[0] - _X[1]], x, [x[-1] + _X[1]]])
    sigma = (_SPREAD * fine / math.sqrt(2.0))[:, None]
    momentum = chndtr((radius / sigma) ** 2, 2, (r / sigma) ** 2) - chndtr((hub_radius / sigma) ** 2, 2, (r / sigma) ** 2)
    axial = np.sqrt(np.maximum(momentum, 0.0))
    slope = (axial[2:] - axial[:-2]) / (2.0 * _X[1])
    flux = np.concatenate([np.zeros((len(x), 1)), np.cumsum(
        0.5 * (slope[:, 1:] * r[1:] + slope[:, :-1] * r[:-1]) * _R[1], axis=1)], axis=1)
    radial = np.zeros_like(flux)
    radial[:, 1:] = -flux[:, 1:] / r[1:]
    return np.ascontiguousarray(axial[1:-1]), radial


def fan_record(fan: Fan, rotor_positions: Array, period: float) -> np.ndarray:
    """Return the fan as an array (1,) of ``FAN``; ``rotor_positions`` is (4, 3) m, ``period`` the tick in s."""
    record = np.zeros(1, dtype=FAN)
    f = record[0]
    for name in ("speed", "height", "turbulence", "rotor_drag", "hull_area"):
        f[name] = getattr(fan, name)
    f["keep"] = math.exp(-period / fan.gust_time)
    angle = np.arange(8) * math.pi / 4
    stations = np.concatenate([rotor_positions, HULL_RADIUS * np.stack(
        [np.cos(angle), np.sin(angle), np.zeros(8)], axis=1)])
    f["stations"] = stations
    distance = np.linalg.norm(stations[:, None] - stations[None], axis=2)
    f["mixing"] = np.linalg.cholesky(np.exp(-distance / fan.gust_length) + 1e-9 * np.eye(STATIONS))
    return record


@compiled
def jet_at(f: Record, axial: Array, radial: Array, x: float, y: float, z: float, wind: Array) -> None:
    """Write the mean wind (3,) m/s at a point of the world into ``wind``."""
    dy, dz = y - f.y, z - f.height
    r = math.sqrt(dy * dy + dz * dz)
    row, column = (x - _X[0]) / _X[1], r / _R[1]
    if row < 0.0 or row >= _X[2] - 1 or column >= _R[2] - 1:
        wind[0], wind[1], wind[2] = 0.0, 0.0, 0.0
        return
    i, j = int(row), int(column)
    a, b = row - i, column - j
    u = (1 - a) * ((1 - b) * axial[i, j] + b * axial[i, j + 1]) + a * ((1 - b) * axial[i + 1, j] + b * axial[i + 1, j + 1])
    v = (1 - a) * ((1 - b) * radial[i, j] + b * radial[i, j + 1]) + a * (
        (1 - b) * radial[i + 1, j] + b * radial[i + 1, j + 1])
    wind[0] = f.speed * u
    scale = f.speed * v / r if r > 1e-9 else 0.0
    wind[1], wind[2] = scale * dy, scale * dz


@compiled
def gust(f: Record, noise: Array) -> None:
    """Let the gusts at the stations age by one tick; ``noise`` holds 36 unit normals."""
    fresh = math.sqrt(1.0 - f.keep * f.keep)
    for i in range(STATIONS):
        for a in range(3):
            total = 0.0
            for j in range(i + 1):
                total += f.mixing[i, j] * noise[3 * j + a]
            f.gusts[i, a] = f.keep * f.gusts[i, a] + fresh * total


@compiled
def jet_wrench(f: Record, axial: Array, radial: Array, position: Array, rotation: Array, velocity: Array,
               omega: Array, com: Array, wind: Array, out: Array) -> None:
    """Write force and torque about the centre of mass (6,), world frame, of the wind on the vehicle into ``out``.

    Drag acts at the stations, each in its own wind: that is why a symmetric vehicle feels a torque where the jet falls
    off across its span. ``velocity`` is that of the geometric centre in the world, ``omega`` in the body frame; ``wind``
    (3,) is scratch.
    """
    R = rotation
    for i in range(6):
        out[i] = 0.0
    ox = R[0, 0] * omega[0] + R[0, 1] * omega[1] + R[0, 2] * omega[2]
    oy = R[1, 0] * omega[0] + R[1, 1] * omega[1] + R[1, 2] * omega[2]
    oz = R[2, 0] * omega[0] + R[2, 1] * omega[1] + R[2, 2] * omega[2]
    cx = R[0, 0] * com[0] + R[0, 1] * com[1] + R[0, 2] * com[2]
    cy = R[1, 0] * com[0] + R[1, 1] * com[1] + R[1, 2] * com[2]
    cz = R[2, 0] * com[0] + R[2, 1] * com[1] + R[2, 2] * com[2]
    hull = 0.5 * AIR_DENSITY * f.hull_area / (STATIONS - 4)
    for i in range(STATIONS):
        s = f.stations[i]
        x = R[0, 0] * s[0] + R[0, 1] * s[1] + R[0, 2] * s[2]
        y = R[1, 0] * s[0] + R[1, 1] * s[1] + R[1, 2] * s[2]
        z = R[2, 0] * s[0] + R[2, 1] * s[1] + R[2, 2] * s[2]
        jet_at(f, axial, radial, position[0] + x, position[1] + y, position[2] + z, wind)
        strength = f.turbulence * wind[0]
        ux = wind[0] + strength * f.gusts[i, 0] - velocity[0] - (oy * z - oz * y)
        uy = wind[1] + strength * f.gusts[i, 1] - velocity[1] - (oz * x - ox * z)
        uz = wind[2] + strength * f.gusts[i, 2] - velocity[2] - (ox * y - oy * x)
        if i < 4:
            along = R[0, 2] * ux + R[1, 2] * uy + R[2, 2] * uz
            fx = f.rotor_drag * (ux - along * R[0, 2])
            fy = f.rotor_drag * (uy - along * R[1, 2])
            fz = f.rotor_drag * (uz - along * R[2, 2])
        else:
            scale = hull * math.sqrt(ux * ux + uy * uy + uz * uz)
            fx, fy, fz = scale * ux, scale * uy, scale * uz
        x -= cx
        y -= cy
        z -= cz
        out[0] += fx
        out[1] += fy
        out[2] += fz
        out[3] += y * fz - z * fy
        out[4] += z * fx - x * fz
        out[5] += x * fy - y * fx
