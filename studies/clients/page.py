"""The page on clients, from what each of them told."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from windwrench.studies.page_tables import put_between, table

_DOCS = Path(__file__).resolve().parents[2] / "docs"
DATA, PAGE = _DOCS / "clients" / "results.json", _DOCS / "clients.md"


def tables(results: Sequence[Mapping[str, Any]]) -> str:
    """Return the table of what works and what it needed, and of what failed."""
    rows = []
    for r in results:
        if "failed" in r:
            rows.append([r["client"], "-", "**fails**: " + r["failed"], "-", "-", "-"])
            continue
        versions = ", ".join(f"{name} {number}" for name, number in r["versions"].items())
        learned = f"{r['first']:.0f} to {r['last']:.0f} ({r['episodes']})"
        shims = "; ".join(r["shims"]) or "none"
        rows.append(
            [r["client"], versions, shims, str(r["decisions"]), learned, f"{r['cpu_s']:.0f} s"]
        )
    head = ["client", "versions", "shims", "decisions", "return*", "processor time"]
    works = sum("failed" not in r for r in results)
    return (
        f"{works} of {len(results)} train.\n\n{table(head, rows)}\n\n"
        "*of an episode while training, at most 250: mean of the first four and of the last four, "
        "of as many as the brackets say (RLlib: after each iteration). A few thousand decisions "
        "show that it runs, not what it can learn."
    )


def write_page(results: Sequence[Mapping[str, Any]], page: Path = PAGE) -> None:
    """Put the table on the page."""
    put_between(tables(results), page)
