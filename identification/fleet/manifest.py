"""Which logs a fleet has, and of each: which vehicle flew, which reader reads it, when it flew.

What a log is not told by the manifest comes, in this order, from the command line, from a
``vehicle.yaml`` beside it or in a folder above it (within the folder that was given), and from the
log itself. The manifest is YAML::

    order: name               # or modified: the file's time; default: name
    logs:
      - log: "alpha/*.csv"    # pattern of paths below the manifest's folder; * takes / too
        vehicle: racer.yaml   # a preset, or a file beside the manifest
        id: alpha             # the individual; default: the log's folder, else the vehicle's name
        reader: nanobench     # or map: map.yaml, for a table of other columns
        time: 2026-03-01T10:00

or CSV with these columns, ``log,vehicle,id,reader,map,time``. The first entry that fits a log
counts.
"""

import csv
import io
import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, TypeAdapter, ValidationError

from ...dynamics.vehicle_file import load_vehicle
from ...runtime.errors import InputError, unknown_name
from ...runtime.file_limits import LIMITS
from ...runtime.forms import STRICT, checked
from ...runtime.regular_files import read_bytes
from ...runtime.yaml_file import read_yaml
from ..logs.log_map import load_map
from ..logs.readers import READERS, find_reader
from ..logs.readers.recognise import reader_by_content

MANIFEST = "fleet.yaml"  # is found by itself in a folder of logs
VEHICLE_FILE = "vehicle.yaml"
_TABLES = (".csv", ".csv.gz", ".parquet")
_BAG_FOLDER = "metadata.yaml"  # marks a ROS 2 bag, a folder that is one log
_COLUMNS = ("log", "vehicle", "id", "reader", "map", "time")  # of a manifest in CSV
_ORDERS = ("name", "modified")
_MOST_BYTES = LIMITS.table_line * 64  # of a manifest in CSV


@dataclass(frozen=True)
class FleetLog:
    """One log of a fleet."""

    path: str
    name: str  # below the folder that was given
    vehicle: str | None = None  # a preset or a vehicle file; None: the log names it
    id: str = ""  # the individual that flew; empty: the vehicle's name
    reader: str | None = None
    map: str | None = None  # a map's name or file, in place of a reader
    time: float | None = None  # s; orders the flights of an individual; None: their names do


_MOMENT: TypeAdapter[float | datetime | None] = TypeAdapter(
    Annotated[float | datetime | None, Field(union_mode="left_to_right")]
)


