"""The diagnosis of one log of a fleet, in a worker: what comes back is plain data, whatever
happens.
"""

import hashlib
import os
import traceback
import warnings
from pathlib import Path
from typing import Any

from ...dynamics.vehicle_file import dump_vehicle, load_vehicle, named_vehicle
from ...runtime.code_digest import code_digest
from ...runtime.errors import InputError
from ...runtime.plain_values import as_text
from ..diagnosis import diagnose
from ..logs.log_map import load_map
from ..logs.reading import read_log
from ..report.files import report_data
from .manifest import FleetLog

_CODE = ("runtime", "dynamics", "estimator", "identification")
_NOT_CODE = ("identification/fleet", "identification/report")  # tell what was found, find nothing
# of report.json, what a fleet keeps of a flight
_KEPT = (
    *("verdict", "remainder", "headline", "effects", "error"),
    *("notes", "seconds", "vehicle", "floor_is_lower_bound"),
)


def key_of(log: FleetLog, without: tuple[str, ...]) -> str:
    """Return what an outcome depends on, as a digest (32 hexadecimal digits): the log's bytes, the
    vehicle, the reader or map, the piece, the effects that are left out, and the code.

    Args:
        log: the log.
        without: effects taken out of the library.

    Raises:
        InputError: the log cannot be read.
    """
    reader = log.reader or ""
    option = Path(reader.partition(":")[2])
    texts = (
        "" if log.vehicle is None else dump_vehicle(load_vehicle(log.vehicle)),
        reader,
        option.read_text(encoding="utf-8", errors="replace") if option.is_file() else "",
        "" if log.map is None else repr(load_map(log.map)),
        log.piece,
        *sorted(without),
        code_digest(_CODE, (), _NOT_CODE),
    )
    digest = hashlib.blake2b(repr(texts).encode(), digest_size=16)
    path = Path(log.path)
    files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
    try:
        for file in files:
            if not file.is_file():  # a pipe would never end
                raise InputError(f"{file}: is no regular file")
            with open(file, "rb") as data:
                digest.update(hashlib.file_digest(data, "blake2b").digest())
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    return digest.hexdigest()


def refusal(kind: str, reason: str) -> dict[str, Any]:
    """Return the outcome of a log that was refused.

    Args:
        kind: input (the log or its vehicle), memory, time, died, or error (a fault of the kit).
        reason: one line.
    """
    return {"status": "refused", "kind": kind, "reason": " ".join(as_text(reason).split())}


def diagnose_one(log: FleetLog, without: tuple[str, ...]) -> dict[str, Any]:
    """Return the outcome of a log: what was found, or why it was refused. Raises nothing."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a log's notes say what matters
            model = None if log.vehicle is None else load_vehicle(log.vehicle)
            flight = read_log(log.path, log.reader, model, log.map, log.piece)
            how = ", a manifest or a vehicle.yaml beside the log"
            flown = model or named_vehicle(flight.vehicle, log.path, how)
            data = report_data(diagnose([flight], flown, without=without))
    except InputError as error:
        return refusal("input", str(error))
    except MemoryError:
        return refusal("memory", f"{log.path}: needs more memory than there is")
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{os.path.basename(place.filename)}, line {place.lineno}"
        return refusal("error", f"{log.path}: {type(error).__name__} ({where}): {error}")
    return {"status": "diagnosed", **{name: data[name] for name in _KEPT}}
