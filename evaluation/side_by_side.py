"""What the leaderboards of all tasks share: episodes flown side by side, and rows kept."""

import json
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

from ..runtime.whole_files import replaced
from ..runtime.workers import workers

T = TypeVar("T")
R = TypeVar("R")


def each_flown(
    fly: Callable[[T], R],
    chunks: Sequence[T],
    jobs: int | None = None,
    cluster: str | None = None,
    compile_first: Callable[[], None] = lambda: None,
) -> Iterable[tuple[T, R]]:
    """Yield every chunk, in order, with what ``fly`` returns for it.

    Args:
        fly: importable by its name.
        chunks: of work.
        jobs: processes; default: one a core. The results do not depend on it.
        cluster: address of a Ray cluster that flies; default: none.
        compile_first: has what ``fly`` calls compiled before processes start: here, where it is
            told, and once for all of them.
    """
    if cluster is not None:
        from ..runtime.cluster import spread

        yield from zip(chunks, spread(fly, chunks, cluster), strict=True)
        return
    jobs = min(jobs or os.cpu_count() or 1, len(chunks))
    if jobs == 1:
        for chunk in chunks:
            yield chunk, fly(chunk)
        return
    compile_first()
    with workers(jobs) as pool:
        yield from zip(chunks, pool.map(fly, chunks), strict=True)


def write_leaderboard(rows: Sequence[Any], folder: Path) -> Path:
    """Write the rows, dataclasses, as ``leaderboard.json``, at once or not at all; return its path.

    A number that means nothing is null.
    """
    path = folder / "leaderboard.json"
    data = [
        {key: None if value != value else value for key, value in asdict(row).items()}
        for row in rows
    ]
    with replaced(path) as partial:
        partial.write_text(json.dumps(data, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return path
