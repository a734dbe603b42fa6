"""Groups of columns with one clock each, in the kit's units, axes and order of rotors.

With W from the log's world and B from its body axes to this kit's, positions become W p, attitudes
W R B' and a sensor's vectors B v.

A table is one such group: a lost channel, or one slower than the table, is interpolated over short
gaps; a long gap hides too much.

The clock of a recording may not be one clock: a stamp is wrong, rows were written late, a counter
rolls over, or a vehicle was switched on twice. Each group keeps its stamps in the order of writing.
"""

from bisect import bisect_left
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite, nan
from pathlib import Path
from statistics import mode

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from ...runtime.errors import InputError
from ..motion.smoothing import resampled
from .log_map import UNITS, Attitude, Battery, Columns, Commands, LogMap, Rotors, Sensor, constant
from .table import (
    Array,
    ArrayMap,
    Lines,
    Mask,
    NamedArrays,
    Noted,
    Piece,
    Rows,
    SomeArray,
    Table,
    finite_rows,
    lengths,
)

_HALF_TURN = np.diag([1.0, -1.0, -1.0])
# from the log's world, or its body axes, to the kit's
_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
BODY_TURNS: NamedArrays = {"flu": np.eye(3), "frd": _HALF_TURN, "y_up": _Y_UP}
WORLD_TURNS = {"enu": BODY_TURNS["flu"], "ned": _HALF_TURN, "y_up": _Y_UP}


@dataclass(frozen=True, eq=False)
class ChannelGroup:
    """Columns with one clock; rows in the order of time."""

    t: Array  # (N,) s
    columns: ArrayMap  # by name (N,); NaN: no value
    topic: str = ""  # of the columns' message, in a log of several
    table: Table | None = None  # of the columns
    rows: Rows | None = None  # (N,) of it

    def values(self, part: Columns) -> Array:
        """Return a section's columns (N, k), with their signs and scale; a constant such as ``=0``
        in every row.
        """
        values = np.empty((len(self.t), len(part.columns)))
        for i, name in enumerate(part.columns):
            values[:, i] = self.columns.get(name, constant(name))
        return scaled(part, values)

    def there(self, part: Columns) -> Mask:
        """Return the rows (N,) with all values of a section."""
        return finite_rows(np.transpose([self.t, *map(self.columns.__getitem__, part.named)]))

    def has(self, part: Columns) -> bool:
        """Return whether a section's columns are there."""
        return part.topic in ("", self.topic) and set(part.named) <= set(self.columns)

    def cut(self, keep: slice | Mask | Rows) -> "ChannelGroup":
        """Return some of the rows; itself where a mask keeps all, since an hour takes 120 MB."""
        if isinstance(keep, np.ndarray) and keep.dtype == np.bool_ and keep.all():
            return self
        columns = {name: column[keep] for name, column in self.columns.items()}
        rows = None if self.rows is None else self.rows[keep]
        return replace(self, t=self.t[keep], columns=columns, rows=rows)

    def place(self, index: int) -> str:
        """Return where a sample stands, for errors: the table's row, else its time."""
        if self.table is None or self.rows is None:
            return f"at {self.t[index]:.6g} s"
        return self.table.row(self.rows[index])


Groups = list[ChannelGroup]


@dataclass(frozen=True, eq=False)
class Stream:
    """Samples of one quantity."""

    name: str  # topic's or column's name
    t: Array  # (N,) s, all streams of a log on one clock
    values: Array  # (N, K); NaN: not measured

    def whole(self) -> "Stream":
        """Return the samples of finite values."""
        good = finite_rows(self.values)
        return self if good.all() else Stream(self.name, self.t[good], self.values[good])

    def at(self, t: Array) -> Array:
        """Return the values (M, K) at times (M,) in s: each column is linear between its finite
        values and held beyond the first and the last. A column without any is NaN.
        """
        out = np.full((len(t), self.values.shape[1]), nan)
        for i, column in enumerate(self.values.T):
            good = np.isfinite(column)
            if good.any():
                out[:, i] = np.interp(t, self.t[good], column[good])
        return out

    def between(self, t: Array) -> Array:
        """Return the values (M, K) at times (M,) in s: a sample's own at its time, else linear
        between its neighbours; NaN beyond the first and the last, and where samples are missing.
        """
        times = self.t
        if np.array_equal(t, times):
            return self.values
        out = resampled(t, times, self.values)
        step = np.diff(times)
        after = np.searchsorted(times, t).clip(1, len(step))
        there = (step[after - 1] <= LONGEST_STEPS * np.median(step)) | np.isin(t, times)
        out[~there | (t < times[0]) | (t > times[-1])] = nan
        return out


