"""Tables on a page: Markdown between two marks, and counts with their interval."""

from collections.abc import Sequence
from pathlib import Path

from scipy.stats import binomtest

from windwrench.runtime.errors import InputError
from windwrench.runtime.page_files import write_text

BEGIN, END = "<!-- tables: begin -->", "<!-- tables: end -->"


def share(count: int, whole: int) -> str:
    """Return a count of a whole and its 95 % interval (Wilson) in per cent."""
    if not whole:
        return "–"
    low, high = binomtest(count, whole).proportion_ci(method="wilson")
    return f"{count} of {whole} ({100 * low:.0f}–{100 * high:.0f} %)"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table as Markdown."""
    return "\n".join(f"| {' | '.join(line)} |" for line in (head, ["---"] * len(head), *rows))


def put_between(text: str, page: Path | None) -> None:
    """Put a text between the marks ``BEGIN`` and ``END`` of a page; without a page, do nothing.

    Raises:
        InputError: the page is not there or lacks the marks.
    """
    if page is None:
        return
    old = page.read_text(encoding="utf-8") if page.exists() else ""
    if old.count(BEGIN) != 1 or old.count(END) != 1:
        raise InputError(f"{page}: expected a page with one line {BEGIN} and one {END}")
    before, rest = old.split(BEGIN)
    write_text(f"{before}{BEGIN}\n\n{text}\n\n{END}{rest.split(END)[1]}", page)
