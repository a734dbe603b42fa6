"""``python -m studies.numbers``: pages and quoted figures against their results.

The exit status is 1 where a page or a quote differs from its results.
"""

import argparse
import sys

from windwrench.studies.numbers.quotes import read_quotes, unknown_numbers, wrong_quotes
from windwrench.studies.numbers.rendering import (
    PAGES,
    differing_lines,
    missing_sources,
    write_again,
)


def main() -> int:
    """Print what does not agree, and return the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m studies.numbers",
        description="Compare pages and quoted figures with their results.",
    )
    parser.add_argument(
        "--write",
        metavar="PAGE",
        nargs="+",
        choices=list(PAGES),
        default=[],
        help="first write these pages anew from their kept results",
    )
    given = parser.parse_args()
    for name in given.write:
        write_again(name)
    errors = missing_sources()
    for name in PAGES:
        different = differing_lines(name)
        print(f"docs/{name}.md: {len(different)} lines differ from its results", flush=True)
        errors += [f"docs/{name}.md: {line}" for line in different[:5]]
    quotes, others = read_quotes()
    errors += wrong_quotes(quotes)
    for page, passages in others.items():
        errors += [
            f"{page}: no source: {text!r}" for text in unknown_numbers(page, quotes, passages)
        ]
    print(f"{sum(len(quote.sources) for quote in quotes)} figures in prose compared")
    for error in errors:
        print(error, file=sys.stderr)
    return int(bool(errors))


if __name__ == "__main__":
    sys.exit(main())
