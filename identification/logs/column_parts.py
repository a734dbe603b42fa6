"""The parts of a flight among a table's columns: numbers that obey physics count for more than
names.

A quaternion has length 1. An accelerometer reads gravity, 9.81 m/s2 or 1 g. The horizontal
acceleration of a position follows the tilt, in whatever frames, and a gyro the turns of the pose.
Rotors or commands are four columns of one size, correlated with the specific force. Columns without
telling names are tried by adjacent threes and fours.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from ..motion.smoothing import resampled, second_difference
from .column_names import WORDS, Group, Name, groups_of, named_alone
from .magnitudes import likely_unit
from .table import Array, ArrayMap, ArrayPair, Names, finite_rows, lengths

Verdict = tuple[float, str]  # how well columns obey a part's physics, and in words
Judge = Callable[[Names], Verdict]


# When numbers speak for a part, and their score beside a name's (4 for the likeliest).
_NUMBERS = 4.0  # score of numbers by the part's physics
_MOST_ROWS = 20_000  # at most, from the middle of the flight
_MOST_SAMPLES = 4000  # at most, of the rows compared
_FEWEST = 30  # for a decision
SHOWN = 4  # candidates in a map


def _correlation(x: Array, y: Array) -> float:
    """Return the correlation of two series (n,); 0 where one is constant."""
    return float(np.nan_to_num(np.corrcoef(x, y)[0, 1]))


class Numbers:
    """Tests of columns' numbers against physics.

    Args:
        t: (N,) s; NaN in rows left out.
        data: columns (N,) by name.
    """

    def __init__(self, t: Array, data: ArrayMap) -> None:
        order = np.argsort(t, kind="stable")[: np.isfinite(t).sum()]
        self.order = order[max(0, (len(order) - _MOST_ROWS) // 2) :][:_MOST_ROWS]
        self.t = t[self.order]
        rows = len(self.t)
        # times (n,) in s of comparisons of motors
        self.clock = self.t[np.linspace(0, rows - 1, min(_MOST_SAMPLES, rows)).astype(int)]
        self.data = {name: x for name, x in data.items() if np.isfinite(x[self.order]).any()}
        self.rows = cache(self._rows)
        self.felt: list[Array] = []  # likely specific forces, at ``self.clock``

    def _rows(self, columns: Names) -> ArrayPair:
        """Return the times (n,) and values (n, k) of the rows with all columns."""
        values = np.column_stack([self.data[name][self.order] for name in columns])
        there = finite_rows(values)
        return self.t[there], values[there]

    def some(self, columns: Names) -> Array:
        """Return values (n, k) of some rows, spread over all."""
        values = self.rows(columns)[1]
        return values[:: max(1, len(values) // _MOST_SAMPLES)]

    def between(self, t: Array, columns: Names) -> Array:
        """Return values (n, k) at times (n,), of lines between the rows."""
        times, values = self.rows(columns)
        if not len(times):
            return np.full((len(t), len(columns)), np.nan)
        return resampled(t, times, values)

    def quaternion(self, columns: Names) -> Verdict:
        """Return 1 where columns may be an attitude: three angles are 0, for nothing shows them;
        minus infinite where four columns have another length than 1.
        """
        if len(columns) == 3:
            return 0.0, ""
        x = self.some(columns)
        length = lengths(x)
        off = abs(length[length > 0.5] - 1.0)  # zeros stand for a missing quaternion
        # median error of a quaternion's length, and of 98 %
        if len(off) < max(2, 0.5 * len(x)) or (np.quantile(off, [0.5, 0.98]) >= (2e-3, 0.02)).any():
            return -np.inf, ""
        return 1.0, "their length is 1"

    def gravity(self, columns: Names) -> Verdict:
        """Return 1 where gravity lies along the third of three columns, 0.8 along another."""
        x = self.some(columns)
        length = lengths(x)
        size, middle = np.median(length), abs(np.median(x, axis=0))
        unit, is_gravity = likely_unit("accelerometer", size)
        if not is_gravity or length.std() < 1e-6 * size or middle.max() < 0.8 * size:
            return 0.0, ""  # another size, a direction, or a turning vector
        return (1.0 if middle.argmax() == 2 else 0.8), f"their size is gravity's, in {unit}"

    def moves_together(self, columns: Names) -> Verdict:
        """Return 1 where four columns are of one size and move with the specific force."""
        x = self.some(columns)
        x = x[x.any(axis=1)]
        if len(x) < _FEWEST or (x < 0.0).mean() > 0.01 or not np.ptp(x, axis=0).all():
            return 0.0, ""
        middle, total = np.median(x, axis=0), self.between(self.clock, columns).sum(axis=1)
        together = any(_correlation(total, felt) > 0.5 for felt in self.felt)
        together &= middle.min() * 1.6 >= middle.max() > 0.0
        return float(together), "they move together with the specific force"

    def feel(self, accelerometer: Group | None, position: Group | None) -> None:
        """Keep likely specific forces: an accelerometer's size, else accelerations."""
        if accelerometer:
            self.felt = [lengths(self.between(self.clock, accelerometer.columns))]
        elif position:
            force = second_difference(self.clock, 0.2, *self.rows(position.columns)).T
            self.felt = [*force, *-force]

    def elasticity(self, values: Array) -> float:
        """Return the power of four motors' mean (N, 4) by which the specific force grows: 2 of
        rotor speeds, more of pulses on an offset. NaN: the flight does not show the power.
        """
        if len(self.felt) != 1:
            return np.nan
        total, felt = np.nanmean(values[self.order], axis=1), self.felt[0]
        good = np.isfinite(total)
        mean = np.interp(self.clock, self.t[good], total[good])
        there = (mean > 0.5 * np.median(mean)) & (felt > 0.3 * np.median(felt))
        x, y = np.log(mean[there]), np.log(felt[there])
        if len(x) < _FEWEST or _correlation(x, y) < 0.85:
            return np.nan
        return float(y.std() / x.std())


