"""The rows of a table by a map: their times, empty fields, and gaps of the motors.

A lost channel, or one slower than its table, is interpolated over short gaps; a long gap hides too
much.
"""

from collections import Counter
from dataclasses import replace

import numpy as np

from ...runtime.errors import InputError
from .channels import ChannelGroup
from .log_map import UNITS, Columns, LogMap
from .table import Array, ArrayMap, Mask, Table

_STRAY_GAP = 5.0  # median time steps; shorter gaps leave no stray rows
# s to interpolate: the lag of a small vehicle's motors, with hardly a change of speed. And steps of
# the channel's own: a slow channel has longer gaps by nature
_LONGEST_GAP = 0.06
LONGEST_STEPS = 3.5
_FINITE = "a finite number"
_BACK = 0.2  # share of steps back; more are no times
_ROUNDED = 0.2  # share of repeated times: more were rounded
_DENSE = 0.5  # share of the rows; a channel with more counts as one of every row
_FEWEST = 10  # samples of a channel to decide on its rows


def rows_of(table: Table, columns: ArrayMap, log_map: LogMap) -> tuple[ChannelGroup, list[str]]:
    """Return the map's columns, as written, and notes.

    Raises:
        InputError: many times go back, times cannot be told apart, or are fewer than two. Of whole
            rows: one time goes back, or a row lacks a number.
    """
    clock, is_whole = log_map.time, log_map.rows == "whole"
    notes = []
    repeated = [name for name, count in Counter(table.header).items() if count > 1]
    if repeated:
        notes.append(f"columns that stand there more than once were not used: {repeated[:10]}")
    rows = np.arange(table.rows)
    if not clock.column:
        t = rows / clock.rate_hz + (clock.offset or 0.0)
        notes.append(f"time: rows at {clock.rate_hz:g} Hz, as the map says")
        return ChannelGroup(t, columns, table=table, rows=rows), notes
    samples = ChannelGroup(clock.raw(columns), columns, table=table, rows=rows)
    if is_whole:
        _refuse(samples, clock.column, samples.t, ~np.isfinite(samples.t))
    samples = samples.cut(np.isfinite(samples.t))
    if len(samples.t) < len(rows):
        notes.append(f"{len(rows) - len(samples.t)} row(s) without a time were left out")
    if len(samples.t) < 2:
        raise InputError(
            f"{table.path}: column {clock.column}: {len(samples.t)} time(s); expected at least two"
        )
    raw = samples.t
    others = [x for name, x in samples.columns.items() if name not in clock.named]
    # a channel with a value in every row has one time for each value
    if any(np.isfinite(x).all() for x in others) and (even := _even_times(raw)) is not None:
        rounded, raw = np.min(np.diff(np.unique(raw))), even
        samples = replace(samples, t=raw)
        notes.append(
            f"column {clock.column}: rounded to {rounded:.3g} {clock.unit}, with several rows a "
            "time; the rows were taken as even in time"
        )
    step = np.diff(raw)
    back = np.flatnonzero(step <= 0.0 if is_whole else step < 0.0)
    if back.size and (is_whole or back.size > _BACK * len(step)):
        i, unit = int(back[0]), clock.unit
        raise InputError(
            f"{table.path}: column {clock.column}, {samples.place(i + 1)}: {raw[i + 1]:.9g} {unit} "
            f"{'goes back from' if step[i] else 'repeats the time'} {raw[i]:.9g} {unit} of the row "
            f"before; expected {'strictly ' if is_whole else ''}increasing times"
        )
    begin = raw[0] if clock.offset is None else 0.0
    t = (raw - begin) * UNITS["time"][clock.unit] + (clock.offset or 0.0)
    if not np.all(np.isfinite(t)) or np.any((np.diff(t) <= 0.0) & (step > 0.0)):
        raise InputError(
            f"{table.path}: column {clock.column}: times of {raw[0]:.6g} to {raw[-1]:.6g} "
            f"{clock.unit} cannot be told apart; expected those of one flight"
        )
    samples = replace(samples, t=t)
    if is_whole:
        _check_whole(samples, log_map)
        step = np.diff(t)
        gaps = np.flatnonzero(step[: log_map.stray_rows] > _STRAY_GAP * np.median(step))
        if gaps.size:
            first, gap = int(gaps[-1]) + 1, step[gaps[-1]]
            notes.append(
                f"dropped {first} stray sample(s) before a gap of {gap:.2g} s at the start"
            )
            samples = samples.cut(slice(first, None))
        return samples, notes
    begins = np.flatnonzero(np.diff(raw, prepend=np.nan) != 0.0)
    if len(begins) < len(t):
        notes.append(f"{len(t) - len(begins)} row(s) repeat a time and were joined to the one row")
        joined = {}
        for name, column in samples.columns.items():  # the last value of each
            there = np.where(np.isnan(column), -1, np.arange(len(t)))
            last = np.maximum.reduceat(there, begins)
            joined[name] = np.where(last >= 0, column[last], np.nan)
        samples = replace(samples.cut(np.append(begins[1:], len(t)) - 1), columns=joined)
    return samples, notes


def _even_times(raw: Array) -> Array | None:
    """Return even times (N,) of rows whose times (N,) were rounded; None: the rows are not even, or
    a time repeats in fewer than a fifth of them.
    """
    step = np.diff(raw)
    if not np.any(step > 0.0) or np.any(step < 0.0) or np.mean(step == 0.0) < _ROUNDED:
        return None
    rows = np.arange(len(raw))
    even = np.polynomial.Polynomial.fit(rows, raw, 1)(rows)
    return even if np.max(np.abs(raw - even)) <= np.min(step[step > 0.0]) else None