def _seconds(value: Any) -> float | None:
    """Return a time (a number, a date, or a text that is one) in seconds."""
    try:
        moment = _MOMENT.validate_python(value)
    except ValidationError:
        raise InputError(
            f"time {value!r}: expected a number or a date such as 2026-03-01T10:00"
        ) from None
    if isinstance(moment, datetime):
        moment = (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
    if moment is not None and not math.isfinite(moment):
        raise InputError(f"time {value!r}: expected a finite number")
    return moment


_Text = Annotated[str | None, BeforeValidator(lambda value: value if value is None else str(value))]


@dataclass(frozen=True)
class ManifestEntry:
    """What a manifest says of the logs that fit a pattern."""

    __pydantic_config__ = STRICT

    log: Annotated[str, BeforeValidator(str)]
    vehicle: _Text = None
    id: _Text = None
    reader: _Text = None
    map: _Text = None  # a map's name or file, in place of a reader
    time: Annotated[float | None, BeforeValidator(_seconds)] = None


@dataclass(frozen=True)
class Manifest:
    """What is said of logs below a folder."""

    folder: Path
    entries: tuple[ManifestEntry, ...] = ()
    by_modified: bool = False


def read_manifest(path: Path) -> Manifest:
    """Read a manifest (.yaml, .yml or .csv).

    Raises:
        InputError: it cannot be read, or a field is unknown, missing or malformed.
    """
    order = _ORDERS[0]
    if path.suffix.lower() in (".yaml", ".yml"):
        given = read_yaml(path, "a fleet's manifest")
        if not isinstance(given, dict) or not isinstance(given.get("logs"), list):
            raise InputError(f"{path}: expected a mapping with a list named logs")
        if unknown := given.keys() - {"logs", "order"}:
            raise unknown_name("key", str(min(unknown, key=str)), ("logs", "order"), str(path))
        order = str(given.get("order", order))
        if order not in _ORDERS:
            raise unknown_name("order", order, _ORDERS, str(path))
        found = [(f"logs, entry {i}", entry) for i, entry in enumerate(given["logs"], 1)]
    else:
        found = list(_csv_entries(path))
    entries = tuple(_entry(entry, f"{path}: {where}", path.parent) for where, entry in found)
    return Manifest(path.parent, entries, by_modified=order == "modified")


def _csv_entries(path: Path) -> Iterator[tuple[str, dict[str, str]]]:
    data = read_bytes(path, "a fleet's manifest", _MOST_BYTES)
    try:
        rows = csv.DictReader(io.StringIO(data.decode("utf-8-sig")), strict=True)
        if "log" not in (rows.fieldnames or ()):
            raise InputError(f"{path}: missing column log; expected {', '.join(_COLUMNS)}")
        for row in rows:
            if None in row or None in row.values():
                raise InputError(
                    f"{path}: line {rows.line_num}: expected {len(rows.fieldnames or ())} fields"
                )
            yield f"line {rows.line_num}", {k: v.strip() for k, v in row.items() if v.strip()}
    except (ValueError, csv.Error) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: cannot be read as a fleet's manifest: {error}") from error


def _entry(given: Any, where: str, folder: Path) -> ManifestEntry:
    if not isinstance(given, Mapping) or "log" not in given:
        raise InputError(f"{where}: expected a mapping with a pattern named log")
    entry = checked(ManifestEntry, given, where)
    entry = replace(entry, vehicle=_beside(folder, entry.vehicle), map=_beside(folder, entry.map))
    if entry.reader is not None:
        find_reader(entry.reader)
    if entry.map is not None:
        load_map(entry.map)
    return entry


def _beside(folder: Path, name: str | None) -> str | None:
    """Return a file's name as the manifest means it, below its folder."""
    return str(folder / name) if name is not None and name.endswith((".yaml", ".yml")) else name


def find_logs(
    given: Sequence[Path],
    manifest: Manifest | None = None,
    vehicle: str | None = None,
    reader: str | None = None,
    without: Path | None = None,
    log_map: str | None = None,
) -> tuple[list[FleetLog], list[str]]:
    """Return the logs among files and in folders, in the order of their names, and doubts: entries
    of the manifest that fit none.

    Args:
        given: files, and folders that are searched through.
        manifest: default: ``fleet.yaml`` in the first folder that has one.
        vehicle: of the logs of which the manifest names none.
        reader: likewise.
        without: a folder that is left out, the results'.
        log_map: name or file of a map, likewise.

    Raises:
        InputError: there is no such file, there is no log, or a vehicle cannot be used.
    """
    if manifest is None:
        manifest = next(
            (read_manifest(p / MANIFEST) for p in given if (p / MANIFEST).is_file()), None
        )
    used: set[int] = set()
    logs: dict[str, FleetLog] = {}
    for root in given:
        for path in _logs_in(root, without):
            below = path.relative_to(root) if root.is_dir() and path != root else None
            one = FleetLog(
                str(path),
                below.as_posix() if below is not None and len(given) == 1 else str(path),
                vehicle or _vehicle_beside(path, root),
                below.parts[0] if below is not None and len(below.parts) > 1 else "",
                reader,
                log_map,
            )
            logs.setdefault(os.path.realpath(path), _with_manifest(one, manifest, used))
    if not logs:
        raise InputError(
            f"{', '.join(map(str, given))}: no flight log found; expected tables "
            f"({', '.join(_TABLES)}), or files that a reader knows: "
            f"{', '.join(reader.what for reader in READERS.values() if reader.begins)}"
        )
    for name in dict.fromkeys(log.vehicle for log in logs.values() if log.vehicle):
        load_vehicle(name)  # a mistake in the vehicle is no log's
    entries = manifest.entries if manifest else ()
    doubts = [
        f"warning: the manifest's entry {entry.log!r} fits no log"
        for i, entry in enumerate(entries)
        if i not in used
    ]
    return sorted(logs.values(), key=lambda log: natural(log.name)), doubts


def natural(name: str) -> tuple[tuple[int, int, str], ...]:
    """Return what orders names as people do: ``flight9`` before ``flight10``."""
    return tuple(
        (0, int(part), "") if part.isdecimal() else (1, 0, part)
        for part in re.split(r"([0-9]+)", name)
        if part
    )


def _is_log(path: Path) -> bool:
    """Return whether a file is a table by its name, or begins as a reader's logs do."""
    return path.name.lower().endswith(_TABLES) or reader_by_content(path) is not None


def _logs_in(root: Path, without: Path | None) -> Iterator[Path]:
    """Yield the logs that a path stands for."""
    if not root.exists():
        raise InputError(f"{root}: no such file or folder")
    if not root.is_dir() or (root / _BAG_FOLDER).is_file():
        yield root
        return
    avoided = None if without is None else os.path.realpath(without)
    for folder, folders, files in os.walk(root):
        folders[:] = sorted(
            name
            for name in folders
            if not name.startswith(".") and os.path.realpath(Path(folder, name)) != avoided
        )
        bags = [name for name in folders if Path(folder, name, _BAG_FOLDER).is_file()]
        folders[:] = [name for name in folders if name not in bags]
        yield from (Path(folder, name) for name in bags)
        for name in sorted(files):
            if not name.startswith(".") and _is_log(path := Path(folder, name)):
                yield path


def _vehicle_beside(path: Path, root: Path) -> str | None:
    """Return the nearest ``vehicle.yaml`` beside a log or above it, no higher than the root."""
    if not root.is_dir():
        return None
    for folder in path.parents:
        if (folder / VEHICLE_FILE).is_file():
            return str(folder / VEHICLE_FILE)
        if folder == root:
            return None
    return None


def _with_manifest(log: FleetLog, manifest: Manifest | None, used: set[int]) -> FleetLog:
    """Return a log with what the manifest says of it; note which entry was used."""
    if manifest is None:
        return log
    if manifest.by_modified:
        log = replace(log, time=os.path.getmtime(log.path))
    path = os.path.relpath(log.path, manifest.folder).replace(os.sep, "/")
    for i, entry in enumerate(manifest.entries):
        if fnmatchcase(path, entry.log):
            used.add(i)
            return replace(
                log,
                vehicle=entry.vehicle or log.vehicle,
                id=entry.id or log.id,
                reader=entry.reader or (None if entry.map else log.reader),
                map=entry.map or (None if entry.reader else log.map),
                time=log.time if entry.time is None else entry.time,
            )
    return log
