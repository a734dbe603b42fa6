"""Records whether a control law reads true values in ``info``: the leaderboard marks such laws."""

from collections.abc import Iterator, Mapping
from typing import Any

# entries of ``info`` without a truth: the observation and the command in SI units, and the clock
OBSERVED = frozenset({"observation", "command", "time"})


class WatchedInfo(Mapping[str, Any]):
    """The ``info`` of an environment, read-only; ``read_truth`` is True after a read of the truth.

    Asking for a name alone (``"error" in info``) reads no value.
    """

    def __init__(self, info: Mapping[str, Any]) -> None:
        self._info, self.read_truth = info, False

    def __getitem__(self, name: str) -> Any:
        value = self._info[name]
        self.read_truth = self.read_truth or name not in OBSERVED
        return value

    def __contains__(self, name: object) -> bool:
        return name in self._info

    def __iter__(self) -> Iterator[str]:
        return iter(self._info)

    def __len__(self) -> int:
        return len(self._info)
