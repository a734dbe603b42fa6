"""Groups of columns with one clock each, in the kit's units, axes and order of rotors.

With W from the log's world and B from its body axes to this kit's, positions become W p, attitudes
W R B' and a sensor's vectors B v.

The clock of a recording may not be one clock: a stamp is wrong, rows were written late, a counter
rolls over, or a vehicle was switched on twice. Each group keeps its stamps in the order of writing.
"""

import math
from bisect import bisect_left
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from ...runtime.errors import InputError
from .log_map import UNITS, Attitude, Battery, Columns, Commands, LogMap, Rotors, Sensor, constant
from .table import Array, ArrayMap, Mask, NamedArrays, Rows, Table, finite_rows

_HALF_TURN = np.diag([1.0, -1.0, -1.0])
# from the log's world, or its body axes, to the kit's
_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
WORLD_TURNS: NamedArrays = {"enu": np.eye(3), "ned": _HALF_TURN, "y_up": _Y_UP}
BODY_TURNS: NamedArrays = {"flu": np.eye(3), "frd": _HALF_TURN, "y_up": _Y_UP}


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
            fixed = constant(name)
            values[:, i] = self.columns[name] if fixed is None else fixed
        return scaled(part, values)

    def there(self, part: Columns) -> Mask:
        """Return the rows (N,) with all values of a section."""
        return finite_rows(self.values(part))

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
        return self.table.row(int(self.rows[index]))


def scaled(part: Columns, values: Array) -> Array:
    """Return columns (N, k), with the section's signs and scale."""
    return np.asarray(values * np.array(part.signs or (1,)) * part.scale)


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
        return values * unit @ BODY_TURNS[part.body or log_map.body].T
    return values if section == "wrench" else values * unit @ WORLD_TURNS[log_map.world].T


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
        attitude = attitude * np.array([1.0, -1.0, -1.0, -1.0])
    if log_map.world == "enu" and log_map.body == "flu":
        return attitude
    if log_map.world == "ned" and log_map.body == "frd":  # quaternions of any length, NaN included
        return np.asarray(attitude * np.array([1.0, 1.0, -1.0, -1.0]))
    matrix = Rotation.from_quat(attitude, scalar_first=True).as_matrix()
    turn = Rotation.from_matrix(WORLD_TURNS[log_map.world] @ matrix @ BODY_TURNS[log_map.body].T)
    return np.asarray(turn.as_quat(scalar_first=True))


# When a clock is rolled over, reset or late.
ROLLOVER = 2.0**32 * 1e-6  # s, of a counter of 32 bits of microseconds
_JITTER = 1.0  # s, of the stamps at both ends of a rollover
_RESET = 1.0  # s, the least step back of a restart; late rows are late by less
_WINDOW = 5  # stamps, whose median is compared; one decides nothing
_HOLE = 1.5  # median steps: the least hole that a late row fills
_ALONE = 100.0  # median steps, and at least ``jitter``: a lone first or last stamp
# this far off all others is wrong


def on_one_clock(
    path: Path, recorded: Sequence[ChannelGroup], piece: int | None = None
) -> tuple[list[ChannelGroup], list[str]]:
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
        over = np.cumsum(np.abs(np.diff(samples.t, prepend=np.nan) + ROLLOVER) < _JITTER)
        groups.append(replace(samples, t=samples.t + ROLLOVER * over))
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
    path: Path, groups: list[ChannelGroup], piece: int | None
) -> tuple[list[ChannelGroup], list[str]]:
    """Return each group's rows of one piece, and a note on the number of pieces.

    A group with another number of pieces was not written in each of them. Such a group stays whole,
    without rows of earlier times.
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
        max(np.ptp(samples.t[part[i]]) for samples, part in both if part is not None)
        for i in range(many)
    ]
    chosen = np.argmax(seconds) if piece is None else piece - 1
    lengths = ", ".join(f"{x:.3g}" for x in seconds)
    why, how = ("the longest, ", "; --piece reads another") if piece is None else ("", "")
    note = (
        f"the clock starts anew {many - 1} time(s): the file holds {many} pieces of {lengths} s; "
        f"{why}piece {chosen + 1}, was read{how}"
    )
    return [s if part is None else s.cut(part[chosen]) for s, part in both], [note]


def check_piece(path: Path, piece: int | None, many: int) -> None:
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
        before, after = t[max(i - _WINDOW, 0) : i], t[i : i + _WINDOW]
        enough = min(len(before), len(after)) >= min(_WINDOW, 3)
        if enough and np.median(after) < np.median(before) - _RESET:
            resets.append(int(i))
    return np.array(resets, dtype=np.intp)


def in_order(t: Array) -> tuple[Rows, int]:
    """Return the rows of strictly increasing times (N,), and the number of rows written late.

    Most rows are right: the longest increasing sequence is kept. A row outside the sequence is put
    at its time, if a row is missing there. The others have a wrong or a repeated time.
    """
    increases = len(t) < 2 or bool(np.all(np.diff(t) > 0.0))
    rows = np.arange(len(t)) if increases else _longest_increase(t)
    if len(rows) > 3:  # a first or a last one far off all others is left out
        steps = np.diff(t[rows])
        far = max(_ALONE * np.median(steps), _JITTER)
        rows = rows[int(steps[0] > far) : len(rows) - int(steps[-1] > far)]
    if increases:
        return rows, 0
    others = np.ones(len(t), dtype=bool)
    others[rows] = False
    steps = np.diff(t[rows])
    if not len(steps):
        return rows, 0
    hole = _HOLE * np.median(steps)
    late = np.flatnonzero(others & (t > t[rows[0]]) & (t < t[rows[-1]]))
    late = late[np.unique(t[late], return_index=True)[1]]
    after = np.searchsorted(t[rows], t[late])
    late = late[(steps[after - 1] > hole) & (t[rows[after]] != t[late])]
    together = np.concatenate([rows, late])
    return together[np.argsort(t[together], kind="stable")], len(late)


def _longest_increase(t: Array) -> Rows:
    """Return the rows of the longest strictly increasing sequence of times (N,), by patience
    sorting; NaN is in none.
    """
    ends: list[float] = []  # the least last time of a sequence of each length
    at: list[int] = []  # and its row
    before = {}
    for i, x in enumerate(t.tolist()):
        k = bisect_left(ends, x)
        if math.isfinite(x) and ends[k : k + 1] != [x]:  # the first of two samples at one time
            before[i] = at[k - 1] if k else -1
            ends[k : k + 1], at[k : k + 1] = [x], [i]
    rows = at[-1:] or [-1]
    while rows[-1] >= 0:
        rows.append(before[rows[-1]])
    return np.array(rows[-2::-1], dtype=np.intp)
