"""A folder of other people's logs, one line each: read or refused, and why.

``python -m windwrench.studies.foreign_logs FOLDER`` fetches nothing and keeps nothing. Its table of
public logs stands in docs/readers.md.
"""

import time
from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from windwrench.identification.logs.readers import reader_by_content
from windwrench.identification.report.log_check import check_log
from windwrench.runtime.errors import InputError

from .runner import start

# of names; a file of another is a log where a reader knows its first bytes, as those of SD cards
_KINDS = (
    *("ulg", "bin", "log", "tlog", "bbl", "bfl", "bag", "mcap", "db3"),
    *("csv", "csv.gz", "tsv", "parquet", "mat", "npz"),
)
ENDINGS = tuple(f".{kind}" for kind in _KINDS)
SHOWN = 160  # letters of a reason


def told(path: Path) -> tuple[str, str]:
    """Return what a log is to the kit (read, guessed, refused, or a bug), and a line on it."""
    try:
        found = check_log(path)
    except InputError as error:
        return "refused", str(error).removeprefix(f"{path}: ")
    except Exception as error:  # that this never happens is what is looked for
        return "BUG", f"{type(error).__name__}: {error}"
    log = found.log
    rates = ", ".join(f"{c.name} {c.rate_hz:.3g} Hz" for c in found.channels)
    doubts = f"; {len(found.doubts)} doubt(s)" if found.doubts else ""
    kind = "guessed" if found.guess else "read"
    return kind, f"{log.t[-1] - log.t[0]:.0f} s by {found.read_by}: {rates}{doubts}"


def study(folder: Annotated[Path, typer.Argument(help="Folder that holds the logs.")]) -> None:
    """Print one line a log of a folder and of those in it, and how many were read."""
    counts: Counter[str] = Counter()
    for path in sorted(folder.rglob("*")):
        named = path.name.lower().endswith(ENDINGS)
        if not path.is_file() or not (named or reader_by_content(path)):
            continue
        begun = time.process_time()
        kind, line = told(path)
        counts[kind] += 1
        seconds = time.process_time() - begun
        print(f"{path.relative_to(folder)}: {kind}, {seconds:.1f} s: {line[:SHOWN]}", flush=True)
    print(", ".join(f"{count} {kind}" for kind, count in counts.most_common()) or "no logs")


if __name__ == "__main__":
    start(study)
