"""The times of a recording whose clock is not one clock: a stamp that is wrong, rows that were
written late, a counter that rolls over, and a vehicle that was switched on twice.

Each group of columns has its stamps in the order in which they were written.
"""

import math
from bisect import bisect_left
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...runtime.errors import InputError
from .channels import Samples
from .table import Array, Mask, Rows


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
    groups = []
    for samples in recorded:
        over = np.cumsum(np.abs(np.diff(samples.t, prepend=np.nan) + CLOCK.rollover) < CLOCK.jitter)
        is_over = len(over) > 0 and over[-1] > 0
        groups.append(replace(samples, t=samples.t + CLOCK.rollover * over) if is_over else samples)
    notes: list[str] = []
    if any(samples is not s for samples, s in zip(recorded, groups, strict=True)):
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
