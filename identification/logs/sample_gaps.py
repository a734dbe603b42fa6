"""Values that a table lacks in some of its rows: of a channel that is slower than the table, or one
that was lost. They are interpolated over short gaps; what lies behind a long one nobody knows.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...runtime.errors import InputError
from .table import Table

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GapSettings:
    """Which gaps are interpolated over."""

    # s: the lag of a small vehicle's motors, over which their speed hardly changes
    longest: float = 0.06
    steps: float = 3.5  # of the channel's own: one that is slow has longer gaps by nature
    dense: float = 0.5  # share of the rows from which on a channel counts as one of every row


GAPS = GapSettings()


def bridged(
    table: Table, t: Array, columns: dict[str, Array], where: NDArray[np.intp] | None = None
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Return columns without gaps, linear between their samples, and notes that count them.

    Args:
        table: they come from, for errors.
        t: times (N,) in s, increasing.
        columns: by name (N,); NaN where there is no value.
        where: rows (N,) of the table that they stand in; None: all in their order.

    Raises:
        InputError: a value is infinite, or a gap longer than 0.06 s and than 3.5 of the channel's
            own steps; the message names the line.
    """
    out, filled, slow = {}, [], []
    for name, column in columns.items():
        read = np.flatnonzero(~np.isnan(column))
        if np.isinf(column[read]).any():
            i = read[np.flatnonzero(np.isinf(column[read]))[0]]
            raise InputError(
                f"{table.path}: column {name}, {_row(table, where, i)} is infinite; expected a "
                "finite number"
            )
        if len(read) == len(column):
            out[name] = column
            continue
        limit = GAPS.longest
        if len(read) > 1:
            limit = max(limit, GAPS.steps * float(np.median(np.diff(t[read]))))
        _check_gaps(table, t, name, read, limit, where)
        out[name] = np.interp(t, t[read], column[read])
        missing = len(column) - len(read)
        if len(read) >= GAPS.dense * len(column):
            longest = float(np.max(np.diff(t[read]), initial=0.0))
            filled.append(f"{name} {missing} (over up to {longest:.3g} s)")
        else:
            slow.append(f"{name} {len(read)} of {len(column)}")
    notes = []
    if filled:
        notes.append("missing values interpolated: " + ", ".join(filled))
    if slow:
        notes.append(
            "interpolated to the other rows, since they have values in: " + ", ".join(slow)
        )
    return out, tuple(notes)


def _check_gaps(
    table: Table,
    t: Array,
    name: str,
    read: NDArray[np.intp],
    limit: float,
    where: NDArray[np.intp] | None,
) -> None:
    if len(read):
        edges = np.concatenate([[t[0]], t[read], [t[-1]]])
        at = int(np.argmax(np.diff(edges)))
        gap = float(edges[at + 1] - edges[at])
        if gap <= limit * (1.0 + 1e-9):
            return
        first = int(read[at - 1]) + 1 if at else 0
    else:
        first, gap = 0, float(t[-1] - t[0])
    raise InputError(
        f"{table.path}: column {name}, {_row(table, where, first)} is empty or NaN; expected a "
        f"finite number: it has no value for {gap:.3g} s, and gaps of up to {limit:.3g} s are "
        "interpolated over"
    )


def _row(table: Table, where: NDArray[np.intp] | None, index: int) -> str:
    return table.row(index if where is None else int(where[index]))
