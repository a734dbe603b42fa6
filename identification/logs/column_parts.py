"""Which columns of a table are which part of a flight: what their numbers obey counts for more than
their names, which may be anyone's.

A quaternion has length 1. An accelerometer reads gravity, 9.81 m/s2 or 1 g. The size of a gyro is
that of the attitude's rate, and the horizontal acceleration of a position follows the tilt, in
whatever frames. Rotors or commands are
four columns of one size that move together with the specific force. Columns whose names say nothing
are looked at by threes and fours that stand side by side.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.integrate import cumulative_trapezoid

from .column_names import Group, Name, groups_of, named_alone, side_by_side, words
from .log_map import UNITS
from .magnitudes import likely_unit, within
from .table import Array

_FOURS = (("1", "2", "3", "4"), ("0", "1", "2", "3"))
_TRIPLES = (("x", "y", "z"), ("roll", "pitch", "yaw"))  # of which no column is another group's


@dataclass(frozen=True)
class PartSettings:
    """When numbers speak for a part, and what that counts beside a name (4 for the likeliest)."""

    numbers: float = 4.0  # what numbers that obey the part's physics count
    certain: float = 2.0  # lead over the next candidate
    length: tuple[float, float] = (2e-3, 0.02)  # error of a quaternion's: median, and of 98 %
    window: float = 0.2  # s, over which rates are taken
    rows: int = 20_000  # in the middle of the flight that are looked at, at most
    samples: int = 4000  # of them that are compared, at most
    levels: int = 10  # that a switch may take
    fewest: int = 30  # that decide something
    follows: float = 0.7  # correlation from which on one follows the other
    same_size: float = 1.3  # up to which rates in one unit are of one size
    alike: float = 1.6  # ratio of medians of four rotors
    felt: float = 0.5  # correlation of rotors with the specific force
    shown: int = 4  # candidates that a map lists


PARTS = PartSettings()


def correlation(x: Array, y: Array) -> float:
    """Return the correlation of two series (n,); 0 where one is constant."""
    return float(np.nan_to_num(np.corrcoef(x, y)[0, 1]))


def resampled(t: Array, times: Array, values: Array) -> Array:
    """Return values (m, k) of times (m,) at times (n,), on the lines between them."""
    return np.column_stack([np.interp(t, times, x) for x in values.T])


class Numbers:
    """What the numbers of columns obey.

    Args:
        t: (N,) s; NaN in rows that are not looked at.
        data: columns (N,) by name.
    """

    def __init__(self, t: Array, data: Mapping[str, Array]) -> None:
        order = np.argsort(t, kind="stable")[: int(np.isfinite(t).sum())]
        self.order = order[max(0, (len(order) - PARTS.rows) // 2) :][: PARTS.rows]
        self.t = t[self.order]
        self.data = {name: x for name, x in data.items() if np.isfinite(x[self.order]).any()}
        self._rows: dict[tuple[str, ...], tuple[Array, Array]] = {}
        self.attitude: Array = np.empty((0, 0))  # (n, 4) at ``self.begins``, where there is one
        self.begins = self.ends = np.empty(0)
        self.rate: Array = np.empty(0)  # (n,) rad/s, of the attitude
        self.felt: list[Array] = []  # what may be the specific force, at ``self.clock``

    @cached_property
    def clock(self) -> Array:
        """Times (n,) in s at which motors are compared."""
        count = min(PARTS.samples, len(self.t))
        return np.asarray(self.t[np.linspace(0, len(self.t) - 1, count).astype(int)])

    def rows(self, columns: Sequence[str]) -> tuple[Array, Array]:
        """Return the times (n,) and values (n, k) of the rows in which columns are all there."""
        if (key := tuple(columns)) not in self._rows:
            values = np.column_stack([self.data[name][self.order] for name in columns])
            there = np.isfinite(values).all(axis=1)
            self._rows[key] = self.t[there], values[there]
        return self._rows[key]

    def some(self, columns: Sequence[str]) -> Array:
        """Return values (n, k) of some rows, spread over all."""
        values = self.rows(columns)[1]
        return values[:: max(1, len(values) // PARTS.samples)]

    def between(self, t: Array, columns: Sequence[str]) -> Array:
        """Return values (n, k) at times (n,), of lines between the rows."""
        times, values = self.rows(columns)
        return (
            resampled(t, times, values) if len(times) else np.full((len(t), len(columns)), np.nan)
        )

    def _bend(self, t: Array, columns: Sequence[str]) -> Array:
        """Return the second differences (n, k) around times (n,)."""
        before, at, after = (self.between(t + k * PARTS.window, columns) for k in (-1, 0, 1))
        return np.asarray(before - 2.0 * at + after)

    def varies(self, column: str) -> bool:
        """Return whether a column takes more than a few values: no counter's and no switch's."""
        return column in self.data and len(np.unique(self.some([column]))) > PARTS.levels

    def is_quaternion(self, columns: Sequence[str]) -> bool:
        """Return whether four columns have length 1, and turn."""
        x = self.some(columns)
        length = np.linalg.norm(x, axis=1)
        there = length > 0.5  # zeros stand for one that is not there
        if there.sum() < max(2, 0.5 * len(x)):
            return False
        off = np.abs(length[there] - 1.0)
        return bool(np.median(off) < PARTS.length[0] and np.quantile(off, 0.98) < PARTS.length[1])

    def take_attitude(self, columns: Sequence[str]) -> None:
        """Keep a quaternion, by which gyro and position are known."""
        t, q = self.rows(columns)
        if len(t) < PARTS.fewest:
            return
        step = max(1, len(t) // PARTS.samples)
        ends = np.minimum(np.searchsorted(t, t + PARTS.window)[::step], len(t) - 1)
        begins = np.arange(len(t))[::step]
        keep = t[ends] - t[begins] < 2.0 * PARTS.window
        keep &= t[ends] >= t[begins] + PARTS.window
        begins, ends = begins[keep], ends[keep]
        with np.errstate(invalid="ignore", divide="ignore"):
            q = q / np.linalg.norm(q, axis=1, keepdims=True)
        cosine = np.abs(np.sum(q[begins] * q[ends], axis=1))
        self.begins, self.ends, self.attitude = t[begins], t[ends], q[begins]
        self.rate = 2.0 * np.arccos(np.clip(cosine, 0.0, 1.0)) / (self.ends - self.begins)

    def gyro_unit(self, columns: Sequence[str]) -> tuple[str, float]:
        """Return the unit in which three columns turn as fast as the attitude, and how alike the
        two are, at most 1; nothing: in none.
        """
        t, values = self.rows(columns)
        if len(self.rate) < PARTS.fewest or len(t) < PARTS.fewest:
            return "", 0.0
        turned = cumulative_trapezoid(values - np.median(values, axis=0), t, axis=0, initial=0.0)
        turned = resampled(self.ends, t, turned) - resampled(self.begins, t, turned)
        size = np.linalg.norm(turned, axis=1) / (self.ends - self.begins)
        good = np.isfinite(size) & np.isfinite(self.rate)
        alike = correlation(size[good], self.rate[good])
        ratio = float(np.mean(size[good]) / max(float(np.mean(self.rate[good])), 1e-12))
        one = 1.0 / PARTS.same_size, PARTS.same_size
        units = (unit for unit in ("rad/s", "deg/s") if within(ratio * UNITS["gyro"][unit], one))
        unit = next(units, "")
        return (unit, alike) if unit and alike > PARTS.follows else ("", 0.0)

    def gravity_unit(self, columns: Sequence[str]) -> tuple[str, float]:
        """Return the unit in which three columns have the size of gravity, and 1, or less where it
        does not lie along the third; nothing: in none.
        """
        x = self.some(columns)
        length = np.linalg.norm(x, axis=1)
        size, middle = float(np.median(length)), np.abs(np.median(x, axis=0))
        if np.std(length) < 1e-6 * size or middle.max() < 0.8 * size:
            return "", 0.0  # a direction, or all that turns
        unit, is_gravity = likely_unit("accelerometer", size)
        return (unit, 1.0 if middle.argmax() == 2 else 0.8) if is_gravity else ("", 0.0)

    def follows_tilt(self, columns: Sequence[str]) -> float:
        """Return how the second difference of two of three columns follows the tilt, at most 1; 0
        where it does not.
        """
        if len(self.begins) < PARTS.fewest or len(self.rows(columns)[0]) < PARTS.fewest:
            return 0.0
        force = self._bend(self.begins, columns)
        best = 0.0
        for w, x, y, z in (self.attitude.T, self.attitude[:, [3, 0, 1, 2]].T):
            for sign in (1.0, -1.0):
                tilt = x * z + sign * w * y, y * z - sign * w * x
                found = [abs(correlation(f, d)) for f, d in zip(force.T, tilt, strict=False)]
                best = max(best, min(found))
        return best if best > PARTS.follows else 0.0

    def moves_together(self, columns: Sequence[str]) -> bool:
        """Return whether four columns are of one size and move with the specific force."""
        x = self.some(columns)
        x = x[np.any(x != 0.0, axis=1)]
        if len(x) < PARTS.fewest or np.mean(x < 0.0) > 0.01 or not np.all(np.ptp(x, axis=0) > 0.0):
            return False
        middle = np.median(x, axis=0)
        if not middle.min() * PARTS.alike >= middle.max() > 0.0:
            return False
        total = self.between(self.clock, columns).sum(axis=1)
        return any(correlation(total, felt) > PARTS.felt for felt in self.felt)

    def feel(self, accelerometer: Sequence[str], position: Sequence[str]) -> None:
        """Keep what may be the specific force: an accelerometer's size, else accelerations."""
        if accelerometer:
            self.felt = [np.linalg.norm(self.between(self.clock, accelerometer), axis=1)]
        elif position:
            force = self._bend(self.clock, position).T
            self.felt = [*force, *-force]

    def elasticity(self, values: Array) -> float:
        """Return by which power of four motors' mean (N, 4) the specific force grows: 2 of rotor
        speeds, more of pulses that stand on an offset. NaN where the flight does not show it.
        """
        if len(self.felt) != 1:
            return np.nan
        total = np.nanmean(values[self.order], axis=1)
        good = np.isfinite(total)
        mean = np.interp(self.clock, self.t[good], total[good])
        there = (mean > 0.5 * np.median(mean)) & (self.felt[0] > 0.3 * np.median(self.felt[0]))
        x, y = np.log(mean[there]), np.log(self.felt[0][there])
        if len(x) < PARTS.fewest or correlation(x, y) < 0.85:
            return np.nan
        return float(np.std(y) / np.std(x))


