"""What messages of ROS hold: which types carry a pose, rotor speeds, motor commands, a voltage or
an inertial sensor, and in which fields, as the file ``maps/recordings/ros.yaml`` states.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from operator import attrgetter
from typing import Any

import numpy as np

from ....runtime.yaml_file import read_yaml
from ..log_map import MAPS
from ..rotor_orders import ORDERS
from ..table import Array
from ..what_flew import slots_of_motors
from .px4_motors import MOTOR1

PARTS = ("pose", "rotors", "command", "voltage", "imu")
MOTORS = ("rotors", "command")  # parts
_SECOND = 10**9  # ns
_MICROSECOND = 1000  # ns
_LATEST = 2**63  # ns


@dataclass(frozen=True)
class Kind:
    """How one part is read from messages of one type; a topic map may say another frame, unit,
    order or range.
    """

    fields: tuple[str, ...] | str  # paths in the message, or the name of a function of ``_SPECIAL``
    frame: str = "flu"  # of a pose or an inertial sensor
    unit: str = ""  # of rotor speeds or commands; nothing: the topic map must say it
    order: tuple[int, ...] = ()  # elements of the message, from 1, that are the kit's rotors
    range: tuple[float, float] = (0.0, 1.0)  # values of the commands 0 and 1

    def values(self, message: Any) -> Array:
        """Return what a message holds (K,), in the message's own frame and unit."""
        if isinstance(self.fields, str):
            return np.array(_SPECIAL[self.fields](message), dtype=np.float64)
        found: Any = attrgetter(*self.fields)(message)
        if len(self.fields) > 1 and np.ndim(found[0]):
            found = np.concatenate(found)
        return np.atleast_1d(np.asarray(found, dtype=np.float64))


def _odometry(message: Any) -> list[float]:
    """Return the pose of a VehicleOdometry; NaN where its frame is not known."""
    if hasattr(message, "position"):
        is_known = message.pose_frame in (1, 2)  # 1 NED, 2 FRD: both have z down
        place = message.position
    else:
        is_known = message.local_frame in (0, 1)
        place = (message.x, message.y, message.z)
    return [*place, *message.q] if is_known else [math.nan] * 7


def _esc_rpm(message: Any) -> list[float]:
    """Return the rpm of motors 1 to 4, by the function that each ESC states where all do."""
    slots = slots_of_motors([int(esc.actuator_function) for esc in message.esc], MOTOR1)
    return [message.esc[i].esc_rpm for i in slots or range(4)]


_SPECIAL: Mapping[str, Callable[[Any], list[float]]] = {
    "odometry": _odometry,
    "esc_rpm": _esc_rpm,
    "item_rpm": lambda message: [item.rpm for item in message.esc_status],
}


@cache
def stated() -> dict[str, Any]:
    """Return what ``ros.yaml`` states."""
    found: dict[str, Any] = read_yaml(MAPS / "recordings" / "ros.yaml", "a map of messages")
    return found


@cache
def kinds(part: str) -> dict[str, Kind]:
    """Return how a part is read from messages, by their types."""
    found = {name: Kind((field,)) for name, field in stated()["arrays"].items() if part in MOTORS}
    for name, given in stated()[part].items():
        fields, order = given["fields"], given.get("order")
        paths = fields if isinstance(fields, str) else tuple(fields)
        found[name] = Kind(**given | {"fields": paths, "order": ORDERS[order] if order else ()})
    return found


def definitions() -> list[dict[str, str]]:
    """Return the definitions of the types that rosbags does not know, in several variants: the
    newest of each comes first.
    """
    known: dict[str, list[str]] = stated()["definitions"]
    return [
        {name: texts[min(variant, len(texts) - 1)] for name, texts in known.items()}
        for variant in range(max(map(len, known.values())))
    ]


def stamp(message: Any) -> int:
    """Return when a message's sample was taken, in ns of whatever clock its sender has; 0: it does
    not say.
    """
    header = getattr(message, "header", None)
    if header is not None:
        return min(int(header.stamp.sec) * _SECOND + int(header.stamp.nanosec), _LATEST - 1)
    sampled = int(getattr(message, "timestamp_sample", 0) or getattr(message, "timestamp", 0))
    return _MICROSECOND * sampled if sampled < _LATEST // _MICROSECOND else 0
