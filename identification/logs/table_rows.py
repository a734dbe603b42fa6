"""The rows of a table by a map: their times, what of a row may be empty, and gaps of the motors.

A channel that is slower than its table, or that was lost, is interpolated over short gaps; nobody
knows what happened in a long one.
"""

from collections import Counter
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ...runtime.errors import InputError
from .channels import Array, Samples, quaternions
from .flight_log import check_finite, check_quaternions, check_times
from .log_map import TIME_UNITS, Columns, LogMap
from .map_fit import NO_QUATERNION
from .table import Table

Rows = NDArray[np.intp]

_STRAY_GAP = 5.0  # median time steps; shorter gaps leave no stray rows
# s that are interpolated over: the lag of a small vehicle's motors, over which their speed hardly
# changes; and steps of the channel's own, since a slow one has longer gaps by nature
_LONGEST_GAP = 0.06
LONGEST_STEPS = 3.5
_DENSE = 0.5  # share of the rows from which on a channel counts as one of every row


def rows_of(
    table: Table, columns: Mapping[str, Array], log_map: LogMap
) -> tuple[Samples, Rows, list[str]]:
    """Return what the map's columns hold, in the order of time; the table's rows (N,) in which that
    stands; and notes.

    Raises:
        InputError: times go back, cannot be told apart, or are fewer than two; or, of whole rows, a
            row lacks a number.
    """
    clock = log_map.time
    notes = []
    repeated = [name for name, count in Counter(table.header).items() if count > 1]
    if repeated:
        notes.append(f"columns that stand there more than once were not used: {repeated[:10]}")
    rows: Rows = np.arange(table.rows)
    if not clock.column:
        t = rows / clock.rate_hz + (clock.offset or 0.0)
        notes.append(f"time: rows at {clock.rate_hz:g} Hz, as the map says")
        return Samples(t, columns), rows, notes
    raw = columns[clock.column]
    if log_map.rows == "whole":
        check_finite(table, clock.column, raw)
        check_times(table, raw)
        samples = Samples(raw * TIME_UNITS[clock.unit], columns)
        _check_whole(table, columns, log_map)
        stray, words = _stray_rows(table, samples.t, log_map.stray_rows)
        return samples.cut(slice(stray, None)), rows[stray:], words
    rows = np.flatnonzero(np.isfinite(raw))
    if len(rows) < len(raw):
        notes.append(f"{len(raw) - len(rows)} row(s) without a time were left out")
    if len(rows) < 2:
        raise InputError(
            f"{table.path}: column {clock.column}: {len(rows)} time(s); expected at least two"
        )
    raw = raw[rows]
    early = raw < np.maximum.accumulate(raw)
    if log_map.rows == "streams" and early.any():
        notes.append(f"{int(early.sum())} row(s) go back in time and were left out")
        raw, rows = raw[~early], rows[~early]
    begin = raw[0] if clock.offset is None else 0.0
    t = (raw - begin) * TIME_UNITS[clock.unit] + (clock.offset or 0.0)
    back = np.flatnonzero(np.diff(raw) < 0.0)
    if back.size:
        i = int(back[0])
        raise InputError(
            f"{table.path}: column {clock.column}, {table.row(int(rows[i + 1]))}: {raw[i + 1]:.9g} "
            f"goes back from {raw[i]:.9g} of the row before; expected increasing times"
        )
    if not np.all(np.isfinite(t)) or np.any((np.diff(t) <= 0.0) & (np.diff(raw) > 0.0)):
        raise InputError(
            f"{table.path}: column {clock.column}: times of {raw[0]:.6g} to {raw[-1]:.6g} "
            f"{clock.unit} cannot be told apart; expected those of one flight"
        )
    found = {name: column[rows] for name, column in columns.items()}
    first = np.flatnonzero(np.diff(raw, prepend=np.nan) != 0.0)
    if len(first) < len(t):
        notes.append(f"{len(t) - len(first)} row(s) repeat a time and were joined to the one row")
        found = {name: _last_of(column, first) for name, column in found.items()}
        t, rows = t[first], rows[np.append(first[1:], len(t)) - 1]
    return Samples(t, found), rows, notes


def _check_whole(table: Table, columns: Mapping[str, Array], log_map: LogMap) -> None:
    """Raise InputError where a row has a part of a pose, or of a sensor's three values, or lacks
    another number; ``check_rows`` looks at gaps of motors and of the voltage.
    """
    pose: list[Columns] = [p for p in (log_map.position, log_map.attitude) if p is not None]
    groups = [(pose, "only all {} pose columns together may be empty (pose lost)")]
    groups += [
        ([part], "only {} together may be empty (not measured)")
        for part in (log_map.accelerometer, log_map.gyro)
        if part is not None
    ]
    for parts, words in groups:
        names = [name for part in parts for name in part.named]
        if not names:
            continue
        count = {7: "seven", 6: "six", 3: "three"}.get(len(names), str(len(names)))
        text = words.format(count if parts is pose else ", ".join(names))
        there = ~np.all(np.isnan([columns[name] for name in names]), axis=0)
        for name in names:
            check_finite(table, name, columns[name], there, text)
    others = (log_map.wrench, log_map.force, log_map.torque, *log_map.extra.values())
    for name in [name for part in others if part is not None for name in part.named]:
        if not any(name in part.named for part in pose):
            check_finite(table, name, columns[name])


def _stray_rows(table: Table, t: Array, most: int) -> tuple[int, list[str]]:
    """Return the first row behind a gap that follows the first few, and a note where some are to be
    dropped.
    """
    step = np.diff(t)
    gaps = np.flatnonzero(step[:most] > _STRAY_GAP * np.median(step))
    if not gaps.size:
        return 0, []
    first = int(gaps[-1]) + 1
    if len(t) - first < 2:
        raise InputError(
            f"{table.path}: only one row after the gap behind the first sample(s); expected at "
            "least two"
        )
    return first, [
        f"dropped {first} stray sample(s) before a gap of {step[first - 1]:.2g} s at the start"
    ]


