"""``python -m studies.identified_vehicles``; ``--help`` lists what it takes."""

import argparse
from pathlib import Path

from windwrench.studies.identified_vehicles.page import tables
from windwrench.studies.identified_vehicles.study import run, save
from windwrench.studies.page_tables import put_between

if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m studies.identified_vehicles")
    parser.add_argument("--runs", type=int, default=200, help="vehicles drawn and identified")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=Path("results/identified_vehicles"))
    parser.add_argument("--page", type=Path, default=None, help="page whose table is made anew")
    given = parser.parse_args()
    outcomes = run(given.out, given.runs, given.jobs)
    save(outcomes, given.out / "identified_vehicles.json.gz")
    put_between(tables(outcomes), given.page)
    print(tables(outcomes))