def readable(stream: Stream | None) -> Stream | None:
    """Return the finite samples (N, K); None: fewer than two."""
    finite = stream and stream.whole()
    return finite if finite and len(finite.t) > 1 else None


def slerp(t: Array, attitude: Stream, longest: float = inf) -> Array:
    """Return attitudes (M, 4), scalar first, at times (M,) in s; NaN outside the samples, and
    within a gap of more than ``longest`` s. Samples at all of the times are returned as they are,
    whatever their length.
    """
    out = np.full((len(t), 4), nan)
    good = lengths(attitude.values) > 0.5  # False where NaN
    times, values = attitude.t[good], attitude.values[good]
    after = np.searchsorted(times, t)
    exact = np.isin(t, times)
    if exact.all():
        return values[after]
    if len(times) < 2:
        return out
    inside = (t >= times[0]) & (t <= times[-1])
    inside &= exact | (np.diff(times)[after.clip(1, len(times) - 1) - 1] <= longest)
    if inside.any():
        turn = Slerp(times, Rotation.from_quat(values, scalar_first=True))
        out[inside] = turn(t[inside]).as_quat(scalar_first=True)
    return out


def scaled(part: Columns, values: Array) -> Array:
    """Return columns (N, k), with the section's signs and scale."""
    return values * (np.array(part.signs or 1) * part.scale)


def in_kit_units(log_map: LogMap, section: str, part: Columns, values: Array) -> Array:
    """Return a section's scaled values (N, k), but no attitude's, in SI units, and in the kit's
    axes and order of rotors; commands as 0 to 1.
    """
    unit = UNITS.get(section, {}).get(part.unit, 1.0)
    if isinstance(part, Rotors | Commands):
        values = values[:, np.subtract(part.order, 1)]
    if isinstance(part, Rotors):
        return values * (unit / part.pole_pairs)
    if isinstance(part, Commands):
        assert part.range is not None
        low, high = part.range
        return (values - low) / (high - low)
    if isinstance(part, Battery):
        return values * unit * part.cells
    if isinstance(part, Sensor):
        return values @ (unit * BODY_TURNS[part.body or log_map.body].T)
    return values if section == "wrench" else values @ (unit * WORLD_TURNS[log_map.world].T)


def quaternions(part: Attitude, values: Array) -> Array:
    """Return an attitude's columns (N, k) as quaternions (N, 4), scalar first, in the columns' axes
    and of the columns' length.
    """
    if not part.euler:
        return values[:, [part.order.index(name) for name in "wxyz"]]
    order = ["xyz".index(axis) for axis in part.euler]
    turn = Rotation.from_euler(part.euler.upper(), values[:, order] * UNITS["attitude"][part.unit])
    return np.asarray(turn.as_quat(scalar_first=True))


def in_kit_axes(log_map: LogMap, part: Attitude, attitude: Array) -> Array:
    """Return quaternions (N, 4) of length 1 as turns from the kit's body axes to its world."""
    if part.sense == "world_to_body":
        attitude = attitude * [1.0, -1.0, -1.0, -1.0]
    if log_map.world == "enu" and log_map.body == "flu":
        return attitude
    if log_map.world == "ned" and log_map.body == "frd":  # quaternions of any length, NaN included
        return attitude * [1.0, 1.0, -1.0, -1.0]
    matrix = Rotation.from_quat(attitude, scalar_first=True).as_matrix()
    turn = Rotation.from_matrix(WORLD_TURNS[log_map.world] @ matrix @ BODY_TURNS[log_map.body].T)
    return np.asarray(turn.as_quat(scalar_first=True))


