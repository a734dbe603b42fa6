"""Figures that prose quotes, and the results that they come from: ``quotes.yaml``."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from windwrench.evidence.kept_results import DOCS, kept
from windwrench.runtime.yaml_file import read_yaml

ROOT = DOCS.parent
FILE = Path(__file__).with_name("quotes.yaml")
_NUMBER = re.compile(r"(?<![\w.])\d[\d,]*(?:\.\d+)?(?![\w.]*\w\()")


@dataclass(frozen=True)
class Quote:
    """A passage of a page with its figures as the results give them.

    Attributes:
        page: from the repository's root.
        says: the passage as it must stand there.
        sources: the results files, or pages made of results, that gave the figures.
    """

    page: str
    says: str
    sources: tuple[str, ...]


def read_quotes(path: Path = FILE) -> tuple[list[Quote], dict[str, list[str]]]:
    """Return the quotes, and for each page that is checked as a whole the passages with numbers
    that are no results (a name, a year, a setting).

    Raises:
        LookupError: a figure is not found in its results.
    """
    listed = read_yaml(path, "quotes")
    quotes = []
    for page, entries in listed["quotes"].items():
        for entry in entries:
            values = [_value(value) for value in entry["values"]]
            sources = tuple(value["from"] for value in entry["values"])
            quotes.append(Quote(page, entry["says"].format(*values), sources))
    return quotes, listed["not results"]


def _value(value: Mapping[str, Any]) -> str:
    """Return one figure as prose shows it, from results (JSON) or from a page made of results."""
    if value["from"].endswith(".md"):
        return _on_page(value["from"], value["line"], value["finds"])
    found: Any = kept(value["from"].removeprefix("docs/"))
    if "where_in" in value:
        found = found[value["where_in"]]
    for key, wanted in value.get("where", {}).items():
        found = [row for row in found if row[key] == wanted]
    if "where" in value:
        if len(found) != 1:
            raise LookupError(f"{value['from']}: {len(found)} rows with {value['where']}")
        (found,) = found
    for key in value["key"] if isinstance(value["key"], list) else [value["key"]]:
        found = found[key]
    return format(value.get("times", 1) * found, value.get("form", ""))


def _on_page(page: str, line: str, finds: str) -> str:
    """Return what a pattern's group finds in the one line of a page that holds a text."""
    text = (ROOT / page).read_text(encoding="utf-8").splitlines()
    lines = [x for x in text if line in x]
    match = re.search(finds, lines[0]) if len(lines) == 1 else None
    if match is None:
        raise LookupError(f"{page}: {len(lines)} lines with {line!r}, and {finds!r} not in one")
    return match[1]


def prose(text: str) -> str:
    """Return a page without what holds no claims: code, targets of links, comments, and the marks
    of lists.
    """
    text = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r"\]\([^)]*\)", "]", text)
    text = re.sub(r"<[a-z/][^>]*>", "", text)
    text = re.sub(r"^\s*\d+\.\s", "", text, flags=re.MULTILINE)
    return " ".join(text.split())


def wrong_quotes(quotes: Sequence[Quote]) -> list[str]:
    """Return the passages that do not stand on their page as the results have them."""
    pages = {q.page: prose((ROOT / q.page).read_text(encoding="utf-8")) for q in quotes}
    return [f"{q.page}: expected {q.says!r}" for q in quotes if q.says not in pages[q.page]]


def unknown_numbers(
    page: str, quotes: Sequence[Quote], not_results: Sequence[str], text: str | None = None
) -> list[str]:
    """Return the numbers in a page's prose that no quote and no exception covers, each with what
    stands around it.

    Args:
        page: from the repository's root.
        quotes: of all pages.
        not_results: passages of this page whose numbers are no results.
        text: of the page; default: as it is.
    """
    left = prose((ROOT / page).read_text(encoding="utf-8") if text is None else text)
    for passage in (*(q.says for q in quotes if q.page == page), *not_results):
        left = left.replace(passage, " ")
    left = re.sub(r"`[^`]*`", "``", left)
    return [left[max(m.start() - 30, 0) : m.end() + 20] for m in _NUMBER.finditer(left)]
