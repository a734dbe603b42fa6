"""The study: practice flights, diagnosed by their IMU alone and with a few positions beside it."""

import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from windwrench.dynamics import load_vehicle
from windwrench.dynamics.effects import Role, get, names, playing
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.inference.commanded_rotors import in_flight_by_thrust
from windwrench.runtime.errors import InputError
from windwrench.runtime.page_files import write_json
from windwrench.studies.imu_logs.sensors import LOGS
from windwrench.studies.resumed_tasks import run_tasks
from windwrench.studies.scored_flights import Truth, fly, refused, scored, truth_of
from windwrench.studies.trials.practice_flights import shown_in

VEHICLE = "ardrone2"
EMPTY = ("excite", "fast", "hover", "yaw", "vertical")  # trajectories flown with nothing added
SECONDS = 30.0  # of each flight

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
    flown = fly(load_vehicle(VEHICLE), effect, trajectory, 2000 * (seed + 1), SECONDS, imu=True)
    if flown is None:
        return {}
    log = LOGS[kind_of_log](flown.log, flown.seed)
    begun = time.perf_counter()
    outcome: dict[str, Any] = {
        "effect": effect,
        "trajectory": trajectory,
        "seed": seed,
        "log": kind_of_log,
    }
    try:
        found = diagnose([log], flown.vehicle)
    except InputError as error:
        return {**outcome, **refused(error), "needs_pose": []}
    truth = truth_of(flown)
    if not np.isfinite(log.position).any():
        begun = in_flight_by_thrust(log, flown.vehicle).t[0]
        truth = in_axes_of_start(truth, flown.log.quaternion[np.searchsorted(log.t, begun)])
    return {
        **outcome,
        **scored(found, truth),
        "needs_pose": list(found.needs_pose),
        "seconds": round(time.perf_counter() - begun, 1),
    }


def in_axes_of_start(truth: Truth, quaternion: NDArray[np.float64]) -> dict[str, dict[str, float]]:
    """Return coefficients with a steady force along the horizontal axes in which the vehicle
    pointed where its flight began, with an attitude (4,): a log without a pose knows no others.
    """
    w, x, y, z = quaternion
    heading = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    out = {effect: dict(values) for effect, values in truth.items()}
    for effect in playing(Role.STEADY_FORCE, among=truth):
        along, across = (c.name for c in get(effect).coefficients[:2])
        fx, fy = (truth[effect].get(name, 0.0) for name in (along, across))
        out[effect] |= {
            along: float(np.cos(heading) * fx + np.sin(heading) * fy),
            across: float(np.cos(heading) * fy - np.sin(heading) * fx),
        }
    return out


def can_show(outcome: Mapping[str, Any]) -> bool:
    """Return whether the log can show what was added, by the diagnosis' own list of what it
    cannot.
    """
    return outcome["effect"] not in outcome["needs_pose"]


def named(outcome: Mapping[str, Any]) -> bool:
    """Return whether the added effect is among the names, or is what one may be instead."""
    return any(
        outcome["effect"] in (e["name"], *e["indistinguishable_from"]) for e in outcome["effects"]
    )


def run(folder: Path, wanted: Sequence[Task], jobs: int = 1) -> list[dict[str, Any]]:
    """Fly and diagnose what is not yet in the folder's ``flights.jsonl``; return all outcomes."""
    done = run_tasks(fly_and_diagnose, wanted, folder / "flights.jsonl", jobs)
    return [outcome for outcome in done.values() if outcome]


def save(outcomes: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Write the outcomes as JSON; gzipped where ``path`` ends so."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_json(list(outcomes), path)