# When a clock is rolled over, reset or late.
ROLLOVER = 2.0**32 * 1e-6  # s, of a counter of 32 bits of microseconds
_JITTER = 1.0  # s, of the stamps at both ends of a rollover
_RESET = 1.0  # s, the least step back of a restart; late rows are late by less


def on_one_clock(path: Path, recorded: Groups, piece: Piece = None) -> Noted[Groups]:
    """Return groups of columns with times that increase strictly, and notes.

    Args:
        path: the file, for errors.
        recorded: the groups, in the order of their writing.
        piece: part of the file to read, from 1, after restarts of the clock; default: the longest.

    Raises:
        InputError: there is no such piece.
    """
    groups = []
    notes = []
    for samples in recorded:
        over = (abs(np.diff(samples.t, prepend=nan) + ROLLOVER) < _JITTER).cumsum()
        groups.append(replace(samples, t=samples.t + ROLLOVER * over))
        if over.any():
            notes.append("the clock of 32 bits rolled over in the log; later times go on behind it")
    groups = _of_piece(path, groups, piece, notes)
    for i, samples in enumerate(groups):
        rows, late = in_order(samples.t)
        name, count = samples.topic or next(iter(samples.columns), "rows"), len(samples.t)
        if late:
            notes.append(f"{name}: {late} of {count} rows were written late and sorted in")
        if left := count - len(rows):
            notes.append(
                f"{name}: {left} of {count} samples repeat a time or have one that the samples "
                "around them contradict, and were left out"
            )
        if late or left:
            groups[i] = samples.cut(rows)
    return groups, list(dict.fromkeys(notes))


def _of_piece(path: Path, groups: Groups, piece: Piece, notes: Lines) -> Groups:
    """Return each group's rows of one piece; ``notes`` get one on the number of pieces.

    A group with another number of pieces was not written in each of them. Such a group stays whole,
    without rows of earlier times.
    """
    cuts = [(samples, _resets(samples.t)) for samples in groups]
    many = mode([len(cut) for _, cut in cuts if len(cut)] or [0]) + 1
    check_piece(path, piece, many)
    if many == 1:
        return groups
    parts = [
        (samples, np.split(np.arange(len(samples.t)), cut) if len(cut) + 1 == many else [])
        for samples, cut in cuts
    ]
    seconds = np.max([[np.ptp(s.t[rows]) for rows in part] for s, part in parts if part], axis=0)
    chosen = seconds.argmax() if piece is None else piece - 1
    notes.append(
        f"the clock starts anew {many - 1} time(s): the file holds {many} pieces of "
        f"{', '.join(f'{x:.3g}' for x in seconds)} s; piece {chosen + 1} was read (default: the "
        "longest; --piece reads another)"
    )
    return [samples.cut(part[chosen]) if part else samples for samples, part in parts]


def check_piece(path: Path, piece: Piece, many: int) -> None:
    """Check the number of a piece.

    Raises:
        InputError: the file has no such piece.
    """
    if piece is not None and not 1 <= piece <= many:
        raise InputError(f"{path}: piece {piece}: it has {many}; expected 1 to {many}")


def _resets(t: Array) -> Rows:
    """Return the first sample of each piece but the first: where the clock goes back, and stays
    back.
    """
    resets = []
    for i in np.flatnonzero(np.diff(t) < -_RESET) + 1:
        before, after = t[max(i - 5, 0) : i], t[i : i + 5]
        # one stamp decides nothing
        if min(len(before), len(after)) > 2 and np.median(after) < np.median(before) - _RESET:
            resets.append(i)
    return np.array(resets, np.intp)


