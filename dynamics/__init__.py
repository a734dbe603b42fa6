"""A quadrotor: rotations, the vehicle as data, its motion, and the physical effects on it."""

from ..runtime.errors import InputError
from .vehicle import EffectSetting, Mocap, Vehicle
from .vehicle_file import dump_vehicle, load_vehicle, preset_names, save_vehicle

__all__ = [
    "EffectSetting",
    "InputError",
    "Mocap",
    "Vehicle",
    "dump_vehicle",
    "load_vehicle",
    "preset_names",
    "save_vehicle",
]


def __dir__() -> list[str]:
    return __all__
