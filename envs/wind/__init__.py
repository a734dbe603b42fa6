"""Winds: velocity fields of the air, evaluated at points of the world and in time.

A wind is anything with ``velocity(points (n, 3) m, time s) -> (n, 3) m/s``, world frame. The winds
of this room are compiled, for 100 evaluations a second at the stations of a vehicle; they add up
with ``+``. Any other wind flies as it is, and faster sampled on a grid (``on_grid``).
"""

from .adapters import (
    PyFlytWind,
    RotorPyWind,
    WindDrag,
    blow_crazyflow,
    blow_pybullet_drones,
    pyflyt_wind_type,
)
from .field import CompiledWind, Sum, Wind, winds_of
from .grid import GridWind, on_grid, read_wind, write_wind
from .jets import FanWall, VehicleWash, switching
from .steady import Gust, Shear, Uniform
from .turbulence import Turbulence, low_altitude, spectrum

__all__ = [
    "CompiledWind",
    "FanWall",
    "GridWind",
    "Gust",
    "PyFlytWind",
    "RotorPyWind",
    "Shear",
    "Sum",
    "Turbulence",
    "Uniform",
    "VehicleWash",
    "Wind",
    "WindDrag",
    "blow_crazyflow",
    "blow_pybullet_drones",
    "low_altitude",
    "on_grid",
    "pyflyt_wind_type",
    "read_wind",
    "spectrum",
    "switching",
    "winds_of",
    "write_wind",
]
