"""``python -m studies.filtered_logs``; ``--help`` lists what it takes."""

import argparse
from pathlib import Path

from windwrench.studies.filtered_logs.filtered_logs import resume, run, save
from windwrench.studies.filtered_logs.page import tables
from windwrench.studies.page_tables import put_between

if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m studies.filtered_logs")
    parser.add_argument("--seeds", type=int, default=1, help="how often every effect is flown")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--flights", type=int, default=None, help="only the first so many")
    parser.add_argument("--out", type=Path, default=Path("results/filtered_logs"))
    parser.add_argument("--page", type=Path, default=None, help="page whose tables are made anew")
    parser.add_argument(
        "--saved",
        type=Path,
        default=None,
        help="filtered_logs.json.gz of an earlier run, to go on from",
    )
    given = parser.parse_args()
    if given.saved is not None:
        resume(given.out, given.saved)
    outcomes = run(given.out, range(given.seeds), given.jobs, given.flights)
    save(outcomes, given.out / "filtered_logs.json.gz")
    put_between(tables(outcomes), given.page)
    print(tables(outcomes))
