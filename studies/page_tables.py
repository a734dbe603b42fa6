"""Tables on a page: Markdown between two marks, and counts with their interval."""

from collections.abc import Sequence
from pathlib import Path

from scipy.stats import binomtest, mannwhitneyu

from windwrench.runtime.errors import InputError
from windwrench.runtime.page_files import write_text


def marks(name: str) -> tuple[str, str]:
    """Return the comments between which a page holds what has this name."""
    return f"<!-- {name}: begin -->", f"<!-- {name}: end -->"


BEGIN, END = marks("tables")


def share(count: int, whole: int) -> str:
    """Return a count of a whole and its 95 % interval (Wilson) in per cent."""
    if not whole:
        return "–"
    low, high = binomtest(count, whole).proportion_ci(method="wilson")
    return f"{count} of {whole} ({100 * low:.0f}–{100 * high:.0f} %)"


def area_under_curve(strange: Sequence[float], known: Sequence[float]) -> str:
    """Return how often a number of ``strange`` is above one of ``known``, with both counts."""
    if not strange or not known:
        return "–"
    area = float(mannwhitneyu(strange, known).statistic) / (len(strange) * len(known))
    return f"{area:.3f} ({len(strange)} against {len(known)})"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table as Markdown."""
    return "\n".join(f"| {' | '.join(line)} |" for line in (head, ["---"] * len(head), *rows))


def put_between(text: str, page: Path | None, name: str = "tables") -> None:
    """Put a text between a page's marks; without a page, do nothing.

    Args:
        text: Markdown.
        page: its file.
        name: of the marks; a page of two studies has a pair for each.

    Raises:
        InputError: the page is not there or lacks the marks.
    """
    if page is None:
        return
    begin, end = marks(name)
    old = page.read_text(encoding="utf-8") if page.exists() else ""
    if old.count(begin) != 1 or old.count(end) != 1:
        raise InputError(f"{page}: expected a page with one line {begin} and one {end}")
    before, rest = old.split(begin)
    write_text(f"{before}{begin}\n\n{text}\n\n{end}{rest.split(end)[1]}", page)
