"""The speed figures of one version after the other, in a small file that is kept with the code."""

import json
import os
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .. import __version__
from ..runtime.errors import InputError
from ..runtime.page_files import write_json
from ..runtime.provenance import commit
from .contenders import Figure


def read_history(path: Path) -> list[dict[str, Any]]:
    """Return the entries of a history, the oldest first; none where there is no file.

    Raises:
        InputError: the file cannot be read, or is no history.
    """
    if not path.exists():
        return []
    try:
        entries = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"--history {path}: expected a JSON list of entries ({error})") from error
    if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
        raise InputError(f"--history {path}: expected a JSON list of entries")
    return entries


def append_history(figures: Sequence[Figure], rounds: int, path: Path) -> dict[str, Any]:
    """Append a run to a history; return its entry.

    Absolute figures are those of one machine; ``ratio``, to the reference of the same unit in the
    same rounds, can be compared between machines.

    Raises:
        InputError: the file cannot be read or written, or is no history.
    """
    entry = {
        "version": __version__,
        "commit": commit(),
        "python": platform.python_version(),
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "rounds": rounds,
        "figures": {
            f.contender.name: {
                "unit": f.contender.unit,
                "median": _short(f.value[0]),
                "least": _short(f.value[1]),
                "largest": _short(f.value[2]),
                "ratio": _short(f.ratio[0]),
            }
            for f in figures
        },
    }
    write_json([*read_history(path), entry], path)
    return entry


def _short(value: float) -> float:
    return float(f"{value:.4g}")