@dataclass(frozen=True, eq=False)
class ColumnCandidate:
    """Columns of a possible part of a flight."""

    group: Group
    score: float
    why: str

    def __str__(self) -> str:
        return f"[{', '.join(self.group.columns)}] ({self.why})"


def _named(group: Group, part: str = "") -> bool:
    """Return whether the names of a group speak for a part, but ``part``."""
    return any(
        re.fullmatch("|".join(way["words"]), group.key)
        for other, ways in WORDS["parts"].items()
        for way in ways
        if other != part and list(group.endings) in way["endings"]
    )


def named_columns(names: Sequence[Name]) -> set[str]:
    """Return the columns with a part's name."""
    endings = [e for ways in WORDS["parts"].values() for way in ways for e in way["endings"]]
    groups = [group for ending in endings for group in groups_of(names, ending) if _named(group)]
    found = {name.column for part in ("time", "battery") for name in named_alone(names, part)}
    return found.union(*(group.columns for group in groups))


def candidates(
    part: str, names: Sequence[Name], numbers: Numbers, judge: Judge
) -> list[ColumnCandidate]:
    """Return the candidates of a part by their names and numbers, the likeliest first.

    Args:
        part: a section of a log map, or ``motors``.
        names: free columns; a column without numbers is no part's.
        numbers: of columns.
        judge: returns how well columns obey the part's physics, from 0 to 1 (minus infinite: they
            contradict the part), and in words.
    """
    names = [name for name in names if name.column in numbers.data]
    # the columns of triples are no other group's
    triples = groups_of(names, "xyz") + groups_of(names, ("roll", "pitch", "yaw"))
    named = {column for group in triples for column in group.columns}
    fours = groups_of(names, "1234") + groups_of(names, "0123")
    commanded = part == "motors" and any(_named(group, part) for group in fours)
    ways = []
    for number, way in enumerate(WORDS["parts"][part]):
        for group in (group for endings in way["endings"] for group in groups_of(names, endings)):
            matches = [bool(re.fullmatch(word, group.key)) for word in way["words"]]
            if any(matches):
                by_name = _NUMBERS - 0.3 * matches.index(True) - 0.5 * number
                ways.append((group, by_name, "by the columns' names"))
            elif commanded or _named(group, part):
                continue
            else:
                ways.append((group, -1.0, "their names go together"))
            named.update(group.columns)
    if part != "commands" and not commanded:
        width = 4 if part in ("attitude", "motors") else 3
        # with more than a few values: no counter's and no switch's
        measured = tuple(
            n.column
            for n in names
            if n.column not in named
            # a switch has at most 10 levels
            and len(np.unique(numbers.some((n.column,)))) > 10
            and not re.search(WORDS["not_measured"], n.base)
        )
        adjacent = zip(*(measured[i:] for i in range(width)), strict=False)
        ways += [(Group(columns), 0.0, "") for columns in adjacent]
    found = []
    for group, score, why in ways:
        strength, told = judge(group.columns) if len(numbers.rows(group.columns)[0]) else (0.0, "")
        words = "; ".join(filter(None, (why, told if strength else "")))
        if words and strength >= 0.0:
            found.append(ColumnCandidate(group, score + _NUMBERS * strength, words))
    found.sort(key=lambda candidate: -candidate.score)
    likeliest: dict[Names, ColumnCandidate] = {}
    for candidate in found:
        likeliest.setdefault(candidate.group.columns, candidate)
    return [*likeliest.values()]
