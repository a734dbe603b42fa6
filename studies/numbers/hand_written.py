"""Pages whose prose is written by hand: their tables, made again from kept results."""

import re
import shutil
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parents[2] / "docs"
Kept = Callable[[str], Any]
_TABLE = re.compile(r"(?:^\|.*\n)+", re.MULTILINE)
_TASKS = ("WindHover", "WindTrajectory", "FanTracking2D")
_OUTCOMES = ("silently wrong", "wrong and flagged", "right, with doubts", "right and certain")


def reproduction(kept: Kept) -> str:
    """Return the page of the paper's figures."""
    from windwrench.paper import NAMES
    from windwrench.paper.reproduce import write_page

    with tempfile.TemporaryDirectory() as above:
        folder = Path(above) / "reproduction"
        folder.mkdir()
        for path in (DOCS / "reproduction").glob("*.json"):
            shutil.copy(path, folder)
        page = folder.with_suffix(".md")
        write_page(NAMES, folder, page)
        return page.read_text(encoding="utf-8")


def tasks(kept: Kept) -> str:
    """Return the page of the tasks, whose tables are those of ``windwrench benchmark --task``."""
    from windwrench.evaluation.task_benchmark import TaskRow, markdown

    found = []
    for task in _TASKS:
        rows = [TaskRow(**row) for row in kept(f"results/tasks/{task}.json")]
        found.append(markdown(rows))
    return _with_tables(_page("tasks"), "| scenario | law |", found)


def map_guesses(kept: Kept) -> str:
    """Return the page of a log's map, whose table counts how often a guess is right."""

    def told(count: int, low: float, high: float) -> str:
        return f"{count} ({f'{100 * low:.1f}' if low else '0'} to {100 * high:.1f} %)"

    without, given = sorted(
        kept("map-guesses/map_guesses.json"), key=lambda study: study["vehicle_given"]
    )
    counts = [
        {"silently wrong": study["silently_wrong_interval"], **study["outcomes"]}
        for study in (without, given)
    ]
    rows = [
        f"| {name} | {' | '.join(told(*study[name]) for study in counts)} |" for name in _OUTCOMES
    ]
    head = (
        f"| of {without['tables']} random tables, each | without the vehicle | with the vehicle |"
    )
    table = "\n".join([head, "| --- | --- | --- |", *rows, ""])
    return _with_tables(_page("tutorials/your-log"), "random tables, each", [table])


def _page(name: str) -> str:
    return (DOCS / f"{name}.md").read_text(encoding="utf-8")


def _with_tables(page: str, head: str, tables: Sequence[str]) -> str:
    """Return a page with those of its tables replaced, one after the other, whose first line holds
    ``head``.

    Raises:
        ValueError: the page has another number of such tables.
    """
    left = list(tables)

    def next_table(found: re.Match[str]) -> str:
        return left.pop(0) if head in found[0].splitlines()[0] and left else found[0]

    made = _TABLE.sub(next_table, page)
    if left:
        raise ValueError(f"the page lacks {len(left)} of {len(tables)} tables with {head!r}")
    return made
