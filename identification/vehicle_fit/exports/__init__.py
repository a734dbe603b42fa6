"""An identified vehicle as other programs take it. What is not known is left out, and said."""

from collections.abc import Callable

from ..result import Identified
from .autopilots import ardupilot, px4
from .simulators import drone_models, gazebo, rotorpy

EXPORTS: dict[str, Callable[[Identified], str]] = {
    "px4": px4,
    "ardupilot": ardupilot,
    "rotorpy": rotorpy,
    "drone-models": drone_models,
    "gazebo": gazebo,
}
