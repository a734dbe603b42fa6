"""Columns that were sampled together: their clock, and what they hold in the kit's units, axes and
order of rotors.

With W from the log's world and B from its body axes to this kit's, positions become W p, attitudes
W R B' and what a sensor measures B v.

The clock of a recording may not be one clock: a stamp is wrong, rows were written late, a counter
rolls over, or a vehicle was switched on twice. Each group of columns has its stamps in the order in
which they were written.
"""

import math
from bisect import bisect_left
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from ...runtime.errors import InputError
from .log_map import UNITS, Attitude, Battery, Columns, Commands, LogMap, Rotors, Sensor, constant
from .table import Array, Mask, Rows, Table, finite_rows

_HALF_TURN = np.diag([1.0, -1.0, -1.0])
# from the log's world, or its body axes, to the kit's
_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
WORLD_TURNS: dict[str, Array] = {"enu": np.eye(3), "ned": _HALF_TURN, "y_up": _Y_UP}
BODY_TURNS: dict[str, Array] = {"flu": np.eye(3), "frd": _HALF_TURN, "y_up": _Y_UP}


@dataclass(frozen=True, eq=False)
class Samples:
    """Columns that were sampled together: rows in the order of time."""

    t: Array  # (N,) s
    columns: Mapping[str, Array]  # by name (N,); NaN where there is no value
    topic: str = ""  # of the message in which they stood, where a log has several
    table: Table | None = None  # in which they stand
    rows: Rows | None = None  # (N,) of it

    def values(self, part: Columns) -> Array:
        """Return a section's columns (N, k), with their signs and scale; a constant such as ``=0``
        in every row.
        """
        values = np.empty((len(self.t), len(part.columns)))
        for i, name in enumerate(part.columns):
            fixed = constant(name)
            values[:, i] = self.columns[name] if fixed is None else fixed
        return scaled(part, values)

    def there(self, part: Columns) -> Mask:
        """Return in which rows (N,) a section has all of its values."""
        return finite_rows(self.values(part))

    def has(self, part: Columns) -> bool:
        """Return whether a section's columns are there."""
        return part.topic in ("", self.topic) and set(part.named) <= set(self.columns)

    def cut(self, keep: slice | Mask | Rows) -> "Samples":
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
        return self.table.row(int(self.rows[index]))


def scaled(part: Columns, values: Array) -> Array:
    """Return what columns (N, k) hold, with the section's signs and scale."""
    signs = np.array(part.signs, dtype=np.float64) if part.signs else 1.0
    return values * signs * part.scale


def in_kit_units(log_map: LogMap, section: str, part: Columns, values: Array) -> Array:
    """Return a section's scaled values (N, k), but no attitude's, in SI units, and in the kit's
    axes and order of rotors; commands as 0 to 1.
    """
    unit = UNITS.get(section, {}).get(part.unit, 1.0)
    if isinstance(part, Rotors):
        return values[:, [m - 1 for m in part.order]] * (unit / part.pole_pairs)
    if isinstance(part, Commands):
        assert part.range is not None
        low, high = part.range
        return (values[:, [m - 1 for m in part.order]] - low) / (high - low)
    if isinstance(part, Battery):
        return values * unit * part.cells
    if isinstance(part, Sensor):
        return values * unit @ BODY_TURNS[part.body or log_map.body].T
    return values if section == "wrench" else values * unit @ WORLD_TURNS[log_map.world].T


def quaternions(part: Attitude, values: Array) -> Array:
    """Return the quaternions (N, 4), scalar first, that an attitude's columns (N, k) stand for, in
    their own axes and of the length that they have.
    """
    if not part.euler:
        return values[:, [part.order.index(name) for name in "wxyz"]]
    order = ["xyz".index(axis) for axis in part.euler]
    turn = Rotation.from_euler(part.euler.upper(), values[:, order] * UNITS["attitude"][part.unit])
    return np.asarray(turn.as_quat(scalar_first=True))


def in_kit_axes(log_map: LogMap, part: Attitude, attitude: Array) -> Array:
    """Return quaternions (N, 4) of length 1 as turns from the kit's body axes to its world."""
    if part.sense == "world_to_body":
        attitude = attitude * np.array([1.0, -1.0, -1.0, -1.0])
    if log_map.world == "enu" and log_map.body == "flu":
        return attitude
    if log_map.world == "ned" and log_map.body == "frd":  # of any length, NaN included
        return np.asarray(attitude * np.array([1.0, 1.0, -1.0, -1.0]))
    matrix = Rotation.from_quat(attitude, scalar_first=True).as_matrix()
    turn = Rotation.from_matrix(WORLD_TURNS[log_map.world] @ matrix @ BODY_TURNS[log_map.body].T)
    return np.asarray(turn.as_quat(scalar_first=True))


@dataclass(frozen=True)
class ClockSettings:
    """What tells a clock from another."""

    rollover: float = 2.0**32 * 1e-6  # s, after which a counter of 32 bits of microseconds is zero
    jitter: float = 1.0  # s, by which the stamps at both ends of a rollover may be off it
    reset: float = 1.0  # s, by which a clock goes back that starts anew; late rows are late by less
    window: int = 5  # stamps, of which the median is compared before and after: one is no clock
    hole: float = 1.5  # median steps: a row that was written late fills a hole at least that wide
    alone: float = 100.0  # median steps, and the seconds of ``jitter``, off all others: a first or
    # a last stamp that no other one confirms


CLOCK = ClockSettings()


