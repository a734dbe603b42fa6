"""The study: vehicles drawn, flown, identified from their logs alone, compared with the truth."""

import json
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import as_completed
from pathlib import Path
from typing import Any

from windwrench.identification.vehicle_fit.geometry import parse_geometry
from windwrench.identification.vehicle_fit.identify import identify
from windwrench.runtime.page_files import write_json
from windwrench.runtime.workers import workers
from windwrench.studies.identified_vehicles.flights import VEHICLES, flown


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
    path = folder / "runs.jsonl"
    folder.mkdir(parents=True, exist_ok=True)
    done: dict[tuple[Any, ...], dict[str, Any]] = {}
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            kept = json.loads(line)
            done[kept["vehicle"], kept["seed"], kept["commanded"]] = kept
    wanted = runs(count)
    pending = [r for r in wanted if r not in done]
    if pending:
        with workers(jobs) as pool:
            running = {pool.submit(fly_and_identify, *r): r for r in pending}
            for future in as_completed(running):
                outcome = done[running[future]] = future.result()
                with path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(outcome) + "\n")
                print(f"{len(done)} of {len(wanted)} runs", flush=True)
    return [done[r] for r in wanted if r in done]


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