def _last_of(column: Array, first: Rows) -> Array:
    """Return the last value that is there of each group of rows, which begin at ``first``."""
    at = np.where(np.isnan(column), -1, np.arange(len(column)))
    last = np.maximum.reduceat(at, first)
    return np.where(last >= 0, column[last], np.nan)


def has_several_rates(columns: Mapping[str, Array], log_map: LogMap) -> bool:
    """Return whether positions or attitudes are slower than the table, and not in the same rows:
    where a pose is lost, both are.
    """
    if log_map.position is None or log_map.attitude is None:
        return False
    placed, turned = (
        np.isfinite([columns[name] for name in part.named]).all(axis=0)
        for part in (log_map.position, log_map.attitude)
    )
    share = min(placed.mean(), turned.mean())
    return bool(0.0 < share < _DENSE and np.any(placed != turned))


def check_rows(table: Table, samples: Samples, rows: Rows, log_map: LogMap) -> tuple[str, ...]:
    """Return notes on the gaps of motors, of a true wrench, and of whole rows' voltage.

    Args:
        table: for errors.
        samples: of its rows.
        rows: (N,) of the table in which they stand.
        log_map: with one way to fill each section.

    Raises:
        InputError: a number is none that a flight has, or a gap is long; the message names the row.
    """
    whole, turn = log_map.rows == "whole", log_map.attitude
    if turn is not None and not turn.euler:
        found = quaternions(turn, samples.values(turn))
        there = np.isfinite(found).all(axis=1)
        with np.errstate(over="ignore", invalid="ignore"):
            there &= np.linalg.norm(found, axis=1) > (-1.0 if whole else NO_QUATERNION)
        check_quaternions(table, found, there, ", ".join(turn.columns), rows)
    parts: list[Columns | None] = [log_map.rotors, log_map.commands]
    parts += [log_map.battery if whole else None, log_map.force, log_map.torque]
    filled, slow = [], []
    for part in parts:
        if part is None:
            continue
        values = samples.values(part)
        read = np.flatnonzero(np.isfinite(values).any(axis=1))
        span = slice(read[0], read[-1] + 1) if len(read) else slice(0, None)
        for name, column in zip(part.columns, values[span].T, strict=True):
            gap = _check_gaps(table, name, samples.t[span], column, rows[span])
            count = int(np.sum(~np.isnan(column)))
            if count < _DENSE * len(column):
                slow.append(f"{name} {count} of {len(column)}")
            elif count < len(column):
                filled.append(f"{name} {len(column) - count} (over up to {gap:.3g} s)")
    if whole and log_map.battery is not None:
        _check_range(table, samples, rows, log_map.battery, 0.0, np.inf, "a voltage of at least 0")
    if log_map.is_own and log_map.rotors is not None:
        words = "a rotor speed (its direction is the vehicle's spin) of at least 0"
        _check_range(table, samples, rows, log_map.rotors, 0.0, np.inf, words)
    commands = log_map.commands
    if whole and commands is not None and commands.range is not None and not commands.clip:
        low, high = commands.range
        words = f"a motor command from {low:g} to {high:g}"
        _check_range(table, samples, rows, commands, min(low, high), max(low, high), words)
    notes = ["missing values interpolated: " + ", ".join(filled)] if filled else []
    if slow:
        notes.append(
            "interpolated to the other rows, since they have values in: " + ", ".join(slow)
        )
    return tuple(notes)


def _check_gaps(table: Table, name: str, t: Array, column: Array, rows: Rows) -> float:
    """Return the longest time step of a column's (N,) values, in s.

    Raises:
        InputError: one is infinite, or a gap is longer than 0.06 s and than 3.5 of the column's own
            steps.
    """
    infinite = np.flatnonzero(np.isinf(column))
    if infinite.size:
        raise InputError(
            f"{table.path}: column {name}, {table.row(int(rows[infinite[0]]))} is infinite; "
            "expected a finite number"
        )
    read = np.flatnonzero(~np.isnan(column))
    if len(read) == len(column):
        return 0.0
    steps = np.diff(t[read])
    limit = max(_LONGEST_GAP, LONGEST_STEPS * float(np.median(steps)) if len(steps) else 0.0)
    edges = np.concatenate([[t[0]], t[read], [t[-1]]])
    at = int(np.argmax(np.diff(edges)))
    gap = float(edges[at + 1] - edges[at])
    if len(read) and gap <= limit * (1.0 + 1e-9):
        return float(steps.max(initial=0.0))
    first = int(read[at - 1]) + 1 if at and len(read) else 0
    raise InputError(
        f"{table.path}: column {name}, {table.row(int(rows[first]))} is empty or NaN; expected a "
        f"finite number: it has no value for {gap:.3g} s, and gaps of up to {limit:.3g} s are "
        "interpolated over"
    )


def _check_range(
    table: Table,
    samples: Samples,
    rows: Rows,
    part: Columns,
    low: float,
    high: float,
    expected: str,
) -> None:
    """Raise InputError at the first value of a section that is below ``low`` or above ``high``."""
    for name, column in zip(part.columns, samples.values(part).T, strict=True):
        outside = np.flatnonzero((column < low) | (column > high))
        if outside.size:
            found = f"{column[outside[0]]:g}{' is negative' if not np.isfinite(high) else ''}"
            raise InputError(
                f"{table.path}: column {name}, {table.row(int(rows[outside[0]]))}: {found}; "
                f"expected {expected}"
            )
