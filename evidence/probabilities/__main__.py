"""``python -m evidence.probabilities`` flies and diagnoses flights whose truth is known, and keeps
what ``docs/trust.md`` shows of their probabilities.
"""

from pathlib import Path
from typing import Annotated

import typer

from windwrench.evidence.kept_results import DOCS
from windwrench.evidence.probabilities.calibration import RESULTS
from windwrench.evidence.probabilities.flights import OF_TEN, WAYS_TO_LOG, recorded
from windwrench.evidence.runner import Jobs, Task, code_stamp, run_tasks, start
from windwrench.runtime.errors import unknown_name
from windwrench.runtime.page_files import write_json

_FIRST = {
    "first": (800_000, 3000),
    "later": (850_000, 5000),
    "other logs": (910_000, 170_000),
    "latest": (960_000, 7000),
}
_MODULES = "logged_poses", "outsiders", "practice_flights"
# the other simulator's flight i is this one of its catalogue, so that few flights hold many kinds
_STRIDE, _CATALOGUE = 7, 33


def plan(own: int, other: int, first: int, catalogue: int, simulator: str) -> list[Task]:
    """Return the flights of a run whose pose is logged: simulator, kind and number each."""
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


def plan_of_other_logs(flights: int, first: int, catalogue: int, simulator: str) -> list[Task]:
    """Return so many flights of each way to log but the pose; half of the filtered ones are of the
    other simulator.
    """
    out: list[Task] = []
    for i in range(flights):
        for j, way in enumerate(WAYS_TO_LOG[1:]):
            k = i // 2 if way == "filtered" else i
            if way != "filtered" or i % 2 == 0:
                out.append(("own", OF_TEN[k % len(OF_TEN)], first + flights * j + k, way))
            else:
                kind = "catalogue" if k % 5 else "left out"
                out.append((simulator, kind, catalogue + 7 * k, way))
    return out


def study(
    flights: Annotated[
        str, typer.Option(help=f"Which are flown and replace the kept ones: {', '.join(RESULTS)}.")
    ],
    count: Annotated[int, typer.Option(min=1, help="Flights of either simulator.")] = 350,
    simulator: Annotated[
        str, typer.Option(help="File of the other simulator.")
    ] = "../shared/generator/make_flights.py",
    jobs: Jobs = 1,
    out: Annotated[Path, typer.Option(help="Folder of what is done.")] = Path(
        "results/probabilities"
    ),
) -> None:
    """Fly, diagnose and keep flights."""
    if flights not in RESULTS:
        raise unknown_name("set of flights", flights, RESULTS)
    own, other = _FIRST[flights]
    wanted = (
        plan_of_other_logs(count, own, other, simulator)
        if flights == "other logs"
        else plan(count, count, own, other, simulator)
    )
    code = code_stamp("probabilities/flights", *(f"trials/{name}" for name in _MODULES))
    done = run_tasks(recorded, wanted, out / f"{flights}.jsonl", jobs, code)
    kept = [
        {"task": ["own" if task[0] == "own" else "other", *task[1:]], "result": result}
        for task, result in done.items()
    ]
    write_json(kept, DOCS / RESULTS[flights])
    print(DOCS / RESULTS[flights])


if __name__ == "__main__":
    start(study)
