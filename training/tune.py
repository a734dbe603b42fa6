"""Tuning the gains of the designed laws of every task, on validation episodes."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ..controllers.registry import STANDARD_TASK
from ..evaluation.episodes import fly_episode
from ..evaluation.tasks import TASKS, BenchmarkTask
from ..runtime.errors import InputError, unknown_name
from ..runtime.page_files import write_text
from ..runtime.yaml_file import read_yaml
from .seeds import validation_seeds
from .training_envs import training_task

_GAINS = read_yaml(Path(__file__).parent / "configs" / "gains.yaml", "ranges of gains")
RANGES: dict[str, dict[str, dict[str, list[float]]]] = _GAINS[
    "ranges"
]  # for each task, law and gain
STARTS: dict[str, dict[str, float]] = _GAINS["starts"]  # for each law
_PRUNE_AFTER = 10  # episodes


def check_request(task: str, law: str, scenario: str, trials: int, episodes: int) -> BenchmarkTask:
    """Check a request to ``tune``; return its task.

    Raises:
        InputError: an unknown task, law or scenario, no trials, or too many episodes.
    """
    known = training_task(task)
    if task not in RANGES:
        raise unknown_name("task", task, RANGES, "train tune")
    if law not in RANGES[task]:
        raise unknown_name("law", law, RANGES[task])
    known.scenario(scenario)
    if trials < 1:
        raise InputError(f"tune: trials must be at least 1, got {trials}")
    validation_seeds(episodes)
    return known


def first_gains(task: str, law: str) -> dict[str, float]:
    """Return the first gains of a search: from ``STARTS``, or the law's defaults, limited to the
    ranges.
    """
    defaults = {**vars(TASKS[task].laws[law]()), **STARTS.get(law, {})}
    ranges = RANGES[task][law].items()
    return {name: float(min(max(defaults[name], low), high)) for name, (low, high) in ranges}


def tune(
    law: str,
    scenario: str,
    trials: int,
    episodes: int,
    seed: int = 0,
    advance: Callable[[int], None] = lambda done: None,
    task: str = STANDARD_TASK,
) -> dict[str, Any]:
    """Search a law's gains for the smallest mean RMSE over validation episodes (Optuna,
    tree-structured Parzen estimator).

    Args:
        law: a key of ``RANGES[task]``.
        scenario: one of the task's; for FanTracking also a tier.
        trials: number of gains tried, ``first_gains`` first.
        episodes: validation episodes of each; a trial far behind is given up after ten.
        seed: the search's.
        advance: called with the number of trials done.
        task: one of ``evaluation.tasks.TASKS``.

    Returns:
        ``gains``, ``rmse_m`` and ``lost`` of the best, ``default_rmse_m`` of the first gains tried,
            and the request.

    Raises:
        InputError: as ``check_request``.
    """
    import optuna

    tuned_task = check_request(task, law, scenario, trials, episodes)
    ranges = RANGES[task][law]
    seeds = validation_seeds(episodes)
    env = tuned_task.make(scenario)
    optuna.logging.set_verbosity(optuna.logging.WARNING)

    def objective(trial: Any) -> float:
        gains = {
            name: trial.suggest_float(name, low, high, log=True)
            for name, (low, high) in ranges.items()
        }
        controller = tuned_task.laws[law](**gains)
        rmse = []
        lost = 0
        for k, one in enumerate(seeds):
            episode = fly_episode(env, controller, one)
            rmse.append(episode.rmse)
            lost += episode.lost
            if k + 1 == _PRUNE_AFTER:
                trial.report(float(np.mean(rmse)), k + 1)
                if trial.should_prune():
                    raise optuna.TrialPruned
        trial.set_user_attr("lost", lost)
        return float(np.mean(rmse))

    study = optuna.create_study(
        sampler=optuna.samplers.TPESampler(seed=seed),
        pruner=optuna.pruners.PercentilePruner(60.0, n_startup_trials=4),
    )
    study.enqueue_trial(first_gains(task, law))
    study.optimize(
        objective, n_trials=trials, callbacks=[lambda _, trial: advance(trial.number + 1)]
    )
    return {
        "task": task,
        "law": law,
        "scenario": scenario,
        "gains": study.best_params,
        "rmse_m": study.best_value,
        "lost": study.best_trial.user_attrs["lost"],
        "default_rmse_m": study.trials[0].value,
        "trials": trials,
        "episodes": episodes,
        "seed": seed,
    }


def keep_gains(result: dict[str, Any], path: Path, command: str) -> None:
    """Write a search's gains into a file of tuned gains. They replace the entry for this law and
    scenario of FanTracking, or for this law of another task.

    Raises:
        InputError: the file is there but holds no gains.
    """
    tuned: Any = {}
    if path.exists():
        tuned = read_yaml(path, "tuned gains") or {}
        if not isinstance(tuned, dict) or not all(isinstance(v, dict) for v in tuned.values()):
            raise InputError(
                f"{path}: expected laws, scenarios and their gains, as in controllers/tuned.yaml"
            )
    places = ("law", "scenario") if result["task"] == STANDARD_TASK else ("task", "law")
    rounded = {name: float(f"{value:.4g}") for name, value in result["gains"].items()}
    tuned.setdefault(result[places[0]], {})[result[places[1]]] = {
        "gains": rounded,
        **{k: v for k, v in result.items() if k not in ("gains", "task", "law", places[1])},
        "command": command,
    }
    write_text(yaml.safe_dump(tuned, sort_keys=False, width=120), path)
