"""The study: vehicles drawn, flown, identified from their logs alone, compared with the truth."""

import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from windwrench.identification.vehicle_fit.geometry import parse_geometry
from windwrench.identification.vehicle_fit.identify import identify
from windwrench.runtime.page_files import write_json
from windwrench.studies.identified_vehicles.flights import VEHICLES, flown
from windwrench.studies.resumed_tasks import run_tasks


def runs(count: int) -> list[tuple[str, int, bool]]:
    """Return the first runs: preset, seed, and whether the logs hold commanded speeds."""
    return [
        (VEHICLES[i % len(VEHICLES)], i // len(VEHICLES), bool(i // len(VEHICLES) % 2))
        for i in range(count)
    ]


def fly_and_identify(name: str, seed: int, commanded: bool) -> dict[str, Any]:
    """Return truth and estimates of one drawn vehicle."""
    vehicle, lag, logs = flown(name, seed, commanded)
    begun = time.process_time()
    found = identify(logs, vehicle.mass, parse_geometry(str(vehicle.arm_l)))
    seconds = time.process_time() - begun
    truth = {
        "k": vehicle.k[0],
        "p": vehicle.p[0],
        "Jxx": vehicle.inertia[0, 0],
        "Jyy": vehicle.inertia[1, 1],
        "Jzz": vehicle.inertia[2, 2],
        "com x": 0.0,
        "com y": 0.0,
        **({"motor_lag": lag} if commanded else {}),
    }
    return {
        "vehicle": name,
        "seed": seed,
        "commanded": commanded,
        "cpu_s": round(seconds, 2),
        "lag_found": found["motor_lag"].status == "identified",
        "effects": [e.name for e in found.vehicle.effects],
        "quantities": {
            key: {
                "truth": float(value),
                "value": found[key].value,
                "low": found[key].low,
                "high": found[key].high,
                "status": found[key].status,
            }
            for key, value in truth.items()
        },
    }


def run(folder: Path, count: int, jobs: int = 1) -> list[dict[str, Any]]:
    """Make the runs that are not yet in the folder's ``runs.jsonl``; return all of them."""
    done = run_tasks(fly_and_identify, runs(count), folder / "runs.jsonl", jobs)
    return list(done.values())


def save(outcomes: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Write the runs as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_json(list(outcomes), path)


def quantities(outcomes: Iterable[Mapping[str, Any]]) -> dict[str, list[Mapping[str, Any]]]:
    """Return all runs' estimates by the quantity's name."""
    out: dict[str, list[Mapping[str, Any]]] = {}
    for outcome in outcomes:
        for name, estimate in outcome["quantities"].items():
            out.setdefault(name, []).append(estimate)
    return out
