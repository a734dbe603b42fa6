"""The rows of a table by a map: their times, checked, and what of a row may be empty."""

from collections import Counter
from collections.abc import Mapping

import numpy as np

from ...runtime.errors import InputError
from .channels import Array, Rows, Samples
from .flight_log import check_finite, check_times
from .log_map import TIME_UNITS, LogMap
from .sample_gaps import GAPS
from .table import Table

_STRAY_GAP = 5.0  # median time steps; shorter gaps leave no stray rows


def rows_of(
    table: Table, columns: Mapping[str, Array], log_map: LogMap
) -> tuple[Samples, list[str]]:
    """Return what the map's columns hold, in the order of time."""
    clock = log_map.time
    notes = []
    repeated = [name for name, count in Counter(table.header).items() if count > 1]
    if repeated:
        notes.append(f"columns that stand there more than once were not used: {repeated[:10]}")
    if not clock.column:
        t = np.arange(table.rows) / clock.rate_hz
        notes.append(f"time: rows at {clock.rate_hz:g} Hz, as the map says")
        return Samples(t + (clock.offset or 0.0), columns, np.arange(table.rows)), notes
    raw = columns[clock.column]
    if log_map.rows == "whole":
        check_finite(table, clock.column, raw)
        check_times(table, raw)
        samples = Samples(raw * TIME_UNITS[clock.unit], columns, np.arange(table.rows))
        _check_whole(table, samples, log_map)
        return _without_stray_rows(table, samples, log_map.stray_rows)
    rows: Rows = np.flatnonzero(np.isfinite(raw))
    if len(rows) < len(raw):
        notes.append(f"{len(raw) - len(rows)} row(s) without a time were left out")
    if len(rows) < 2:
        raise InputError(
            f"{table.path}: column {clock.column}: {len(rows)} time(s); expected at least two"
        )
    raw = raw[rows]
    begin = raw[0] if clock.offset is None else 0.0
    samples = Samples((raw - begin) * TIME_UNITS[clock.unit], columns, rows)
    samples = Samples(samples.t, {name: x[rows] for name, x in columns.items()}, rows)
    if log_map.rows == "streams":  # times that go back are left out of each stream
        return samples, notes
    back = np.flatnonzero(np.diff(raw) < 0.0)
    if back.size:
        i = int(back[0])
        raise InputError(
            f"{table.path}: column {clock.column}, {table.row(int(rows[i + 1]))}: {raw[i + 1]:.9g} "
            f"goes back from {raw[i]:.9g} of the row before; expected increasing times"
        )
    t = samples.t + (clock.offset or 0.0)
    if not np.all(np.isfinite(t)) or np.any((np.diff(t) <= 0.0) & (np.diff(raw) > 0.0)):
        raise InputError(
            f"{table.path}: column {clock.column}: times of {raw[0]:.6g} to {raw[-1]:.6g} "
            f"{clock.unit} cannot be told apart; expected those of one flight"
        )
    first = np.flatnonzero(np.diff(raw, prepend=np.nan) != 0.0)
    columns = samples.columns
    if len(first) < len(t):
        notes.append(f"{len(t) - len(first)} row(s) repeat a time and were joined to the one row")
        columns = {name: _last_of(column, first) for name, column in columns.items()}
        last = np.append(first[1:], len(t)) - 1
        t, rows = t[first], rows[last]
    return Samples(t, columns, rows), notes


def _check_whole(table: Table, samples: Samples, log_map: LogMap) -> None:
    """Raise InputError where a row has a part of a pose, or of a sensor's three values, or lacks
    another number; gaps of motors and of the voltage are looked at where they are interpolated.
    """
    pose = [part for part in (log_map.position, log_map.attitude) if part is not None]
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
        there = ~np.all(np.isnan([samples.columns[name] for name in names]), axis=0)
        for name in names:
            check_finite(table, name, samples.columns[name], there, text)
    others = (log_map.wrench, log_map.force, log_map.torque, *log_map.extra.values())
    for name in [name for part in others if part is not None for name in part.named]:
        if not any(name in part.named for part in pose):
            check_finite(table, name, samples.columns[name])


def _without_stray_rows(table: Table, samples: Samples, most: int) -> tuple[Samples, list[str]]:
    """Return the rows behind a gap that follows the first few, and a note where some were
    dropped.
    """
    step = np.diff(samples.t)
    gaps = np.flatnonzero(step[:most] > _STRAY_GAP * np.median(step))
    if not gaps.size:
        return samples, []
    first = int(gaps[-1]) + 1
    if len(samples.t) - first < 2:
        raise InputError(
            f"{table.path}: only one row after the gap behind the first sample(s); expected at "
            "least two"
        )
    return samples.cut(slice(first, None)), [
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
    return bool(0.0 < share < GAPS.dense and np.any(placed != turned))