def in_order(t: Array) -> tuple[Rows, int]:
    """Return the rows of strictly increasing times (N,), and the number of rows written late.

    Most rows are right: the longest increasing sequence is kept. A row outside the sequence is put
    at its time, if a row is missing there. The others have a wrong or a repeated time.
    """
    increases = (np.diff(t) > 0.0).all()
    rows = np.arange(len(t)) if increases else _longest_increase(t)
    if len(rows) > 3:  # a first or a last one far off all others is left out
        steps = np.diff(t[rows])
        first, last = steps[[0, -1]] > max(100.0 * np.median(steps), _JITTER)
        rows = rows[int(first) : len(rows) - int(last)]
    if increases or len(rows) < 2:
        return rows, 0
    steps = np.diff(t[rows])
    late = np.setdiff1d(np.flatnonzero((t > t[rows[0]]) & (t < t[rows[-1]])), rows)
    late = late[np.unique(t[late], return_index=True)[1]]
    after = np.searchsorted(t[rows], t[late])
    # a late row fills a hole
    late = late[(steps[after - 1] > 1.5 * np.median(steps)) & (t[rows[after]] != t[late])]
    together = np.concatenate([rows, late])
    return together[t[together].argsort(kind="stable")], len(late)


def _longest_increase(t: Array) -> Rows:
    """Return the rows of the longest strictly increasing sequence of times (N,), by patience
    sorting; NaN is in none.
    """
    ends: list[float] = []  # the least last time of a sequence of each length
    at: list[int] = []  # and its row
    before = {}
    for i, x in enumerate(t.tolist()):
        k = bisect_left(ends, x)
        if isfinite(x) and ends[k : k + 1] != [x]:  # the first of two samples at one time
            before[i] = at[k - 1] if k else -1
            ends[k : k + 1], at[k : k + 1] = [x], [i]
    rows = at[-1:] or [-1]
    while rows[-1] >= 0:
        rows.append(before[rows[-1]])
    return np.array(rows[-2::-1], np.intp)


# A table's rows: their times, empty fields, and gaps of the motors.
LONGEST_STEPS = 3.5  # of a channel to interpolate: a slow one has longer gaps by nature
_FINITE = "a finite number"
_DENSE = 0.5  # share of the rows; a channel with more counts as one of every row


def rows_of(table: Table, columns: ArrayMap, log_map: LogMap, notes: Lines) -> ChannelGroup:
    """Return the map's columns, as written; ``notes`` get further ones.

    Raises:
        InputError: many times go back, times cannot be told apart, or are fewer than two. Of whole
            rows: one time goes back, or a row lacks a number.
    """
    clock, is_whole = log_map.time, log_map.rows == "whole"
    where, unit = f"{table.path}: column {clock.column}", clock.unit
    if repeated := [name for name, count in Counter(table.header).items() if count > 1]:
        notes.append(f"columns that stand there more than once were not used: {repeated[:10]}")
    rows = np.arange(table.rows)
    if not clock.column:
        t = rows / clock.rate_hz + (clock.offset or 0.0)
        notes.append(f"time: rows at {clock.rate_hz:g} Hz, as the map says")
        return ChannelGroup(t, columns, table=table, rows=rows)
    samples = ChannelGroup(clock.raw(columns), columns, table=table, rows=rows)
    if is_whole:
        _refuse(samples, clock.column, samples.t, ~np.isfinite(samples.t))
    samples = samples.cut(np.isfinite(samples.t))
    raw = samples.t
    if left := table.rows - len(raw):
        notes.append(f"{left} row(s) without a time were left out")
    if len(raw) < 2:
        raise InputError(f"{where}: {len(raw)} time(s); expected at least two")
    others = [x for name, x in samples.columns.items() if name not in clock.named]
    if (even := _even_times(raw, others)) is not None:
        rounded, raw = np.diff(np.unique(raw)).min(), even
        notes.append(
            f"column {clock.column}: rounded to {rounded:.3g} {unit}, with several rows a time; "
            "the rows were taken as even in time"
        )
    step = np.diff(raw)
    back = np.flatnonzero(step <= 0.0 if is_whole else step < 0.0)
    if back.size > (0.0 if is_whole else 0.2 * len(step)):  # more are no times
        i = back[0]
        raise InputError(
            f"{where}, {samples.place(i + 1)}: {raw[i + 1]:.9g} {unit} "
            f"{'goes back from' if step[i] else 'repeats the time'} {raw[i]:.9g} {unit} of the row "
            f"before; expected {'strictly ' if is_whole else ''}increasing times"
        )
    t = raw - raw[0] if clock.offset is None else raw
    t = t * UNITS["time"][unit] + (clock.offset or 0.0)
    if not np.isfinite(t).all() or ((np.diff(t) <= 0.0) & (step > 0.0)).any():
        raise InputError(
            f"{where}: times of {raw[0]:.6g} to {raw[-1]:.6g} {unit} cannot be told apart; "
            "expected those of one flight"
        )
    samples = replace(samples, t=t)
    if is_whole:
        _check_whole(samples, log_map)
        step = np.diff(t)
        gaps = np.flatnonzero(step[: log_map.stray_rows] > 5.0 * np.median(step)) + 1
        for stray in gaps[-1:]:
            notes.append(
                f"dropped {stray} stray sample(s) before a gap of {step[stray - 1]:.2g} s at the "
                "start"
            )
            samples = samples.cut(slice(stray, None))
        return samples
    begins = np.flatnonzero(np.diff(raw, prepend=nan) != 0.0)
    if len(begins) < len(t):
        notes.append(f"{len(t) - len(begins)} row(s) repeat a time and were joined to the one row")
        each = np.arange(len(t))
        joined = {  # the last value of each
            name: x[np.maximum.reduceat(np.where(np.isnan(x), -1, each), begins).clip(begins)]
            for name, x in samples.columns.items()
        }
        samples = replace(samples.cut(np.append(begins[1:], len(t)) - 1), columns=joined)
    return samples


