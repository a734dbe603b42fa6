"""The study: practice flights, diagnosed by their IMU alone and with a few positions beside it."""

import json
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import as_completed
from pathlib import Path
from typing import Any

import numpy as np

from windwrench.dynamics import load_vehicle
from windwrench.dynamics.effects import names
from windwrench.identification.diagnosis import diagnose
from windwrench.runtime.errors import InputError
from windwrench.runtime.page_files import write_json
from windwrench.runtime.workers import workers
from windwrench.studies.imu_logs.sensors import LOGS
from windwrench.studies.trials.practice_flights import practise, shown_in
from windwrench.studies.trials.scores import coefficient_errors, match

VEHICLE = "ardrone2"
EMPTY = ("excite", "fast", "hover", "yaw", "vertical")  # trajectories flown with nothing added
SECONDS = 30.0  # of each flight
_ATTEMPTS = 4  # draws of a flight that a flight loop may be unable to fly


Task = tuple[str, str, int, str]  # the added effect, the trajectory, the seed, the kind of log


def tasks(seeds: Iterable[int] = (0,), logs: Iterable[str] = tuple(LOGS)) -> list[Task]:
    """Return what is flown and diagnosed: the added effect (empty: none), the trajectory, the seed
    and the kind of log.
    """
    return [
        (effect, trajectory, seed, log)
        for log in logs
        for seed in seeds
        for effect, trajectory in (
            *((name, shown_in(name)[0]) for name in names()),
            *(("", trajectory) for trajectory in EMPTY),
        )
    ]


def fly_and_diagnose(effect: str, trajectory: str, seed: int, kind_of_log: str) -> dict[str, Any]:
    """Return what is found on one flight, empty where no flight loop flies it."""
    vehicle = load_vehicle(VEHICLE)
    for attempt in range(_ATTEMPTS):
        try:
            flown = practise(
                vehicle,
                "effect" if effect else "nothing",
                (effect,) if effect else (),
                "typical",
                trajectory,
                2000 * (seed + 1) + attempt,
                SECONDS,
                imu=True,
            )
            break
        except InputError:
            continue
    else:
        return {}
    truth = {e.name: dict(e.coefficients) for e in flown.effects}
    return {
        "effect": effect,
        "trajectory": trajectory,
        "seed": seed,
        "log": kind_of_log,
        **_outcome(LOGS[kind_of_log](flown.log, flown.seed), flown.vehicle, truth),
    }


def _outcome(log: Any, vehicle: Any, truth: Mapping[str, Mapping[str, float]]) -> dict[str, Any]:
    begun = time.perf_counter()
    try:
        found = diagnose([log], vehicle)
    except InputError as error:
        return {"refused": str(error), "effects": [], "errors": {}, "needs_pose": []}
    effects: list[dict[str, Any]] = [
        {
            "name": e.name,
            "tentative": e.tentative,
            "indistinguishable_from": list(e.indistinguishable_from),
            "coefficients": dict(e.coefficients),
            "std": dict(e.std),
            "channels": list(e.channels),
        }
        for e in found.effects
    ]
    pairs = match(effects, list(truth)) if effects else None
    own = [(e["name"], e["name"]) for e in effects if e["name"] in truth]
    return {
        "verdict": found.verdict,
        "remainder": found.remainder,
        "needs_pose": list(found.needs_pose),
        "effects": effects,
        "errors": {
            key: [round(x, 4) for x in error]
            for key, error in coefficient_errors(effects, truth, pairs or own).items()
            if np.isfinite(error).all()
        },
        "seconds": round(time.perf_counter() - begun, 1),
    }


def can_show(outcome: Mapping[str, Any]) -> bool:
    """Return whether the log can show what was added, by the diagnosis' own list of what it
    cannot.
    """
    return outcome["effect"] not in outcome["needs_pose"]


def kind(outcome: Mapping[str, Any]) -> str:
    """Return what a diagnosis is: right or wrong, sure or tentative, silent (nothing named where
    something was added), or refused.
    """
    if "refused" in outcome:
        return "refused"
    effects, truth = outcome["effects"], [outcome["effect"]] if outcome["effect"] else []
    if not effects:
        return "silent" if truth else "right, sure"
    sure = [e for e in effects if not e["tentative"]]
    if any(not {e["name"], *e["indistinguishable_from"]} & set(truth) for e in sure):
        return "wrong, sure"
    right = match(effects, truth) is not None
    return (
        f"{'right' if right else 'wrong'}, {'sure' if len(sure) == len(effects) else 'tentative'}"
    )


def named(outcome: Mapping[str, Any]) -> bool:
    """Return whether the added effect is among the names, or is what one may be instead."""
    return any(
        outcome["effect"] in (e["name"], *e["indistinguishable_from"]) for e in outcome["effects"]
    )


def run(folder: Path, wanted: Sequence[Task], jobs: int = 1) -> list[dict[str, Any]]:
    """Fly and diagnose what is not yet in the folder's ``flights.jsonl``; return all outcomes."""
    path = folder / "flights.jsonl"
    folder.mkdir(parents=True, exist_ok=True)
    done = {}
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            kept = json.loads(line)
            done[tuple(kept["task"])] = kept["outcome"]
    pending = [task for task in wanted if task not in done]
    if pending:
        with workers(jobs) as pool:
            running = {pool.submit(fly_and_diagnose, *task): task for task in pending}
            for future in as_completed(running):
                task = running[future]
                done[task] = future.result()
                with path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps({"task": task, "outcome": done[task]}) + "\n")
                print(f"{len(done)} of {len(wanted)} logs", flush=True)
    return [outcome for outcome in done.values() if outcome]


def save(outcomes: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Write the outcomes as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_json(list(outcomes), path)
