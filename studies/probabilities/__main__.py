"""``python -m studies.probabilities``; ``--help`` lists what it takes."""

import argparse
import json
from pathlib import Path

from windwrench.studies.page_tables import put_between
from windwrench.studies.probabilities.flights import KINDS, ranked
from windwrench.studies.probabilities.scores import tables
from windwrench.studies.resumed_tasks import Task, run_tasks

# of ten flights of the project's own simulator
_OF_TEN = ("single", "third", "pair", "nothing", "nothing", "outsider", "left out", "single")

if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m studies.probabilities")
    parser.add_argument("--own", type=int, default=40, help="flights of this project's plant")
    parser.add_argument("--other", type=int, default=33, help="flights of the other simulator")
    parser.add_argument("--simulator", default="../shared/generator/make_flights.py")
    parser.add_argument("--first", type=int, default=0, help="first number of a flight")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=Path("results/probabilities"))
    parser.add_argument("--page", type=Path, default=None, help="page whose tables are made anew")
    parser.add_argument("--done", action="store_true", help="score only what has been flown")
    given = parser.parse_args()
    wanted: list[Task] = [
        ("own", _OF_TEN[i % len(_OF_TEN)], given.first + i) for i in range(given.own)
    ]
    wanted += [
        (given.simulator, kind, given.first + i)
        for i in range(given.other)
        for kind in ("catalogue", *(("left out",) if i % 3 == 0 else ()))
    ]
    file = given.out / "flights.jsonl"
    if given.done:
        lines = [json.loads(x) for x in file.read_text(encoding="utf-8").splitlines()]
        outcomes = {tuple(x["task"]): x["result"] for x in lines}
    else:
        outcomes = run_tasks(ranked, wanted, file, given.jobs)
    text = tables(outcomes)
    put_between(text, given.page)
    print(text)
    assert set(KINDS) >= set(_OF_TEN)
