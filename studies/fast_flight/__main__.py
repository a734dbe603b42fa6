"""``python -m studies.fast_flight FOLDER``; ``--help`` lists what it takes."""

import argparse
import json
import sys
from pathlib import Path

from windwrench.runtime.errors import InputError
from windwrench.runtime.whole_files import replaced
from windwrench.studies.fast_flight.page import tables
from windwrench.studies.fast_flight.study import (
    FULL,
    filter_study,
    force_study,
    pose_study,
    read_flights,
)
from windwrench.studies.page_tables import put_between


def main() -> None:
    """Run the study, and write its result and tables."""
    parser = argparse.ArgumentParser(
        prog="python -m studies.fast_flight",
        description="Force of named effects on a racer's flights, fitted on some, tested on "
        "others.",
        epilog="Example: python -m studies.fast_flight ../shared/data/racer",
    )
    parser.add_argument("folder", type=Path, help="flight_*.csv.gz and vehicle.yaml")
    parser.add_argument("--no-filter", action="store_true", help="the fits alone")
    parser.add_argument("--out", type=Path, default=Path("results/fast_flight"))
    parser.add_argument("--page", type=Path, default=None, help="page whose tables are made anew")
    given = parser.parse_args()

    def report(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    try:
        flights, vehicle = read_flights(given.folder)
        force = force_study(flights, vehicle, report)
        fits = {
            row["flight"]: row["coefficients"]
            for row in force
            if row["model"] == FULL and row["way"] == "others"
        }
        found = {
            "force": force,
            "pose": pose_study(flights, vehicle),
            "filter": [] if given.no_filter else filter_study(flights, vehicle, fits, report),
        }
        given.out.mkdir(parents=True, exist_ok=True)
        with replaced(given.out / "fast_flight.json") as partial:
            partial.write_text(json.dumps(found, indent=1), encoding="utf-8")
        put_between(tables(found), given.page)
        print(tables(found))
    except InputError as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    main()