@dataclass(frozen=True, eq=False)
class Candidate:
    """Columns that may be a part of a flight."""

    group: Group
    score: float
    why: str

    def __str__(self) -> str:
        return f"[{', '.join(self.group.columns)}] ({self.why})"


def _named(group: Group, part: str = "") -> bool:
    """Return whether the names of a group speak for a part, but ``part``."""
    return any(
        re.fullmatch(word, group.key)
        for other, ways in words()["parts"].items()
        for way in ways
        if other != part and list(group.endings) in way["endings"]
        for word in way["words"]
    )


def named_columns(names: Sequence[Name]) -> set[str]:
    """Return the columns whose names speak for a part."""
    endings = [e for ways in words()["parts"].values() for way in ways for e in way["endings"]]
    groups = [group for ending in endings for group in groups_of(names, ending) if _named(group)]
    alone = [name.column for part in ("time", "battery") for name in named_alone(names, part)]
    return {*alone, *(column for group in groups for column in group.columns)}


def find_parts(names: Sequence[Name], numbers: Numbers) -> dict[str, list[Candidate]]:
    """Return the candidates of each part, the likeliest first. The columns of the first belong to
    no later part.

    Args:
        names: of the columns, but the time's.
        numbers: of columns; those without are no part's.
    """
    names = [name for name in names if name.column in numbers.data]
    found: dict[str, list[Candidate]] = {}
    taken: set[str] = set()
    for part in ("attitude", "accelerometer", "gyro", "position", "motors", "commands"):
        if part == "motors":
            felt, placed = (
                found[p][0].group.columns if found[p] and found[p][0].score > 0.0 else ()
                for p in ("accelerometer", "position")
            )
            numbers.feel(felt, placed)
        free = [name for name in names if name.column not in taken]
        ranked = sorted(_candidates(part, free, numbers), key=lambda c: -c.score)
        seen: dict[tuple[str, ...], Candidate] = {}
        for candidate in ranked:
            seen.setdefault(candidate.group.columns, candidate)
        found[part] = list(seen.values())
        if found[part] and found[part][0].score > 0.0:
            first = found[part][0].group.columns
            taken |= set(first)
            if part == "attitude" and len(first) == 4:
                numbers.take_attitude(first)
    return found


