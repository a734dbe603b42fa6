"""``python -m studies.probabilities``; ``--help`` lists what it takes."""

import argparse
import gzip
import json
from pathlib import Path

from windwrench.runtime.page_files import write_text
from windwrench.studies.page_tables import put_between
from windwrench.studies.probabilities.flights import OF_TEN, recorded
from windwrench.studies.probabilities.scores import tables, tables_of_later_flights
from windwrench.studies.resumed_tasks import Task, run_tasks

RESULTS = Path("docs/probabilities/results.json.gz")
LATER, LATER_PART = Path("docs/probabilities/later.json.gz"), "later flights"
# the other simulator's flight i is this one of its catalogue, so that few flights hold many kinds
_STRIDE, _CATALOGUE = 7, 33


def plan(own: int, other: int, first: int, catalogue: int, simulator: str) -> list[Task]:
    """Return the flights of a run: simulator, kind and number each."""
    out: list[Task] = []
    # in turn, so that a run that is stopped has both
    for i in range(max(own, other)):
        if i < own:
            out.append(("own", OF_TEN[i % len(OF_TEN)], first + i))
        if i >= other:
            continue
        place = i * _STRIDE % _CATALOGUE + _CATALOGUE * (catalogue + i // _CATALOGUE)
        out.append((simulator, "catalogue", place))
        if i % 4 == 0:
            out.append((simulator, "left out", place))
    return out


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m studies.probabilities")
    parser.add_argument(
        "--later",
        action="store_true",
        help="flights that the weights in use were not fitted to: 200 of either, of other numbers",
    )
    parser.add_argument("--own", type=int, help="flights of this project's plant")
    parser.add_argument("--other", type=int, help="flights of the other simulator")
    parser.add_argument("--simulator", default="../shared/generator/make_flights.py")
    parser.add_argument("--first", type=int, help="number of the first own flight")
    parser.add_argument("--catalogue", type=int, help="first of the other's catalogues")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=Path("results/probabilities"))
    parser.add_argument("--results", type=Path, help="what is kept for the page")
    parser.add_argument("--page", type=Path, default=None, help="page whose tables are made anew")
    parser.add_argument("--done", action="store_true", help="score only what has been kept")
    later = parser.parse_known_args()[0].later
    parser.set_defaults(
        own=200 if later else 350,
        other=200 if later else 350,
        first=850_000 if later else 800_000,
        catalogue=5000 if later else 3000,
        results=LATER if later else RESULTS,
    )
    given = parser.parse_args()
    if not given.done:
        wanted = plan(given.own, given.other, given.first, given.catalogue, given.simulator)
        outcomes = run_tasks(recorded, wanted, given.out / "flights.jsonl", given.jobs)
        kept = [
            {"task": ["own" if task[0] == "own" else "other", *task[1:]], "result": result}
            for task, result in outcomes.items()
        ]
        lines = ",\n".join(json.dumps(x) for x in kept)
        write_text(f"[\n{lines}\n]\n", given.results)
    records = json.loads(gzip.decompress(given.results.read_bytes()))
    text = tables_of_later_flights(records) if later else tables(records)
    put_between(text, given.page, LATER_PART if later else "tables")
    print(text)