def _refuse(
    samples: ChannelGroup, name: str, column: Array, bad: Mask, expected: str = _FINITE
) -> None:
    """Raise InputError at the first ``bad`` (N,) value of a column (N,)."""
    if bad.any():
        i = int(np.argmax(bad))
        value = f"{column[i]:g}"
        words = {"nan": "empty or NaN", "inf": "infinite", "-inf": "infinite"}.get(value, value)
        assert samples.table is not None
        where = f"{samples.table.path}: column {name}, {samples.place(i)}"
        raise InputError(f"{where} is {words}; expected {expected}")


def _check_whole(samples: ChannelGroup, log_map: LogMap) -> None:
    """Raise InputError at a row with a part of a pose, or of a sensor's three values, or without
    another number. ``check_rows`` checks gaps of motors and of the voltage.
    """

    def names_of(*parts: Columns | None) -> list[str]:
        return [name for part in parts if part is not None for name in part.named]

    def check(names: list[str], there: Mask | bool, expected: str) -> None:
        for name in names:
            column = samples.columns[name]
            _refuse(samples, name, column, ~np.isfinite(column) & there, expected)

    pose = names_of(log_map.position, log_map.attitude)
    for names in (pose, names_of(log_map.accelerometer), names_of(log_map.gyro)):
        there = np.any([~np.isnan(samples.columns[name]) for name in names], axis=0)
        check(names, there, f"{_FINITE}; only {', '.join(names)} together may be empty")
    others = names_of(log_map.wrench, log_map.force, log_map.torque, *log_map.extra.values())
    check([name for name in others if name not in pose], True, _FINITE)


def rows_apart(samples: ChannelGroup, log_map: LogMap) -> bool:
    """Return whether channels stand in rows of their own: another channel prefers the rows without
    a position (without a gyro's sample, in a log of no pose). After the loss of a pose, the others
    are in all rows alike.
    """
    there = {n: samples.there(part) for n, part in log_map.sections.items() if samples.has(part)}
    base = next((name for name in ("position", "gyro") if name in there), "")
    if not base:
        return False
    placed = there.pop(base)
    turned = there.get("attitude", placed)
    if 0.0 < min(placed.mean(), turned.mean()) < _DENSE and np.any(placed != turned):
        return True
    return any(
        x.sum() >= _FEWEST and x[~placed].sum() > (1.0 - 0.5 * placed.mean()) * x.sum()
        for x in there.values()
        if placed.any()
    )


def check_rows(samples: ChannelGroup, log_map: LogMap) -> list[str]:
    """Return notes on the gaps of motors, of a true wrench, and of whole rows' voltage.

    Args:
        samples: a table's columns.
        log_map: with one way to fill each section.

    Raises:
        InputError: a number is beyond any flight's, or a gap is long; the message names the row.
    """
    is_whole, rotors, commands = log_map.rows == "whole", log_map.rotors, log_map.commands
    battery = log_map.battery if is_whole else None
    filled, slow = [], []
    for part in filter(None, (rotors, commands, battery, log_map.force, log_map.torque)):
        read = np.flatnonzero(np.isfinite(samples.values(part)).any(axis=1))
        inside = samples.cut(slice(read[0], read[-1] + 1)) if len(read) else samples
        for name, column in zip(part.columns, inside.values(part).T, strict=True):
            gap = _longest_gap(inside, name, column)
            count = np.count_nonzero(~np.isnan(column))
            if count < _DENSE * len(column):
                slow.append(f"{name} {count} of {len(column)}")
            elif count < len(column):
                filled.append(f"{name} {len(column) - count} (over up to {gap:.3g} s)")
    limits: list[tuple[Columns, float, float, str]] = []
    if battery is not None:
        limits.append((battery, 0.0, np.inf, "a voltage of at least 0"))
    if log_map.is_own and rotors is not None:
        words = "a rotor speed (its direction is the vehicle's spin) of at least 0"
        limits.append((rotors, 0.0, np.inf, words))
    if is_whole and commands is not None and commands.range and not commands.clip:
        low, high = sorted(commands.range)
        limits.append((commands, low, high, f"a motor command from {low:g} to {high:g}"))
    for part, low, high, words in limits:
        for name, column in zip(part.columns, samples.values(part).T, strict=True):
            _refuse(samples, name, column, (column < low) | (column > high), words)
    notes = ["missing values interpolated: " + ", ".join(filled)] if filled else []
    if slow:
        notes.append(
            "interpolated to the other rows, since they have values in: " + ", ".join(slow)
        )
    return notes


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
    limit = max(_LONGEST_GAP, LONGEST_STEPS * np.median(steps) if len(steps) else 0.0)
    edges = np.concatenate([[t[0]], t[read], [t[-1]]])
    at = np.argmax(np.diff(edges))
    gap = float(edges[at + 1] - edges[at])
    is_long = not len(read) or gap > limit * (1.0 + 1e-9)
    first = int(read[at - 1]) + 1 if at and len(read) else 0
    words = (
        f"it has no value for {gap:.3g} s, and gaps of up to {limit:.3g} s are interpolated over"
    )
    bad = is_long & (np.arange(len(t)) == first)
    _refuse(samples, name, column, bad, f"{_FINITE}: {words}")
    return float(steps.max(initial=0.0))
