"""Messages of ROS as columns: their numbers by the paths of their fields, such as
``pose.position.x``, ``data[0]`` or ``esc[0].esc_rpm``.
"""

import re
from collections.abc import Callable, Collection, Iterator
from functools import cache
from itertools import islice
from operator import attrgetter
from typing import Any

import numpy as np

from ....runtime.errors import InputError
from ....runtime.file_limits import LIMITS, check_count
from ....runtime.yaml_file import read_yaml
from ..log_map import MAPS
from ..table import Array
from .px4_ulog import unified

_SECOND = 10**9  # ns
_MICROSECOND = 1000  # ns
_LATEST = 2**63  # ns
_PX4 = "px4_msgs/msg/"
_SHOWN = 30  # fields that an error lists


@cache
def stated() -> dict[str, Any]:
    """Return what ``maps/recordings/ros.yaml`` states."""
    found: dict[str, Any] = read_yaml(MAPS / "recordings" / "ros.yaml", "a map of messages")
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


class Fields:
    """The numbers in a topic's messages that a map asks for; of an array all that it holds.

    Args:
        where: the topic, for errors.
        kind: the type of its messages.
        wanted: columns of the map.
    """

    def __init__(self, where: str, kind: str, wanted: Collection[str]) -> None:
        self._where, self._kind, self._wanted = where, kind, wanted
        self._names: list[str] = []
        self._getters: list[Callable[[Any], Any]] = []

    def take(self, message: Any) -> list[float]:
        """Return the numbers (K,) of a message.

        Raises:
            InputError: it has more than ``FileLimits.log_fields``, or less than the first one.
        """
        if not self._names:
            found = list(islice(_paths(message), LIMITS.log_fields + 1))
            check_count(self._where, len(found), LIMITS.log_fields, "fields of a message")
            arrays = set(map(array_of, self._wanted))
            is_px4 = self._kind.startswith(_PX4)
            if not is_px4 and not set(self._wanted) <= set(found):
                raise self._lack(self._wanted, found)
            self._names = [name for name in found if is_px4 or array_of(name) in arrays]
            self._getters = [_getter(name) for name in self._names]
        try:
            return [float(get(message)) for get in self._getters]
        except IndexError:
            names, self._names = self._names, []
            raise self._lack(names, list(_paths(message))) from None

    def columns(self, rows: Array) -> dict[str, Array]:
        """Return the columns (N,) of messages' numbers (N, K), by name.

        Raises:
            InputError: one that is wanted is not among them.
        """
        found = dict(zip(self._names, rows.T, strict=True))
        if self._kind.startswith(_PX4):
            name = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", self._kind.removeprefix(_PX4)).lower()
            found = unified(name, found)
        if not set(self._wanted) <= set(found):
            raise self._lack(self._wanted, list(found))
        return found

    def _lack(self, wanted: Collection[str], found: Collection[str]) -> InputError:
        missing = [name for name in wanted if name not in found]
        return InputError(
            f"{self._where}: no field {', '.join(missing)} in its {self._kind}; found "
            f"{', '.join(islice(found, _SHOWN)) or 'no number'}"
        )


def array_of(path: str) -> str:
    """Return a field's path without the numbers of its elements: what all elements share."""
    return re.sub(r"\[\d+\]", "[]", path)


def _paths(value: Any, path: str = "") -> Iterator[str]:
    """Yield the paths of the numbers in a message."""
    if isinstance(value, str | bytes):
        return
    if isinstance(value, int | float | np.generic):
        yield path
    elif hasattr(value, "__len__"):
        for i, item in enumerate(value):
            yield from _paths(item, f"{path}[{i}]")
    else:  # a message, of rosbags or of rclpy
        names = getattr(value, "__dataclass_fields__", None) or value.get_fields_and_field_types()
        for name in names:
            yield from _paths(getattr(value, name), f"{path}.{name}" if path else name)


def _getter(path: str) -> Callable[[Any], Any]:
    """Return a function that returns a field of a message."""
    if "[" not in path:
        return attrgetter(path)
    steps = [int(x) if x.isdecimal() else x for x in re.findall(r"[^.\[\]]+", path)]

    def get(value: Any) -> Any:
        for step in steps:
            value = value[step] if isinstance(step, int) else getattr(value, step)
        return value

    return get
