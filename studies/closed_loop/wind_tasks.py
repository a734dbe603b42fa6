"""The amended model in the flight loop: the tasks in the wind flown before and after an effect was
found, and with laws that adapt without knowing it.

What was found is read from the results of
``windwrench close-loop``; nothing is diagnosed here. The true vehicle has the effect each time, and
the episodes are paired.
"""

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from windwrench.controllers.flight import FlightGains
from windwrench.controllers.task_laws import make_task_law
from windwrench.dynamics.vehicle import EffectSetting, Vehicle
from windwrench.dynamics.vehicle_file import load_vehicle
from windwrench.evaluation.episodes import benchmark_seeds, fly_episode
from windwrench.evaluation.tasks import TASKS
from windwrench.runtime.page_files import write_json
from windwrench.runtime.provenance import commit
from windwrench.runtime.regular_files import read_json
from windwrench.runtime.workers import workers
from windwrench.studies.closed_loop.closed_loop import (
    DEFAULT_EFFECTS,
    interval_of_mean,
    ratio_of_means,
)
from windwrench.studies.code_stamp import code_stamp

# laws that are flown with every model; the first adds nothing to the flight loop
LAWS = ("hover", "pid-force")
ADAPTIVE = ("l1", "indi")  # laws that know the declared model alone
MODELS = ("declared", "amended", "exact")
# the attitude loop twice as quick: half the time, so four times the stiffness
_QUICK = FlightGains(attitude=4.0 * FlightGains.attitude, rate=2.0 * FlightGains.rate)


@dataclass(frozen=True)
class Setting:
    """Where an effect is flown."""

    name: str
    title: str
    task: str
    scenario: str
    gains: FlightGains | None = None


SETTINGS = (
    Setting("trajectory-calm", "WindTrajectory, `calm`", "WindTrajectory", "calm"),
    Setting(
        "trajectory-calm-quick",
        "WindTrajectory, `calm`, attitude loop twice as quick",
        "WindTrajectory",
        "calm",
        _QUICK,
    ),
    Setting("trajectory-base", "WindTrajectory, `base`", "WindTrajectory", "base"),
    Setting("hover-calm", "WindHover, `calm`", "WindHover", "calm"),
    Setting(
        "hover-calm-quick",
        "WindHover, `calm`, attitude loop twice as quick",
        "WindHover",
        "calm",
        _QUICK,
    ),
    Setting("hover-base", "WindHover, `base`", "WindHover", "base"),
)


@dataclass(frozen=True)
class _Job:
    setting: Setting
    effect: EffectSetting
    found: tuple[EffectSetting, ...]
    vehicle: Vehicle
    seeds: tuple[int, ...]


def _fly(job: _Job) -> dict[str, Any]:
    """Return RMSE (m) of every episode and the episodes lost, by law and model."""
    setting, vehicle = job.setting, job.vehicle
    models = {
        "declared": vehicle,
        "amended": vehicle.with_effects(*vehicle.effects, *job.found),
        "exact": vehicle.with_effects(*vehicle.effects, job.effect),
    }
    task, out = TASKS[setting.task], {}
    for model, known in models.items():
        env = task.environment(
            setting.scenario,
            vehicle=known,
            truth=vehicle,
            effects=(job.effect,),
            gains=setting.gains,
        )
        for name in (*LAWS, *(ADAPTIVE if model == "declared" else ())):
            law = make_task_law(name, setting.task)
            flown = [fly_episode(env, law, seed, decisions=task.decisions) for seed in job.seeds]
            out[f"{name} {model}"] = {
                "rmse_m": [float(f"{e.rmse:.6g}") for e in flown],
                "lost": sum(e.lost for e in flown),
            }
        env.close()
    return out


def compare(flights: Mapping[str, Any], law: str, after: str = "amended") -> dict[str, Any]:
    """Return the means before and after, their ratio and its paired 95 % interval."""
    before, then = flights[f"{law} declared"]["rmse_m"], flights[f"{law} {after}"]["rmse_m"]
    ratio, interval = ratio_of_means(before, then)
    return {
        "before": sum(before) / len(before),
        "after": sum(then) / len(then),
        "before_ci95": interval_of_mean(before),
        "after_ci95": interval_of_mean(then),
        "ratio": ratio,
        "ci95": interval,
    }


def result_path(folder: Path, setting: Setting) -> Path:
    """Return where the result of a setting is kept."""
    return folder / f"in-flight-{setting.name}.json"


def study(
    folder: Path,
    setting: Setting,
    episodes: int,
    seed: int,
    jobs: int | None = None,
    report: Callable[[str, float], None] = lambda setting, share: None,
) -> dict[str, Any]:
    """Fly all effects in a setting; what lies in the folder already is not flown again.

    Args:
        folder: of the results of ``windwrench close-loop``, by which the effects are known; the
            result goes there, too.
        setting: where the effects are flown.
        episodes: of each law, with each model of each effect, paired.
        seed: of the benchmark.
        jobs: processes; default: one a core. The results do not depend on it.
        report: called with the setting and the share of it that is done.

    Raises:
        InputError: the folder lacks a result of ``windwrench close-loop``.
    """
    request = {
        "setting": setting.name,
        "episodes": episodes,
        "seed": seed,
        "code": code_stamp("closed_loop/wind_tasks"),
    }
    path = result_path(folder, setting)
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        result: dict[str, Any] = kept if kept["request"] == request else {}
    except (OSError, ValueError, TypeError, KeyError):
        result = {}
    result = result or {"request": request, "commit": commit(), "effects": {}}
    done = result["effects"]
    seeds = tuple(benchmark_seeds(seed, episodes))
    pending = {
        name: _job(folder, setting, name, seeds) for name in DEFAULT_EFFECTS if name not in done
    }

    def take(name: str, flights: dict[str, Any]) -> None:
        done[name] = flights
        write_json(result, path)
        report(setting.name, len(done) / len(DEFAULT_EFFECTS))

    report(setting.name, len(done) / len(DEFAULT_EFFECTS))
    count = min(jobs or os.cpu_count() or 1, len(pending))
    if count == 1:
        for name, job in pending.items():
            take(name, _fly(job))
    elif count > 1:
        with workers(count) as pool:
            for name, flights in zip(pending, pool.map(_fly, pending.values()), strict=True):
                take(name, flights)
    return result


def _job(folder: Path, setting: Setting, name: str, seeds: tuple[int, ...]) -> _Job:
    closed = read_json(folder / f"{name}.json", "a result of windwrench close-loop")
    added = closed["request"]
    return _Job(
        setting,
        EffectSetting(added["effect"], added["coefficients"]),
        tuple(EffectSetting(e["name"], e["coefficients"]) for e in closed["diagnosis"]["effects"]),
        load_vehicle(added["vehicle"]),
        seeds,
    )
