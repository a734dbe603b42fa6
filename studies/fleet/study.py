"""The study: record the flights, diagnose them as a fleet, and count what it costs."""

import json
import resource
import time
from collections.abc import Callable, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

from windwrench import __version__
from windwrench.identification.fleet.drift import Fleet, fleet_of
from windwrench.identification.fleet.files import fleet_data, write_fleet
from windwrench.identification.fleet.flight import Job, diagnose_one
from windwrench.identification.fleet.manifest import FleetLog, find_logs
from windwrench.identification.fleet.outcomes import Outcomes
from windwrench.identification.fleet.running import OUTCOMES, rows, run_fleet
from windwrench.runtime.lasting_workers import Lost, crew_of, each
from windwrench.runtime.page_files import write_json
from windwrench.runtime.provenance import commit
from windwrench.studies.fleet.flights import SECONDS, Flight, drifting, flights, record, true_change

COUNTED_AT = (20, 50, 100, 200, 500)  # logs, at which memory and time are noted
_LIMIT_S = 600.0
_STARTS = 3  # processes that are started for nothing else
MEMORY = "memory.jsonl"


def _record(task: tuple[Flight, Path]) -> None:
    record(*task)


def run(
    count: int, folder: Path, jobs: int, report: Callable[[str, float], None]
) -> dict[str, Any]:
    """Record and diagnose so many flights; what is done is not done again.

    Args:
        count: flights.
        folder: of logs and results.
        jobs: processes.
        report: called with what is done, and its share.

    Returns:
        what the page shows.
    """
    made = commit()
    wanted, logs = flights(count), folder / "logs"
    missing = [(flight, logs) for flight in wanted if not flight.path(logs).exists()]
    if missing:
        with crew_of(_record, jobs) as (crew, several):
            for i, (task, result) in enumerate(each(missing, crew, several, _LIMIT_S), 1):
                if isinstance(result, Lost):
                    raise RuntimeError(f"{task[0].path(logs)}: {result.words}")
                report("recording", i / len(missing))
    found, _ = find_logs([logs])
    here = {str(flight.path(logs)) for flight in wanted}
    found = [log for log in found if log.path in here]
    place = {str(flight.path(logs)): flight.place for flight in wanted}
    found.sort(key=lambda log: place[log.path])  # individuals take turns
    outcomes = Outcomes(folder / OUTCOMES)

    def note(counts: Mapping[str, int]) -> None:
        total = sum(counts.values())
        report("diagnosing", total / count)
        if not counts["kept"]:
            memory = {"logs": total, "parent_mb": _peak_mb()}
            with (folder / MEMORY).open("a", encoding="utf-8") as file:
                file.write(json.dumps(memory) + "\n")

    steady = next(log for log in found if "steady" in log.id)
    with closing(outcomes):
        done = run_fleet(found, outcomes, jobs=jobs, report=note)
        fleet = fleet_of(rows(done, outcomes))
        command = f"python -m studies.fleet --flights {count}"
        write_fleet(fleet, lambda: rows(done, outcomes), folder, command)
        costs = [
            {**cost, "id": one.log.id}
            for one in done
            if (cost := outcomes[one.key].get("cost")) is not None
        ]
    return {
        "version": __version__,
        "commit": made,
        "flights": count,
        "seconds": SECONDS,
        "jobs": jobs,
        "fleet": fleet_data(fleet),
        "refused": [
            {"log": row["log"], "kind": row["kind"], "reason": _last(row["reason"])}
            for row in _refused(done, folder)
        ],
        "costs": costs,
        "starts": starts(steady),
        "parent": _parent(folder / MEMORY),
        "truth": _truth(fleet, count),
    }


def _start(log: FleetLog) -> dict[str, float]:
    """Return what a process' start and its first diagnosis cost, and a later one, s of a core."""
    begun = time.process_time()
    cost = {"start": begun}
    for name in ("first", "second"):
        before = time.process_time()
        diagnose_one(Job(log, "00"))
        cost[name] = time.process_time() - before
    return cost


def starts(log: FleetLog) -> list[dict[str, float]]:
    """Return the costs of some processes, each started anew."""
    found = []
    for _ in range(_STARTS):
        with crew_of(_start, 1) as (crew, count):
            found += [cost for _, cost in each([log], crew, count, _LIMIT_S)]
    return found


def _refused(done: Any, folder: Path) -> list[dict[str, Any]]:
    with closing(Outcomes(folder / OUTCOMES)) as outcomes:
        return [row for row in rows(done, outcomes) if row["status"] == "refused"]


def _last(reason: str) -> str:
    """Return a reason without the folder of the log."""
    return reason.rpartition("/logs/")[2]


def _parent(path: Path) -> list[dict[str, Any]]:
    """Return the memory of the process that shares out the work, at some counts."""
    if not path.exists():
        return []
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    last = max((line["logs"] for line in lines), default=0)
    return [line for line in lines if line["logs"] in (*COUNTED_AT, last)]


def _truth(fleet: Fleet, count: int) -> list[dict[str, Any]]:
    """Return, of each individual, what truly drifts and what was told."""
    first = {flight.id: flight for flight in reversed(flights(count))}
    found = []
    for individual, counts in fleet.individuals.items():
        flight = first[individual]
        told = [
            {
                "effect": one.series.effect,
                "coefficient": one.series.coefficient,
                "per_flight": one.per_flight,
                "ci95": one.per_flight_ci95,
                "told": one.drifts,
                "tentative": one.tentative,
            }
            for one in fleet.trends
            if one.series.id == individual
        ]
        came = [one.effect for one in fleet.appearances if one.id == individual and one.changed]
        found.append(
            {
                "id": individual,
                "kind": flight.kind,
                "diagnosed": counts["diagnosed"],
                "drifts": list(drifting(flight.kind) or ()),
                "true_per_flight": true_change(flight.model, flight.kind),
                "trends": told,
                "came_or_went": came,
            }
        )
    return found


def _peak_mb() -> int:
    return round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)


def save(result: Mapping[str, Any], path: Path) -> None:
    """Write what the page shows."""
    write_json(result, path)
