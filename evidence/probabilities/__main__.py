"""``python -m evidence.probabilities`` flies and diagnoses flights whose truth is known, and keeps
what ``docs/trust.md`` shows of their probabilities.

Flights are of two simulators: this project's plant, and one that was written apart from it, with
another plant, vehicle, controller and trajectories. *Something unknown* is a cause outside the
library. An effect counts as one if the library lacks the effect and all that can stand for it.
"""

from pathlib import Path
from typing import Annotated

import typer

from windwrench import __version__
from windwrench.evidence.kept_results import DOCS
from windwrench.evidence.probabilities.calibration import RESULTS
from windwrench.evidence.probabilities.flights import OF_TEN, WAYS_TO_LOG, recorded
from windwrench.evidence.runner import Jobs, Task, code_stamp, run_tasks, start
from windwrench.runtime.page_files import write_json
from windwrench.runtime.provenance import commit

_OWN, _OTHER = 960_000, 7000  # the first flight of either simulator
_OTHER_LOGS = 970_000
_MODULES = "logged_poses", "outsiders", "practice_flights"
# the other simulator's flight i is this one of its catalogue, so that few flights hold many kinds
_STRIDE, _CATALOGUE = 7, 33


def plan(count: int, simulator: str) -> list[Task]:
    """Return so many flights of either simulator whose pose is logged, and as many whose pose is
    not: simulator, kind, number and way to log each.
    """
    out: list[Task] = []
    for i in range(count):
        out.append(("own", OF_TEN[i % len(OF_TEN)], _OWN + i))
        place = i * _STRIDE % _CATALOGUE + _CATALOGUE * (_OTHER + i // _CATALOGUE)
        out.append((simulator, "catalogue", place))
        if i % 4 == 0:
            out.append((simulator, "left out", place))
        way = WAYS_TO_LOG[1 + i % (len(WAYS_TO_LOG) - 1)]
        out.append(("own", OF_TEN[i % len(OF_TEN)], _OTHER_LOGS + i, way))
    return out


def study(
    count: Annotated[int, typer.Option(min=1, help="Flights of either simulator.")] = 12,
    simulator: Annotated[Path, typer.Option(help="File of the other simulator.")] = Path(
        "../shared/generator/make_flights.py"
    ),
    jobs: Jobs = 1,
    out: Annotated[Path, typer.Option(help="Folder of what is done.")] = Path(
        "results/probabilities"
    ),
) -> None:
    """Fly, diagnose and keep flights."""
    code = commit()
    stamp = code_stamp("probabilities/flights", *(f"trials/{name}" for name in _MODULES))
    done = run_tasks(recorded, plan(count, str(simulator)), out / "flights.jsonl", jobs, stamp)
    flights = [
        {"task": ["own" if task[0] == "own" else "other", *task[1:]], "result": result}
        for task, result in done.items()
    ]
    write_json({"version": __version__, "commit": code, "flights": flights}, DOCS / RESULTS)
    print(DOCS / RESULTS)


if __name__ == "__main__":
    start(study)
