"""Pages whose prose is written by hand: their tables, made again from kept results."""

import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parents[2] / "docs"
Kept = Callable[[str], Any]
_TASKS = ("WindHover", "WindTrajectory", "FanTracking2D")


def reproduction(kept: Kept) -> str:
    """Return the page of the paper's figures."""
    from windwrench.paper import KEPT, NAMES
    from windwrench.paper.reproduce import write_page

    with tempfile.TemporaryDirectory() as above:
        folder = Path(above) / "reproduction"
        folder.mkdir()
        for path in (DOCS / "reproduction").glob("*.json"):
            shutil.copy(path, folder)
        page = folder.with_suffix(".md")
        write_page((*NAMES, *KEPT), folder, page)
        return page.read_text(encoding="utf-8")


def tasks(kept: Kept) -> str:
    """Return the page of the tasks, whose tables are those of ``windwrench benchmark --task``."""
    from windwrench.evaluation.leaderboard import Standing, markdown, summary

    page = _page("tasks")
    for task in _TASKS:
        rows = [Standing(**row) for row in kept(f"results/tasks/{task}.json.gz")]
        begin, end = f"<!-- {task}: begin -->", f"<!-- {task}: end -->"
        before, rest = page.split(begin)
        page = f"{before}{begin}\n\n{summary(rows)}\n{markdown(rows)}\n{end}{rest.split(end)[1]}"
    return page


def _page(name: str) -> str:
    return (DOCS / f"{name}.md").read_text(encoding="utf-8")
