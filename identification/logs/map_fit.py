"""Which sections of a map a log fills: the columns that are there, and of several ways to fill a
section the first that holds measurements.
"""

from collections.abc import Sequence
from dataclasses import replace
from difflib import get_close_matches
from typing import Any

import numpy as np

from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError
from .channels import Samples
from .log_map import Attitude, Columns, LogMap, TimeColumn, check_whole
from .table import Table

_SHOWN = 30  # columns that an error lists
NO_QUATERNION = 0.5  # length; shorter stands for one that is not there


def fitted(table: Table, log_map: LogMap, vehicle: Vehicle | None, reader: str) -> LogMap:
    """Return a map with the ways to fill a section for which a table has the columns, without the
    optional sections that the table lacks, and with the range of its commands.

    Raises:
        InputError: it does not fit the table.
    """
    header = set(table.header)
    where = f"{table.path}: map {log_map.name}"
    clocks: list[TimeColumn] = [c for c in ways(log_map, "time") if c.column in {*header, ""}]
    missing = [] if clocks else [(log_map.time.column, "time")]
    kept: dict[str, Any] = {"time": clocks[0] if clocks else log_map.time}
    others: dict[str, tuple[Columns, ...]] = {}
    for section, part in log_map.sections.items():
        fitting = [way for way in ways(log_map, section) if set(way.named) <= header]
        absent = [name for name in part.named if name not in header]
        if fitting:
            kept[section], others[section] = fitting[0], tuple(fitting[1:])
        elif part.optional and (len(absent) == len(part.named) or reader):
            kept[section] = None
        else:
            whose = f"{section} (all or none)" if part.optional else section
            missing += [(name, whose) for name in absent]
    if missing and reader:
        names = ", ".join(name for name, _ in missing)
        raise InputError(
            f"{table.path}: missing column(s) {names}; expected those of {log_map.about}"
        )
    if missing:
        raise InputError(f"{where} does not fit: {_missing_words(missing, table.header)}")
    log_map = replace(log_map, **kept, alternatives=others)
    check_whole(log_map, f"{where} does not fit")
    extra = {name: part for name, part in log_map.extra.items() if set(part.named) <= header}
    log_map = replace(log_map, extra=extra)
    return with_range(log_map, vehicle, where)


def with_range(log_map: LogMap, vehicle: Vehicle | None, where: str) -> LogMap:
    """Return a map that states the range of its commands: its own, or that of the vehicle.

    Raises:
        InputError: neither states one.
    """
    commands = log_map.commands
    if commands is None or commands.range is not None:
        return log_map
    curve = vehicle.motor_curve if vehicle is not None else None
    if curve is None:
        raise InputError(
            f"{where}: commands: unit counts without a range; expected what stands for no and "
            "for full command, such as range: [0, 65535], or a vehicle whose motor_curve "
            "states it"
        )
    return replace(log_map, commands=replace(commands, range=curve.command))


def _missing_words(missing: list[tuple[str, str]], header: tuple[str, ...]) -> str:
    lower = {name.lower(): name for name in header}
    parts = []
    for name, section in missing[:8]:
        near = get_close_matches(name.lower(), lower, n=2, cutoff=0.6)
        hint = f" (like {' or '.join(lower[x] for x in near)})" if near else ""
        parts.append(f"{name!r} of {section}{hint}")
    more = f" and {len(missing) - 8} more" if len(missing) > 8 else ""
    found = ", ".join(header[:_SHOWN]) + (", ..." if len(header) > _SHOWN else "")
    return f"no column {', '.join(parts)}{more}; found {found}"


def wanted_columns(log_map: LogMap) -> list[str]:
    """Return the columns that a map asks for, each once."""
    parts = [way for section in log_map.sections for way in ways(log_map, section)]
    names = [name for part in (*parts, *log_map.extra.values()) for name in part.named]
    return [name for name in dict.fromkeys([*names, log_map.time.column]) if name]


def topics_of(log_map: LogMap) -> set[str]:
    """Return the kinds of messages in which the map's columns stand."""
    return {way.topic for section in log_map.sections for way in ways(log_map, section)}


def ways(log_map: LogMap, section: str) -> tuple[Any, ...]:
    """Return the ways to fill a section, in their order."""
    first = getattr(log_map, section)
    return () if first is None else (first, *log_map.alternatives.get(section, ()))


def chosen(recorded: Sequence[Samples], log_map: LogMap) -> tuple[LogMap, dict[str, Samples]]:
    """Return a map with one way to fill each section, and the samples in which its columns stand:
    the first way whose columns are there, and hold measurements; a position with an attitude that
    goes with it. Optional sections of which there are none are left out.
    """
    usable = {section: _usable(recorded, log_map, section) for section in log_map.sections}
    places, turns = usable.get("position", []), usable.get("attitude", [])
    pairs = [
        ([place], [turn])
        for place in places
        for turn in turns
        if not turn[0].of or place[0].topic in turn[0].of
    ]
    if pairs:
        usable["position"], usable["attitude"] = pairs[0]
    elif not (log_map.is_own and places):
        usable["position"], usable["attitude"] = [], []
    found: dict[str, Any] = {
        section: ways[0][0] if ways else None for section, ways in usable.items()
    }
    samples = {section: ways[0][1] for section, ways in usable.items() if ways}
    return replace(log_map, alternatives={}, **found), samples


def _usable(
    recorded: Sequence[Samples], log_map: LogMap, section: str
) -> list[tuple[Any, Samples]]:
    """Return the ways to fill a section that hold measurements, each with its samples; the only
    way that is there, where the section must be filled.
    """
    there = [
        (way, samples) for way in ways(log_map, section) for samples in recorded if samples.has(way)
    ]
    stated = log_map.rows == "whole" or log_map.is_own
    if len(there) == 1 and (stated or not there[0][0].optional):
        return there
    return [one for one in there if _is_measured(section, *one, log_map.rows)]


def _is_measured(section: str, way: Columns, samples: Samples, rows: str) -> bool:
    """Return whether a section's columns hold measurements: rotors that turn, a voltage, but of
    ``messages`` a position that changes, and two samples of others.
    """
    values = samples.values(way)
    values = values[np.isfinite(values).all(axis=1)]
    if isinstance(way, Attitude) and not way.euler:
        return bool(np.any(np.linalg.norm(values, axis=1) > NO_QUATERNION))
    if section == "rotors":
        return bool(np.any(values != 0.0))
    if section == "battery":
        return bool(np.any(values > 0.0))
    if section == "position" and rows != "messages" and len(values):
        return bool(np.any(np.ptp(values, axis=0) > 0.0))
    return len(values) > 1
