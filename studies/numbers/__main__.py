"""``python -m studies.numbers``: pages and figures against their results, and pages against code.

Ends with 1 where a page or a quote differs from its results. What may be out of date is listed and
is no error; with ``--strict``, before a release, it is.
"""

import argparse
import sys

from windwrench.studies.numbers.quotes import read_quotes, unknown_numbers, wrong_quotes
from windwrench.studies.numbers.rendering import PAGES, differing_lines, write_again
from windwrench.studies.numbers.staleness import in_a_checkout, missing_sources, remarks


def main() -> int:
    """Print what does not agree, and return the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m studies.numbers",
        description="Compare pages and quoted figures with their results, and list pages that are "
        "older than the code they speak of.",
    )
    parser.add_argument("--strict", action="store_true", help="old pages are an error, too")
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
    errors = []
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
    old = [*missing_sources(), *(remarks() if in_a_checkout() else ())]
    for remark in old:
        print(f"look at {remark.page}: {remark.why}")
    for error in errors:
        print(error, file=sys.stderr)
    return int(bool(errors) or (given.strict and bool(old)))


if __name__ == "__main__":
    sys.exit(main())
