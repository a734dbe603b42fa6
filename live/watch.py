"""Warnings on a stream: printed once during the stream, and summed up at its end."""

from collections import deque

import numpy as np

from ..estimator.noise_scale import noise_warning
from ..runtime.arrays import Array
from .clocks import Clocks
from .filtering import LiveFilter, Output
from .messages import SECOND
from .tallies import Tallies

_EVERY = SECOND  # ns between two looks
_RATE = 0.01  # least difference of a clock from ours for a warning; devices differ by 1e-4
_LATE = 0.01  # share of poses; a sound link has none
_POSES = 100  # fewest poses for a share
_NOISE = 0.1  # s between two looks at the noise
_LOOKS = 50  # in the median: 5 s


class Watch:
    """Looks at a stream.

    Args:
        tallies: takes the warnings.
        clocks: the stream's.
        live: the filter.
    """

    def __init__(self, tallies: Tallies, clocks: Clocks, live: LiveFilter) -> None:
        self._tallies = tallies
        self._clocks = clocks
        self._filter = live
        self.poses = self._late = 0
        self._noise: deque[Array] = deque(maxlen=_LOOKS)
        self._due_noise = -np.inf  # s, stream's time
        self._due = 0  # ns
        self._said: set[str] = set()  # subjects

    def count(self, too_late: int) -> None:
        """Count a pose, and the poses found too late with this one."""
        self.poses += 1
        self._late += too_late

    @property
    def too_late(self) -> int:
        """Number of poses too late, without those during a clock's jump."""
        return self._late - self._clocks.poses_at_jumps

    def add(self, output: Output) -> None:
        """Take in an estimate."""
        if output.row.has_pose and output.t >= self._due_noise:
            self._due_noise = output.t + _NOISE
            self._noise.append(output.estimate.noise_scales)

    def look(self, now: int) -> None:
        """Warn once a subject; ``now`` in ns."""
        if now < self._due:
            return
        self._due = now + _EVERY
        line = self._clocks.line
        rate = None if line is None else line.latest_rate
        if rate is not None and abs(rate - 1.0) > _RATE:
            self._warn("rate", f"{_clock_words(rate)}; the filter's steps are in the sender's time")
        if late := self.late_words:
            self._warn("late", late)
        if noise := self.noise_words:
            self._warn("noise", noise)

    @property
    def noise_scales(self) -> Array | None:
        """Median noise of attitudes and positions (2,) over 5 s, as multiples of the declared
        standard deviations; None: not known yet.
        """
        looks = self._noise.copy()
        return np.median(looks, axis=0) if len(looks) == _LOOKS else None

    @property
    def noise_words(self) -> str:
        """Advice if the poses' noise differs from the declared one; else empty."""
        scales = self.noise_scales
        tuning = self._filter.tuning
        if scales is None or tuning is None:
            return ""
        return noise_warning(scales, tuning, self._filter.settings.tuning is None)

    @property
    def late_words(self) -> str:
        """Number of poses too late, in words; empty: hardly any."""
        if self.poses < _POSES or self.too_late <= _LATE * self.poses:
            return ""
        horizon = self._filter.settings.horizon
        return (
            f"{self.too_late} of {self.poses} poses came more than {horizon:g} s late and were "
            "left out; --horizon takes later ones"
        )

    @property
    def rate_words(self) -> str:
        """Rate of the sender's clock, in words; empty: the same as ours."""
        line = self._clocks.line
        rate = None if line is None else line.mean_rate or line.latest_rate
        return "" if rate is None or abs(rate - 1.0) <= _RATE else _clock_words(rate)

    @property
    def words(self) -> list[str]:
        """All warnings at the end."""
        return [words for words in (self.rate_words, self.late_words, self.noise_words) if words]

    def _warn(self, subject: str, words: str) -> None:
        if subject not in self._said:
            self._said.add(subject)
            self._tallies.say(f"warning: {words}")


def _clock_words(rate: float) -> str:
    return f"the sender's clock runs at {rate:.3f} of this machine's"
