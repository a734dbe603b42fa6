"""What a user must know of a stream: said once while it runs, and summed up at its end."""

from .clocks import Clocks
from .messages import SECOND
from .tallies import Tallies

_EVERY = SECOND  # ns between two looks
_RATE = 0.01  # by which a clock differs from ours before it is told; devices' differ by 1e-4
_LATE = 0.01  # share of poses; a link in order has none
_POSES = 100  # poses before their share is told


class Watch:
    """Looks at a stream.

    Args:
        tallies: where warnings are said.
        clocks: of the stream.
        horizon: that a pose may be late, s.
    """

    def __init__(self, tallies: Tallies, clocks: Clocks, horizon: float) -> None:
        self._tallies, self._clocks, self._horizon = tallies, clocks, horizon
        self.poses = self.too_late = 0
        self._due = 0  # ns
        self._said: set[str] = set()  # subjects

    def count(self, too_late: int) -> None:
        """Count a pose that came, and how many were found too late by it."""
        self.poses += 1
        self.too_late += too_late

    def look(self, now: int) -> None:
        """Warn of what is amiss, once a subject; ``now`` in ns."""
        if now < self._due:
            return
        self._due = now + _EVERY
        line = self._clocks.line
        rate = None if line is None else line.latest_rate
        if rate is not None and abs(rate - 1.0) > _RATE:
            self._warn("rate", f"{_clock_words(rate)}; the filter's steps are in the sender's time")
        if late := self.late_words:
            self._warn("late", late)

    @property
    def late_words(self) -> str:
        """How many poses were too late; empty where that is hardly any."""
        if self.poses < _POSES or self.too_late <= _LATE * self.poses:
            return ""
        return (
            f"{self.too_late} of {self.poses} poses came more than {self._horizon:g} s late and "
            "were left out; --horizon takes later ones"
        )

    @property
    def rate_words(self) -> str:
        """How fast the sender's clock ran; empty where it ran as ours."""
        line = self._clocks.line
        rate = None if line is None else line.mean_rate
        return "" if rate is None or abs(rate - 1.0) <= _RATE else _clock_words(rate)

    @property
    def words(self) -> list[str]:
        """What there is to tell at the end."""
        return [words for words in (self.rate_words, self.late_words) if words]

    def _warn(self, subject: str, words: str) -> None:
        if subject not in self._said:
            self._said.add(subject)
            self._tallies.say(f"warning: {words}")


def _clock_words(rate: float) -> str:
    return f"the sender's clock runs at {rate:.3f} of this machine's"