def _even_times(raw: Array, others: Sequence[Array]) -> SomeArray:
    """Return even times (N,) of rows whose times (N,) were rounded; None: the rows are not even, a
    time repeats in fewer than a fifth of them, whole rows repeat, or none of the ``others`` (N,)
    has a value in every row, and so a time for each.
    """
    step = np.diff(raw)
    if not (step > 0.0).any() or (step < 0.0).any() or (step == 0.0).mean() < 0.2:
        return None
    moves = np.asarray(np.diff(others).any(axis=0))
    repeat = moves.any() and not moves[step == 0.0].any()
    if repeat or not np.isfinite(others).all(axis=1).any():
        return None
    rows = np.arange(len(raw))
    even = np.polynomial.Polynomial.fit(rows, raw, 1)(rows)
    return even if abs(raw - even).max() <= step[step > 0.0].min() else None


def _refuse(
    samples: ChannelGroup, name: str, column: Array, bad: Mask, expected: str = _FINITE
) -> None:
    """Raise InputError at the first ``bad`` (N,) value of a column (N,)."""
    if bad.any():
        i = int(bad.argmax())
        value = f"{column[i]:g}"
        words = {"nan": "empty or NaN", "inf": "infinite", "-inf": "infinite"}.get(value, value)
        assert samples.table is not None
        raise InputError(
            f"{samples.table.path}: column {name}, {samples.place(i)} is {words}; expected "
            f"{expected}"
        )


def _check_whole(samples: ChannelGroup, log_map: LogMap) -> None:
    """Raise InputError at a row with a part of a pose, or of a sensor's three values, or without
    another number. ``check_rows`` checks gaps of motors and of the voltage.
    """
    named = {section: part.named for section, part in log_map.sections.items()}
    pose, accelerometer, gyro, *whole = (
        named.get(section, [])
        for section in ("position", "accelerometer", "gyro", "wrench", "force", "torque")
    )
    pose += named.get("attitude", [])
    whole += [part.named for part in log_map.extra.values()]
    others = [name for names in whole for name in names if name not in pose]
    for names in (pose, accelerometer, gyro, others):
        columns = np.array([samples.columns[name] for name in names])
        there = (~np.isnan(columns)).any(axis=0) | (names is others)
        words = "" if names is others else f"; only {', '.join(names)} together may be empty"
        for name, column in zip(names, columns, strict=True):
            _refuse(samples, name, column, ~np.isfinite(column) & there, _FINITE + words)


