"""Pages that show kept results. Each page is a Jinja template, filled from files below ``docs/``.

``python -m evidence.pages`` compares every page with its results, and quoted figures with theirs;
``--write PAGE`` writes a page anew. A test does the same comparison.
"""

import argparse
import difflib
import re
import sys
from collections.abc import Callable, Mapping
from functools import cache, partial
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from windwrench.evidence import boards, tasks, trust_page
from windwrench.evidence.kept_results import DOCS, ROOT
from windwrench.evidence.quotes import read_quotes, unknown_numbers, wrong_quotes
from windwrench.evidence.scoring import share
from windwrench.runtime.page_files import write_text
from windwrench.runtime.provenance import made_by

# what the template of each page shows, of kept results
PAGES: Mapping[str, Callable[[], Mapping[str, Any]]] = {
    "leaderboard": boards.page,
    "tasks": tasks.page,
    "trust": trust_page.page,
}
_MODULE = re.compile(r"`((?:[a-z_]+/)+[a-z_0-9]+\.py)`")
_COMMAND = re.compile(r"python -m ((?:evidence|studies|windwrench)\.[a-z_.]+)")


@cache
def _templates() -> Environment:
    found = Environment(
        loader=FileSystemLoader(Path(__file__).with_name("templates")),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    found.filters |= {"f": format, "zip": partial(zip, strict=True)}
    found.globals |= {"made_by": made_by, "share": share}
    return found


def page_of_results(name: str) -> str:
    """Return one of ``PAGES``, as Markdown, as its kept results give the page."""
    return _templates().get_template(f"{name}.md").render(PAGES[name]())


def differing_lines(name: str) -> list[str]:
    """Return the lines of a page that its results give otherwise, or do not give."""
    on_disk = (DOCS / f"{name}.md").read_text(encoding="utf-8").splitlines()
    found = difflib.unified_diff(page_of_results(name).splitlines(), on_disk, n=0)
    return [line for line in found if line[0] in "+-" and not line.startswith(("+++", "---"))]


def missing_sources() -> list[str]:
    """Return the modules that pages name and that do not exist, each with its page. The
    changelog names what has left.
    """
    pages = (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md")))
    missing = []
    for page in pages:
        text = page.read_text(encoding="utf-8")
        names = [name for name in _MODULE.findall(text) if not _is_file(name)]
        names += [module for module in _COMMAND.findall(text) if not _runs(module)]
        missing += [f"{page.name} names {name}" for name in sorted(set(names))]
    return missing


def _is_file(name: str) -> bool:
    return (ROOT / name).exists() or name.startswith("my_")


def _runs(module: str) -> bool:
    path = ROOT / module.removeprefix("windwrench.").replace(".", "/")
    return path.with_suffix(".py").exists() or (path / "__main__.py").exists()


def main() -> int:
    """Print what differs; return 1 where something does, else 0."""
    parser = argparse.ArgumentParser(
        prog="python -m evidence.pages",
        description="Compare pages and quoted figures with their results.",
    )
    parser.add_argument(
        "--write",
        metavar="PAGE",
        nargs="+",
        choices=list(PAGES),
        default=[],
        help="write these pages from their kept results first",
    )
    for name in parser.parse_args().write:
        write_text(page_of_results(name), DOCS / f"{name}.md")
    errors = missing_sources()
    for name in PAGES:
        different = differing_lines(name)
        print(f"docs/{name}.md: {len(different)} lines differ from its results", flush=True)
        errors += [f"docs/{name}.md: {line}" for line in different[:5]]
    quotes, others = read_quotes()
    errors += wrong_quotes(quotes)
    for page, passages in others.items():
        numbers = unknown_numbers(page, quotes, passages)
        errors += [f"{page}: no source: {text!r}" for text in numbers]
    print(f"{sum(len(quote.sources) for quote in quotes)} figures in prose compared")
    for error in errors:
        print(error, file=sys.stderr)
    return int(bool(errors))


if __name__ == "__main__":
    sys.exit(main())
