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
        piece: 2              # of a file with several; default: the longest
        time: 2026-03-01T10:00
        session: monday       # flights of one name are off by the same; default: each by its own

or CSV with these columns, ``log,vehicle,id,reader,map,piece,time,session``. The first entry that
fits a log counts.
"""

import csv
import io
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from fnmatch import fnmatchcase
from itertools import takewhile
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, ConfigDict, Field

from ...dynamics.vehicle_file import load_vehicle
from ...runtime.errors import InputError
from ...runtime.file_limits import LIMITS
from ...runtime.forms import STRICT, checked, expected
from ...runtime.regular_files import read_bytes
from ...runtime.yaml_file import read_yaml
from ..logs.log_map import load_map
from ..logs.readers import binary_logs, find_reader, reader_by_content

MANIFEST = "fleet.yaml"  # is found by itself in a folder of logs
VEHICLE_FILE = "vehicle.yaml"
_TABLES = (".csv", ".csv.gz", ".parquet")
_BAG_FOLDER = "metadata.yaml"  # marks a ROS 2 bag, a folder that is one log
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
    piece: int | None = None  # which part of the file, from 1
    time: float | None = None  # s; orders the flights of an individual; None: their names do
    session: str = ""  # flights of one name share what they are off by; empty: its own
    key: str = ""  # of its outcome


def _seconds(moment: float | datetime) -> float:
    if isinstance(moment, datetime):
        return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
    return moment


_Moment = Annotated[
    Annotated[float, Field(allow_inf_nan=False)] | datetime,
    Field(union_mode="left_to_right"),
    AfterValidator(_seconds),
    expected("a number or a date such as 2026-03-01T10:00"),
]


@dataclass(frozen=True)
class ManifestEntry:
    """What a manifest says of the logs that fit a pattern."""

    __pydantic_config__ = ConfigDict(extra="forbid", coerce_numbers_to_str=True)

    log: str
    vehicle: str | None = None
    id: str | None = None
    reader: str | None = None
    map: str | None = None  # a map's name or file, in place of a reader
    piece: int | None = None  # which part of the file, from 1
    time: _Moment | None = None  # s
    session: str | None = None


@dataclass(frozen=True)
class Manifest:
    """What is said of logs below a folder."""

    __pydantic_config__ = STRICT

    logs: tuple[ManifestEntry, ...]
    order: Literal["name", "modified"] = "name"


def read_manifest(path: Path) -> Manifest:
    """Return a manifest (.yaml, .yml or .csv) with its files' paths as this process finds them.

    Raises:
        InputError: it cannot be read, or a field is unknown, missing or malformed.
    """
    in_yaml = path.suffix.lower() in (".yaml", ".yml")
    data = read_yaml(path, "a fleet's manifest") if in_yaml else {"logs": _csv_entries(path)}
    manifest = checked(Manifest, data, str(path))
    entries = []
    for entry in manifest.logs:
        if entry.reader is not None:
            find_reader(entry.reader)
        vehicle, log_map = (
            str(path.parent / name) if name and name.endswith((".yaml", ".yml")) else name
            for name in (entry.vehicle, entry.map)
        )
        if log_map is not None:
            load_map(log_map)
        entries.append(replace(entry, vehicle=vehicle, map=log_map))
    return replace(manifest, logs=tuple(entries))


def _csv_entries(path: Path) -> list[dict[str, str]]:
    data = read_bytes(path, "a fleet's manifest", _MOST_BYTES)
    entries = []
    try:
        rows = csv.DictReader(io.StringIO(data.decode("utf-8-sig")), strict=True)
        for row in rows:
            if None in row or None in row.values():
                count = len(rows.fieldnames or ())
                raise InputError(f"{path}: line {rows.line_num}: expected {count} fields")
            entries.append({key: text.strip() for key, text in row.items() if text.strip()})
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read as a fleet's manifest: {error}") from error
    return entries


def find_logs(
    given: Sequence[Path],
    manifest: Path | None = None,
    without: Path | None = None,
    vehicle: str | None = None,
    **how: Any,
) -> tuple[list[FleetLog], list[str]]:
    """Return all logs of a fleet, in the order of their names, and a warning of each entry of the
    manifest that fits none.

    Args:
        given: files, and folders that are searched through.
        manifest: its file; default: ``fleet.yaml`` in the first folder that has one.
        without: a folder that is left out, the results'.
        vehicle: of the logs of which the manifest names none.
        how: ``reader``, ``map`` and ``piece`` of a ``FleetLog``, likewise.

    Raises:
        InputError: there is no such file, there is no log, or a vehicle cannot be used.
    """
    beside = (folder / MANIFEST for folder in given)
    manifest = manifest or next((path for path in beside if path.is_file()), None)
    said = Manifest(()) if manifest is None else read_manifest(manifest)
    above = Path() if manifest is None else manifest.parent
    unused = {entry.log: None for entry in said.logs}
    logs: dict[str, FleetLog] = {}
    for root in given:
        for path in _logs_in(root, without):
            below = path.relative_to(root) if root.is_dir() and path != root else None
            log = FleetLog(
                str(path),
                below.as_posix() if below is not None and len(given) == 1 else str(path),
                vehicle or _vehicle_beside(path, root),
                below.parts[0] if below is not None and len(below.parts) > 1 else "",
                time=os.path.getmtime(path) if said.order == "modified" else None,
                **how,
            )
            name = os.path.relpath(path, above).replace(os.sep, "/")
            fits = next((entry for entry in said.logs if fnmatchcase(name, entry.log)), None)
            if fits is not None:
                unused.pop(fits.log, None)
                facts = {k: x for k, x in vars(fits).items() if k != "log" and x not in (None, "")}
                if {"reader", "map"} & facts.keys():  # it takes the place of the other
                    log = replace(log, reader=None, map=None)
                log = replace(log, **facts)
            logs.setdefault(os.path.realpath(path), log)
    if not logs:
        raise InputError(
            f"{', '.join(map(str, given))}: no flight log found; expected tables "
            f"({', '.join(_TABLES)}), or files that a reader knows: {binary_logs()}"
        )
    for named in dict.fromkeys(log.vehicle for log in logs.values() if log.vehicle):
        load_vehicle(named)  # a mistake in the vehicle is no log's
    doubts = [f"warning: the manifest's entry {pattern!r} fits no log" for pattern in unused]
    return sorted(logs.values(), key=lambda log: natural(log.name)), doubts


def natural(name: str) -> tuple[tuple[int, int, str], ...]:
    """Return what orders names as people do: ``flight9`` before ``flight10``."""
    return tuple(
        (0, int(part), "") if part.isdecimal() else (1, 0, part)
        for part in re.split(r"([0-9]+)", name)
        if part
    )


def _logs_in(root: Path, without: Path | None) -> Iterator[Path]:
    """Yield the logs that a path stands for: tables by their names, files that begin as a reader's
    logs do, and bags.
    """
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
        for path in (Path(folder, name) for name in sorted(files) if not name.startswith(".")):
            if path.name.lower().endswith(_TABLES) or reader_by_content(path) is not None:
                yield path


def _vehicle_beside(path: Path, root: Path) -> str | None:
    """Return the nearest ``vehicle.yaml`` beside a log or above it, no higher than the root."""
    above = takewhile(lambda folder: folder != root.parent, path.parents)
    files = (folder / VEHICLE_FILE for folder in above)
    return next((str(file) for file in files if file.is_file()), None)