def rows_apart(samples: ChannelGroup, log_map: LogMap) -> bool:
    """Return whether channels stand in rows of their own: another channel prefers the rows without
    a position (without a gyro's sample, in a log of no pose). After the loss of a pose, the others
    are in all rows alike.
    """
    there = {n: samples.there(part) for n, part in log_map.sections.items() if samples.has(part)}
    placed = there.pop("position", there.get("gyro", np.zeros(0, bool)))
    if not placed.any():
        return False
    turned = there.get("attitude", placed)
    if 0.0 < min(placed.mean(), turned.mean()) < _DENSE and (placed != turned).any():
        return True
    return any(
        x.sum() >= 10 and x[~placed].sum() > (1.0 - 0.5 * placed.mean()) * x.sum()
        for x in there.values()
    )


def check_rows(samples: ChannelGroup, log_map: LogMap) -> Lines:
    """Return notes on the gaps of motors, of a true wrench, and of whole rows' voltage.

    Args:
        samples: a table's columns.
        log_map: with one way to fill each section.

    Raises:
        InputError: a number is beyond any flight's, or a gap is long; the message names the row.
    """
    is_whole = log_map.rows == "whole"
    filled, slow = [], []
    for section in ("rotors", "commands", "battery", "force", "torque"):
        part = log_map.sections.get(section)
        if part is None or (section == "battery" and not is_whole):
            continue
        read = np.flatnonzero(np.isfinite(samples.values(part)).any(axis=1))
        inside = samples.cut(slice(read[0], read[-1] + 1)) if len(read) else samples
        low, high, words = -inf, inf, ""
        if section == "battery":
            low, words = 0.0, "a voltage of at least 0"
        elif section == "rotors" and log_map.is_own:
            low, words = 0.0, "a rotor speed (its direction is the vehicle's spin) of at least 0"
        elif is_whole and isinstance(part, Commands) and part.range and not part.clip:
            low, high = sorted(part.range)
            words = f"a motor command from {low:g} to {high:g}"
        for name, column in zip(part.columns, inside.values(part).T, strict=True):
            gap = _longest_gap(inside, name, column)
            _refuse(inside, name, column, (column < low) | (column > high), words)
            count = (~np.isnan(column)).sum()
            if count < _DENSE * len(column):
                slow.append(f"{name} {count} of {len(column)}")
            elif count < len(column):
                filled.append(f"{name} {len(column) - count} (over up to {gap:.3g} s)")
    listed = (
        ("missing values interpolated", filled),
        ("interpolated to the other rows, since they have values in", slow),
    )
    return [f"{what}: {', '.join(columns)}" for what, columns in listed if columns]


def _longest_gap(samples: ChannelGroup, name: str, column: Array) -> float:
    """Return the longest time step of a column's (N,) values, in s.

    Raises:
        InputError: one is infinite, or a gap is longer than 0.06 s and than 3.5 of the column's own
            steps.
    """
    _refuse(samples, name, column, np.isinf(column))
    read = np.flatnonzero(~np.isnan(column))
    if len(read) == len(column):
        return 0.0
    t = samples.t
    steps = np.diff(t[read])
    # s: the lag of a small vehicle's motors, with hardly a change of speed
    limit = max(0.06, LONGEST_STEPS * np.median(steps) if len(steps) else 0.0)
    gaps = np.diff(t[read], prepend=t[0], append=t[-1])
    at = gaps.argmax()
    is_long = not len(read) or gaps[at] > limit * (1.0 + 1e-9)
    words = (
        f"{_FINITE}: it has no value for {gaps[at]:.3g} s, and gaps of up to {limit:.3g} s are "
        "interpolated over"
    )
    # of each gap, the first row without a value
    bad = is_long & (np.arange(len(t)) == np.append(0, read + 1)[at])
    _refuse(samples, name, column, bad, words)
    return float(steps.max(initial=0.0))
