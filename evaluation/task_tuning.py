"""Gains of the laws of the tasks, found by search on validation episodes:
``python -m windwrench.evaluation.task_tuning``.

Every law gets the same budget: a quarter of the trials is spread evenly over the ranges (Halton's
sequence), the others are drawn about the best so far, ever closer. No episode is one that a
leaderboard scores.
"""

import argparse
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.stats import qmc

from ..controllers.task_laws import TASK_LAWS, task_gains
from ..runtime.errors import InputError, unknown_name
from ..runtime.whole_files import replaced
from .task_benchmark import TASKS, fly_task_episode, task_of

FIRST_VALIDATION_SEED = 700_000
_PID = {"kp": (0.5, 60.0), "kd": (0.1, 15.0)}
_KI = {"ki": (0.1, 60.0)}
# bounds of each gain; all are searched in the logarithm
RANGES: dict[str, dict[str, tuple[float, float]]] = {
    "pid": {**_PID, **_KI},
    "pid-force": {**_PID, **_KI, "gain": (0.3, 1.2), "lead": (0.02, 1.0)},
    "indi": {**_PID, "cutoff": (0.5, 10.0), "gain": (0.3, 1.2)},
    "l1": {**_PID, "pole": (0.3, 20.0), "bandwidth": (0.5, 30.0)},
    "admittance": {"gain": (4.0, 60.0), "gain_z": (4.0, 60.0)},
    "ratio": {"gain": (2.0, 30.0), "gain_z": (2.0, 30.0), "least_force": (0.03, 0.4)},
}
_ORACLES = {
    "FanTracking2D": {"gain": (0.5, 8.0)},
    "WindHover": {**_PID, **_KI, "gain": (0.5, 1.2), "preview": (0.03, 0.5)},
    "WindTrajectory": {**_PID, **_KI, "gain": (0.5, 1.2), "preview": (0.03, 0.5)},
}

_MODEL = "pid-force"  # the law that the oracle in the wind is, but for the force that it knows


def tune_task(
    task: str,
    law: str,
    scenario: str = "base",
    trials: int = 32,
    episodes: int = 10,
    seed: int = 0,
    report: Callable[[int, float], None] = lambda trial, best: None,
) -> dict[str, Any]:
    """Return the best gains of a law and how they were found.

    Raises:
        InputError: an unknown task or law, or one without gains.
    """
    known = task_of(task)
    if law not in TASK_LAWS[task] or law == "hover":
        raise unknown_name("law", law, [n for n in TASK_LAWS[task] if n != "hover"])
    if trials < 4 or episodes < 1:
        raise InputError(
            f"tune: expected at least 4 trials and 1 episode, got {trials} and {episodes}"
        )
    ranges = _ORACLES[task] if law == "oracle" else RANGES[law]
    low, high = (np.log([bounds[i] for bounds in ranges.values()]) for i in (0, 1))
    env, make = known.environment(scenario), TASK_LAWS[task][law]
    seeds = [FIRST_VALIDATION_SEED + i for i in range(episodes)]

    def flown(gains: Mapping[str, float]) -> tuple[float, int]:
        pilot = make(**gains)
        some = [fly_task_episode(env, pilot, s, known) for s in seeds]
        return float(np.mean([e.rmse for e in some])), sum(e.lost for e in some)

    rng = np.random.default_rng(seed)
    spread = max(trials // 4, 2)
    points = low + (high - low) * qmc.Halton(len(ranges), seed=rng).random(spread)
    if law == "oracle" and (model := task_gains().get(task, {}).get(_MODEL, {}).get("gains")):
        # the oracle is the same law with the true force: it begins with that law's gains
        points[0] = [
            math.log(model.get(name, 1.0) if name in _PID else known_start)
            for name, known_start in zip(ranges, np.exp(0.5 * (low + high)), strict=True)
        ]
    default = flown({})
    best, best_at = (math.inf, 0), 0.5 * (low + high)
    for trial in range(trials):
        if trial < spread:
            at = points[trial]
        else:
            width = 0.25 * (1.0 - 0.8 * (trial - spread) / (trials - spread))
            at = best_at + width * (high - low) * rng.standard_normal(len(low))
        at = np.clip(at, low, high)
        score = flown(_gains(ranges, at))
        if score[0] < best[0]:
            best, best_at = score, at
        report(trial, best[0])
    found = _gains(ranges, best_at)
    if default[0] <= best[0]:  # the law's own defaults
        found, best = {}, default
    return {
        "gains": found,
        "rmse_m": best[0],
        "lost": best[1],
        "default_rmse_m": default[0],
        "scenario": scenario,
        "trials": trials,
        "episodes": episodes,
        "seed": seed,
    }


def _gains(ranges: Mapping[str, Any], at: np.ndarray) -> dict[str, float]:
    return {name: float(f"{math.exp(v):.4g}") for name, v in zip(ranges, at.tolist(), strict=True)}


def main() -> None:
    """Tune laws and write what was found into the file of gains."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", choices=list(TASKS), required=True)
    parser.add_argument("--laws", default="", help="with commas between; default: all")
    parser.add_argument("--scenario", default="base")
    parser.add_argument("--trials", type=int, default=32)
    parser.add_argument("--episodes", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("controllers/task_gains.yaml"))
    given = parser.parse_args()
    laws = [x for x in given.laws.split(",") if x] or [
        name for name in TASK_LAWS[given.task] if name != "hover"
    ]
    for law in laws:
        found = tune_task(
            given.task,
            law,
            given.scenario,
            given.trials,
            given.episodes,
            given.seed,
            lambda trial, best, law=law: print(  # type: ignore[misc]
                f"{law}: trial {trial + 1}, best {best:.4f} m", flush=True
            ),
        )
        found["command"] = (
            f"python -m windwrench.evaluation.task_tuning --task {given.task} --laws {law} "
            f"--scenario {given.scenario} --trials {given.trials} --episodes {given.episodes} "
            f"--seed {given.seed}"
        )
        text = given.out.read_text(encoding="utf-8") if given.out.exists() else ""
        known = yaml.safe_load(text) or {}
        known.setdefault(given.task, {})[law] = found
        with replaced(given.out) as partial:
            partial.write_text(yaml.safe_dump(known, sort_keys=False), encoding="utf-8")


if __name__ == "__main__":
    main()
