"""The fan of the environment: numbers of its jet with gusts, and of the drag of a vehicle in the
jet. ``core/fan.hpp`` has the formulas, ``dynamics.mean_jet`` the mean jet.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from .. import _core
from ..controllers.briefing import standard_vehicle
from ..dynamics.mean_jet import HULL_RADIUS, HULL_STATIONS
from ..dynamics.vehicle import Vehicle
from ..runtime.arrays import Array

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
        weight = vehicle.weight / standard.weight
        length = math.sqrt(vehicle.arm_l / standard.arm_l)
        return replace(
            self,
            rotor_drag=weight * self.rotor_drag,
            hull_area=weight * self.hull_area,
            hull_radius=length * self.hull_radius,
            gust_length=length * self.gust_length,
        )


_OF_FAN = ("speed", "height", "turbulence", "rotor_drag", "hull_area")
FAN = np.dtype(
    [
        # ``keep``: share of a gust left after a tick
        *[(name, "f8") for name in (*_OF_FAN, "keep")],
        ("mixing", "f8", (STATIONS, STATIONS)),  # lower root of the correlation between stations
        ("stations", "f8", (STATIONS, 3)),  # m, body frame, from the geometric centre
        ("gusts", "f8", (STATIONS, 3)),  # unit variance
        ("y", "f8"),  # m, where the fan is
        ("blown", "i8"),  # whether other winds blow: ``air`` (m/s) at the stations, world
        ("air", "f8", (STATIONS, 3)),
    ]
)
assert FAN.itemsize == _core.FAN_SIZE, "the core was built for another layout"


def fan_record(fan: Fan, rotor_positions: Array, period: float) -> np.ndarray:
    """Return the fan as an array (1,) of ``FAN``; ``rotor_positions`` is (4, 3) m, ``period`` the
    tick in s.
    """
    record = np.zeros(1, dtype=FAN)
    f = record[0]
    for name in _OF_FAN:
        f[name] = getattr(fan, name)
    f["keep"] = math.exp(-period / fan.gust_time)
    angle = np.arange(8) * math.pi / 4
    above = fan.hull_elevation * (-1.0) ** np.arange(8)
    ring = fan.hull_radius * np.stack([np.cos(angle), np.sin(angle), np.sin(above)], axis=1)
    ring[:, :2] *= np.cos(above)[:, None]
    stations = np.concatenate([rotor_positions, ring])
    f["stations"] = stations
    distance = np.linalg.norm(stations[:, None] - stations[None], axis=2)
    f["mixing"] = np.linalg.cholesky(np.exp(-distance / fan.gust_length) + 1e-9 * np.eye(STATIONS))
    return record
