"""How long a command took on this machine: kept when it ends, told by a dry run."""

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..runtime.whole_files import replaced

_LEAST = 1.0  # s, below which a duration is not worth keeping
# of a plan, what time grows with, and what must be the same for that
_COUNTED = ("flights", "episodes", "trials", "diagnoses", "decisions")
_ALIKE = ("algorithm", "law", "task")


def _file() -> Path:
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "windwrench" / "durations.json"


def _kept() -> dict[str, Any]:
    try:
        data = json.loads(_file().read_text(encoding="utf-8"))
    except (OSError, ValueError, RuntimeError):
        return {}
    return data if isinstance(data, dict) else {}


def keep_duration(command: str, plan: Mapping[str, Any], seconds: float) -> None:
    """Keep how long a command took for a plan; where nothing can be kept, nothing is."""
    if seconds < _LEAST:
        return
    with suppress(Exception):
        path = _file()
        path.parent.mkdir(parents=True, exist_ok=True)
        data = {**_kept(), command: {"plan": dict(plan), "seconds": round(seconds, 1)}}
        with replaced(path) as partial:
            partial.write_text(json.dumps(data, indent=1, default=str) + "\n", encoding="utf-8")


def duration_words(seconds: float) -> str:
    """Return a duration as a person says it."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    if seconds < 5400.0:
        return f"{seconds / 60.0:.0f} minutes"
    return f"{seconds / 3600.0:.1f} hours"


def expected_duration(command: str, plan: Mapping[str, Any]) -> str:
    """Return how long a plan takes, by the command's last run on this machine, with how that is
    known.
    """
    last: Any = _kept().get(command)
    try:
        seconds, before = float(last["seconds"]), dict(last["plan"])
    except (KeyError, TypeError, ValueError):
        return "not known: this command has not run on this machine"
    if before == json.loads(json.dumps(dict(plan), default=str)):
        return f"{duration_words(seconds)}, as the same run took here last time"
    alike = all(before.get(name) == plan.get(name) for name in _ALIKE)
    for name in _COUNTED if alike else ():
        then, now = before.get(name), plan.get(name)
        if isinstance(then, int) and isinstance(now, int) and then > 0:
            return (
                f"about {duration_words(seconds * now / then)}, by the last run here: {then} "
                f"{name} in {duration_words(seconds)}"
            )
    return f"not known; the last run here, of another plan, took {duration_words(seconds)}"
