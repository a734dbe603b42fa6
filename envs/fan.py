"""The fan of the environment: its jet with gusts, and the drag of a vehicle in the jet. The mean
jet: ``dynamics.mean_jet``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..controllers.briefing import standard_vehicle
from ..dynamics.mean_jet import (
    AIR_DENSITY,
    COUNT_R,
    COUNT_X,
    FIRST_X,
    HULL_RADIUS,
    HULL_STATIONS,
    STEP_R,
    STEP_X,
)
from ..dynamics.rotation import product
from ..dynamics.vehicle import Vehicle
from ..runtime.compiled import Record, compiled
from ..runtime.vector_lanes import any_of, choose, corners

Array = NDArray[np.float64]

STATIONS = 4 + HULL_STATIONS  # points of drag: four rotors and a ring on the hull


@dataclass(frozen=True)
class Fan:
    """A drum fan at (0, y, height), blowing along +x, and the drag of the vehicle in front."""

    speed: float = 3.6  # m/s, U0 of the jet
    radius: float = 0.45  # m
    hub_radius: float = 0.10  # m
    height: float = 1.2  # m
    turbulence: float = 0.10  # standard deviation of the gusts, as a share of the local axial speed
    gust_length: float = 0.25  # m, correlation length of gusts at two stations
    gust_time: float = 0.10  # s, their correlation time
    rotor_drag: float = 0.020  # N/(m/s), each rotor, in its plane
    hull_area: float = 0.060  # m2, drag area of the whole hull
    # rad, of the hull's stations in turn above and below the rotors' plane, as seen from the
    # centre: 0 is a ring, and a jet above pitches nothing; 0.6 is a spherical cage
    hull_elevation: float = 0.0
    hull_radius: float = HULL_RADIUS  # m, of the hull's stations

    def sized(self, vehicle: Vehicle) -> Fan:
        """Return the fan with a hull for a vehicle: drag by the weight, lengths by the root of the
        arm, over the standard vehicle's. Then the wind's force goes with the weight, and its torque
        with weight and arm.
        """
        standard = standard_vehicle()
        weight, length = vehicle.weight / standard.weight, vehicle.arm_l / standard.arm_l
        length = math.sqrt(length)
        return replace(
            self,
            rotor_drag=weight * self.rotor_drag,
            hull_area=weight * self.hull_area,
            hull_radius=length * self.hull_radius,
            gust_length=length * self.gust_length,
        )


FAN = np.dtype(
    [
        ("speed", "f8"),
        ("height", "f8"),
        ("turbulence", "f8"),
        ("rotor_drag", "f8"),
        ("hull_area", "f8"),
        ("keep", "f8"),  # share of a gust left after a tick
        ("mixing", "f8", (STATIONS, STATIONS)),  # lower root of the correlation between stations
        ("stations", "f8", (STATIONS, 3)),  # m, body frame, from the geometric centre
        ("gusts", "f8", (STATIONS, 3)),  # unit variance
        ("y", "f8"),  # m, where the fan is
        ("blown", "i8"),  # whether other winds blow: ``air`` (m/s) at the stations, world
        ("air", "f8", (STATIONS, 3)),
    ]
)


def fan_record(fan: Fan, rotor_positions: Array, period: float) -> np.ndarray:
    """Return the fan as an array (1,) of ``FAN``; ``rotor_positions`` is (4, 3) m, ``period`` the
    tick in s.
    """
    record = np.zeros(1, dtype=FAN)
    f = record[0]
    for name in ("speed", "height", "turbulence", "rotor_drag", "hull_area"):
        f[name] = getattr(fan, name)
    f["keep"] = math.exp(-period / fan.gust_time)
    angle = np.arange(8) * math.pi / 4
    ring = fan.hull_radius * np.stack([np.cos(angle), np.sin(angle), np.zeros(8)], axis=1)
    if fan.hull_elevation != 0.0:
        above = fan.hull_elevation * (-1.0) ** np.arange(8)
        ring[:, :2] *= np.cos(above)[:, None]
        ring[:, 2] = fan.hull_radius * np.sin(above)
    stations = np.concatenate([rotor_positions, ring])
    f["stations"] = stations
    distance = np.linalg.norm(stations[:, None] - stations[None], axis=2)
    f["mixing"] = np.linalg.cholesky(np.exp(-distance / fan.gust_length) + 1e-9 * np.eye(STATIONS))
    return record


@compiled
def between(table: Array, i: float, j: float, a: float, b: float) -> float:
    """Interpolate a table at shares ``a`` and ``b`` beyond its row ``i`` and column ``j``."""
    near, far, near_after, far_after = corners(table, i, j)
    value: float = (1 - a) * ((1 - b) * near + b * far) + (
        a * ((1 - b) * near_after + b * far_after)
    )
    return value


@compiled
def jet_at(
    f: Record, axial: Array, radial: Array, x: float, y: float, z: float, wind: Array
) -> None:
    """Write the mean wind (3,) m/s at a point of the world into ``wind``."""
    dy, dz = y - f.y, z - f.height
    r = math.sqrt(dy * dy + dz * dz)
    row, column = (x - FIRST_X) / STEP_X, r / STEP_R
    inside = (row >= 0.0) & (row < COUNT_X - 1) & (column < COUNT_R - 1) & (f.speed > 0.0)
    if not any_of(inside):
        wind[0], wind[1], wind[2] = 0.0, 0.0, 0.0
        return
    # without a jet any place of the table will do
    row, column = choose(inside, row, 0.0), choose(inside, column, 0.0)
    i, j = math.floor(row), math.floor(column)
    a, b = row - i, column - j
    u, v = between(axial, i, j, a, b), between(radial, i, j, a, b)
    wind[0] = choose(inside, f.speed * u, 0.0)
    off = inside & (r > 1e-9)
    scale = choose(off, f.speed * v / choose(off, r, 1.0), 0.0)
    wind[1], wind[2] = choose(inside, scale * dy, 0.0), choose(inside, scale * dz, 0.0)


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
def jet_wrench(
    f: Record,
    jet: Array,
    position: Array,
    rotation: Array,
    velocity: Array,
    com: Array,
    wind: Array,
    out: Array,
) -> None:
    """Write force and torque about the centre of mass (6,), world frame, of the wind on the vehicle
    into ``out``.

    Drag acts at the stations, each in its own wind: so a symmetric vehicle feels a torque as the
    jet falls off across its span. ``velocity`` (6,) holds the geometric centre's in the world, and
    the angular velocity in the body frame. ``wind`` (3,) is scratch; ``jet`` (2, COUNT_X, COUNT_R)
    is the table of axial and radial speeds.
    """
    R, axial, radial = rotation, jet[0], jet[1]
    for i in range(6):
        out[i] = 0.0
    ox, oy, oz = product(R, velocity[3], velocity[4], velocity[5])
    cx, cy, cz = product(R, com[0], com[1], com[2])
    hull = 0.5 * AIR_DENSITY * f.hull_area / (STATIONS - 4)
    for i in range(STATIONS):
        s = f.stations[i]
        x, y, z = product(R, s[0], s[1], s[2])
        jet_at(f, axial, radial, position[0] + x, position[1] + y, position[2] + z, wind)
        strength = f.turbulence * wind[0]
        ux = wind[0] + strength * f.gusts[i, 0] + f.air[i, 0] - velocity[0] - (oy * z - oz * y)
        uy = wind[1] + strength * f.gusts[i, 1] + f.air[i, 1] - velocity[1] - (oz * x - ox * z)
        uz = wind[2] + strength * f.gusts[i, 2] + f.air[i, 2] - velocity[2] - (ox * y - oy * x)
        if i < 4:
            along = R[0, 2] * ux + R[1, 2] * uy + R[2, 2] * uz
            fx = f.rotor_drag * (ux - along * R[0, 2])
            fy = f.rotor_drag * (uy - along * R[1, 2])
            fz = f.rotor_drag * (uz - along * R[2, 2])
        else:
            scale = hull * math.sqrt(ux * ux + uy * uy + uz * uz)
            fx, fy, fz = scale * ux, scale * uy, scale * uz
        x, y, z = x - cx, y - cy, z - cz
        out[0] += fx
        out[1] += fy
        out[2] += fz
        out[3] += y * fz - z * fy
        out[4] += z * fx - x * fz
        out[5] += x * fy - y * fx