def on_one_clock(
    path: Path, recorded: Sequence[Samples], piece: int | None = None
) -> tuple[list[Samples], list[str]]:
    """Return groups of columns with times that increase strictly, and notes.

    Args:
        path: the file, for errors.
        recorded: the groups, in the order of their writing.
        piece: which part of the file is read, from 1, where its clock started anew; default: the
            longest.

    Raises:
        InputError: there is no such piece.
    """
    groups: list[Samples] = []
    notes: list[str] = []
    for samples in recorded:
        over = np.cumsum(np.abs(np.diff(samples.t, prepend=np.nan) + CLOCK.rollover) < CLOCK.jitter)
        groups.append(replace(samples, t=samples.t + CLOCK.rollover * over))
        if over.any():
            notes.append("the clock of 32 bits rolled over in the log; later times go on behind it")
    groups, said = _of_piece(path, groups, piece)
    notes += said
    out = []
    for samples in groups:
        rows, late = in_order(samples.t)
        name = samples.topic or next(iter(samples.columns), "rows")
        if late:
            notes.append(f"{name}: {late} of {len(samples.t)} rows were written late and sorted in")
        if left := len(samples.t) - len(rows):
            notes.append(
                f"{name}: {left} of {len(samples.t)} samples repeat a time or have one that the "
                "samples around them contradict, and were left out"
            )
        out.append(samples if left == 0 and late == 0 else samples.cut(rows))
    return out, list(dict.fromkeys(notes))


def _of_piece(
    path: Path, groups: list[Samples], piece: int | None
) -> tuple[list[Samples], list[str]]:
    """Return the part of each group that belongs to one piece, and a note on how many there are.

    A group that has other pieces than most, since it was not written in each of them, is left whole
    but for what goes back in time.
    """
    cuts = [_resets(samples.t) for samples in groups]
    counts = Counter(len(cut) + 1 for cut in cuts if len(cut))
    many = counts.most_common(1)[0][0] if counts else 1
    check_piece(path, piece, many)
    if many == 1:
        return groups, []
    parts = [
        np.split(np.arange(len(samples.t)), cut) if len(cut) + 1 == many else None
        for samples, cut in zip(groups, cuts, strict=True)
    ]
    both = list(zip(groups, parts, strict=True))
    seconds = [
        max(float(np.ptp(samples.t[part[i]])) for samples, part in both if part is not None)
        for i in range(many)
    ]
    chosen = int(np.argmax(seconds)) if piece is None else piece - 1
    lengths = ", ".join(f"{x:.3g}" for x in seconds)
    why, how = ("the longest, ", "; --piece reads another") if piece is None else ("", "")
    note = (
        f"the clock starts anew {many - 1} time(s): the file holds {many} pieces of {lengths} s; "
        f"{why}piece {chosen + 1}, was read{how}"
    )
    return [s if part is None else s.cut(part[chosen]) for s, part in both], [note]


def check_piece(path: Path, piece: int | None, many: int) -> None:
    """Check that a file has a piece.

    Raises:
        InputError: it does not.
    """
    if piece is not None and not 1 <= piece <= many:
        raise InputError(f"{path}: piece {piece}: it has {many}; expected 1 to {many}")


def _resets(t: Array) -> Rows:
    """Return the first sample of each piece but the first: where the clock goes back, and stays
    back.
    """
    found: list[int] = []
    for i in np.flatnonzero(np.diff(t) < -CLOCK.reset) + 1:
        before, after = t[max(i - CLOCK.window, 0) : i], t[i : i + CLOCK.window]
        enough = min(len(before), len(after)) >= min(CLOCK.window, 3)
        if enough and float(np.median(after)) < float(np.median(before)) - CLOCK.reset:
            found.append(int(i))
    return np.array(found, dtype=np.intp)


def in_order(t: Array) -> tuple[Rows, int]:
    """Return the rows that make times (N,) increase strictly, and how many of them were written
    late.

    Most rows are right: the longest sequence that increases is kept. A row outside it is put where
    its time is, if a row is missing there. All others have a wrong time, or one that was there.
    """
    increases = len(t) < 2 or bool(np.all(np.diff(t) > 0.0))
    rows: Rows = np.arange(len(t)) if increases else _longest_increase(t)
    if len(rows) > 3:  # a first or a last one far off all others is left out
        steps = np.diff(t[rows])
        far = max(CLOCK.alone * float(np.median(steps)), CLOCK.jitter)
        rows = rows[int(steps[0] > far) : len(rows) - int(steps[-1] > far)]
    if increases:
        return rows, 0
    others: Mask = np.ones(len(t), dtype=np.bool_)
    others[rows] = False
    steps = np.diff(t[rows])
    if not len(steps):
        return rows, 0
    hole = CLOCK.hole * float(np.median(steps))
    late = np.flatnonzero(others & (t > t[rows[0]]) & (t < t[rows[-1]]))
    late = late[np.unique(t[late], return_index=True)[1]]
    after = np.searchsorted(t[rows], t[late])
    late = late[(steps[after - 1] > hole) & (t[rows[after]] != t[late])]
    together = np.concatenate([rows, late])
    return together[np.argsort(t[together], kind="stable")], len(late)


def _longest_increase(t: Array) -> Rows:
    """Return the rows of the longest sequence of times (N,) that increases strictly (patience
    sorting; NaN is in none).
    """
    ends: list[float] = []  # the least last time of a sequence of each length
    at: list[int] = []  # and its row
    before: dict[int, int] = {}
    for i, x in enumerate(t.tolist()):
        k = bisect_left(ends, x)
        if math.isfinite(x) and ends[k : k + 1] != [x]:  # of two samples at one time the first
            before[i] = at[k - 1] if k else -1
            ends[k : k + 1], at[k : k + 1] = [x], [i]
    rows = at[-1:] or [-1]
    while rows[-1] >= 0:
        rows.append(before[rows[-1]])
    return np.array(rows[-2::-1], dtype=np.intp)
