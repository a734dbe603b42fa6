"""The pages that are made of kept results, made again from these alone."""

import difflib
import gzip
import json
import re
import shutil
import tempfile
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from windwrench.runtime.page_files import write_text
from windwrench.runtime.provenance import made_by
from windwrench.studies.numbers import hand_written

DOCS = Path(__file__).resolve().parents[2] / "docs"


def kept(name: str) -> Any:
    """Return what a results file below docs/ holds."""
    path = DOCS / name
    data = gzip.decompress(path.read_bytes()) if path.suffix == ".gz" else path.read_bytes()
    return json.loads(data)


def _written(name: str, write: Callable[[Any, Path, Path], Any], data: str) -> str:
    """Return what ``write(result, file of the results, page)`` writes, in a folder of its own."""
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / f"{name}.md"
        results = Path(folder) / data
        results.parent.mkdir()
        write(kept(data), results, page)
        return page.read_text(encoding="utf-8")


def _between_marks(name: str, tables: str, **others: str) -> str:
    """Return a page with its tables made anew, and ``others`` by the names of their marks."""
    from windwrench.studies.page_tables import put_between

    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / f"{name}.md"
        page.write_bytes((DOCS / f"{name}.md").read_bytes())
        for marks, text in {"tables": tables, **others}.items():
            put_between(text, page, marks)
        return page.read_text(encoding="utf-8")


def _real_faults() -> str:
    from windwrench.studies.real_faults.page import write_page

    return _written("real-faults", write_page, "real-faults/results.json")


def _probabilities() -> str:
    from windwrench.studies.probabilities import other_logs
    from windwrench.studies.probabilities.__main__ import LATER_PART
    from windwrench.studies.probabilities.scores import tables, tables_of_later_flights

    poses = kept("probabilities/results.json.gz")
    parts = {
        LATER_PART: tables_of_later_flights(kept("probabilities/later.json.gz")),
        other_logs.PAGE_PART: other_logs.tables(kept("probabilities/other-logs.json.gz"), poses),
    }
    return _between_marks("probabilities", tables(poses), **parts)


def _real_flights() -> str:
    from windwrench.studies.measured_flights.measured_flights import page

    return page(kept("real-flights/real_flights.json"), "real-flights")


def _trials() -> str:
    from windwrench.studies.trials.page import page_text
    from windwrench.studies.trials.scores import judge

    found = kept("diagnosis-trials/trials.json.gz")
    judged = [one for outcome in found["trials"] for one in judge(outcome)]
    made = made_by(
        f"windwrench trials --seed {found['seed']} --seeds {found['seeds']}",
        [found["commit"]],
        found["version"],
    )
    return page_text(found["trials"], judged, made, "diagnosis-trials")


def _close_loop() -> str:
    from windwrench.studies.closed_loop.closed_loop import DEFAULT_EFFECTS
    from windwrench.studies.closed_loop.page import write_page

    with tempfile.TemporaryDirectory() as above:
        folder = Path(above) / "close-loop"
        shutil.copytree(DOCS / "close-loop", folder)
        page = folder.with_suffix(".md")
        write_page([kept(f"close-loop/{name}.json") for name in DEFAULT_EFFECTS], folder, page)
        return page.read_text(encoding="utf-8")


def _leaderboard() -> str:
    from windwrench.studies.learning.leaderboard_page import page_text
    from windwrench.studies.learning.study import Places, load_plan, read_results

    root = DOCS.parent
    places = Places(root, DOCS / "results" / "learning", root / "training" / "policies")
    return page_text(read_results(places), load_plan(), places, "leaderboard")


# made by results whose sentences have other words by now: their numbers are compared
NUMBERS_ALONE = ("diagnosis-trials",)
_MODULE = re.compile(r"`((?:[a-z_]+/)+[a-z_0-9]+\.py)`")
NUMBER = re.compile(r"(?<![\w.])[-+−]?\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?")
PAGES: Mapping[str, Callable[[], str]] = {
    "diagnosis-trials": _trials,
    "leaderboard": _leaderboard,
    "close-loop": _close_loop,
    "real-flights": _real_flights,
    "probabilities": _probabilities,
    "real-faults": _real_faults,
    "reproduction": partial(hand_written.reproduction, kept),
    "tasks": partial(hand_written.tasks, kept),
}


def write_again(name: str) -> None:
    """Write a page anew from its kept results, after its words changed or two branches met.

    Args:
        name: one of ``PAGES``. What made its results stays as it is on the page.
    """
    page = DOCS / f"{name}.md"
    made = re.compile(r"^Made by `.*$", re.MULTILINE)
    old = iter(made.findall(page.read_text(encoding="utf-8")))
    write_text(made.sub(lambda new: next(old, new[0]), PAGES[name]()), page)


def differing_lines(name: str) -> list[str]:
    """Return the lines of a page that its results do not give, or give otherwise.

    Args:
        name: one of ``PAGES``. The line that says what made the page is left out: its commit is
            that of the results.
    """

    def lines(text: str) -> list[str]:
        found = [line for line in text.splitlines() if not line.startswith("Made by `")]
        return [" ".join(NUMBER.findall(x)) for x in found] if name in NUMBERS_ALONE else found

    page = (DOCS / f"{name}.md").read_text(encoding="utf-8")
    found = difflib.unified_diff(lines(PAGES[name]()), lines(page), "results", "page", n=0)
    return [line for line in found if line[0] in "+-" and not line.startswith(("+++", "---"))]


def missing_sources() -> list[str]:
    """Return the modules that pages name and that do not exist, each with its page."""
    pages = (
        DOCS.parent / "README.md",
        DOCS.parent / "CONTRIBUTING.md",
        *sorted(DOCS.rglob("*.md")),
    )
    return [
        f"{page.name} names {name}"
        for page in pages
        for name in sorted(set(_MODULE.findall(page.read_text(encoding="utf-8"))))
        if not (DOCS.parent / name).exists() and not name.startswith(("my_", "live/ros2"))
    ]