def _candidates(part: str, names: Sequence[Name], numbers: Numbers) -> Iterator[Candidate]:
    """Yield the candidates of a part, with a score by their names and numbers."""
    named = {column for way in _TRIPLES for g in groups_of(names, way) for column in g.columns}
    fours = (group for ending in _FOURS for group in groups_of(names, ending))
    commanded = part == "motors" and any(_named(group, part) for group in fours)
    for number, way in enumerate(words()["parts"][part]):
        for group in (group for endings in way["endings"] for group in groups_of(names, endings)):
            places = (i for i, word in enumerate(way["words"]) if re.fullmatch(word, group.key))
            by_name, why = -1.0, "their names go together"
            if (i := next(places, None)) is not None:
                by_name, why = PARTS.numbers - 0.3 * i - 0.5 * number, "by the columns' names"
            elif commanded or _named(group, part):
                continue
            named |= set(group.columns)
            yield from _judged(part, group, by_name, why, numbers)
    width = 4 if part in ("attitude", "motors") else 3
    if part == "commands" or commanded:
        return
    loose = [name for name in names if name.column not in named and numbers.varies(name.column)]
    for group in side_by_side(loose, width):
        yield from (one for one in _judged(part, group, 0.0, "", numbers) if one.why)


def _judged(
    part: str, group: Group, score: float, why: str, numbers: Numbers
) -> Iterator[Candidate]:
    """Yield a group with its score, more where its numbers obey the part's physics; nothing where
    they contradict it.
    """
    columns, strength, words = group.columns, 0.0, ""
    if not len(numbers.rows(columns)[0]):
        pass
    elif part == "attitude" and len(columns) == 4:
        if not numbers.is_quaternion(columns):
            return
        strength, words = 1.0, "their length is 1"
    elif part == "accelerometer":
        unit, strength = numbers.gravity_unit(columns)
        words = f"their size is gravity's, in {unit}"
    elif part == "gyro":
        unit, strength = numbers.gyro_unit(columns)
        words = f"they turn as the attitude does, in {unit}"
    elif part == "position":
        strength, words = numbers.follows_tilt(columns), "their acceleration follows the tilt"
    elif part in ("motors", "commands") and numbers.moves_together(columns):
        strength, words = 1.0, "they move together with the specific force"
    said = [why, words] if strength else [why]
    yield Candidate(group, score + PARTS.numbers * strength, "; ".join(filter(None, said)))
