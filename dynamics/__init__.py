"""What a quadrotor is: rotations, the vehicle as data, how it moves, and the physical effects on
it.
"""

from ..runtime.errors import InputError
from ..runtime.prompt import public
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

__dir__ = public(__all__, globals())
