"""Tuning the hand-designed laws, on validation episodes, with the care that learning gets."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ..controllers import LAWS
from ..evaluation.episodes import fly_episode
from ..runtime.errors import InputError, unknown_name
from ..runtime.whole_files import replaced
from ..runtime.yaml_file import read_yaml
from .seeds import validation_seeds
from .training_envs import check_training_env, make_training_env

# the ranges searched, each on a logarithmic scale: far beyond what was seen to work
RANGES: dict[str, dict[str, tuple[float, float]]] = {
    "admittance": {"gain": (4.0, 80.0)},
    "ratio": {"gain": (1.5, 40.0), "least_force": (0.02, 0.5)},
    "lead": {"gain": (3.0, 40.0), "lead": (0.3, 15.0), "least_force": (0.02, 0.5)},
    "admittance-pid": {"gain": (4.0, 80.0), "integral": (0.05, 30.0), "lead": (0.1, 30.0)},
    "tracker": {
        "gain": (0.5, 5.0),
        "damping": (0.05, 2.0),
        "acceleration": (0.005, 0.3),
        "jumps": (0.05, 1.5),
        "speed": (0.1, 0.5),
    },
    "tracker-informed": {
        "gain": (0.5, 5.0),
        "damping": (0.05, 2.0),
        "ahead": (0.08, 0.8),
        "spread": (0.03, 0.4),
    },
}
# gains with which the search begins where they are not the law's own defaults: what it found has
# become those
STARTS: dict[str, dict[str, float]] = {
    "admittance-pid": {"gain": 18.0, "integral": 4.0, "lead": 4.0},
    "tracker": {"gain": 1.5, "damping": 0.3, "acceleration": 0.03, "jumps": 0.3, "speed": 0.25},
    "tracker-informed": {"gain": 2.0, "damping": 0.5, "ahead": 0.3, "spread": 0.1},
}
_PRUNE_AFTER = 10  # episodes


def check_law(name: str) -> None:
    """Check the name of a law that has something to tune.

    Raises:
        InputError: there is none of this name.
    """
    if name not in RANGES:
        raise unknown_name("law", name, RANGES)


def tune(
    law: str,
    scenario: str,
    trials: int,
    episodes: int,
    seed: int = 0,
    advance: Callable[[int], None] = lambda done: None,
) -> dict[str, Any]:
    """Search a law's gains for the smallest mean RMSE over validation episodes (Optuna,
    tree-structured Parzen estimator).

    Args:
        law: a key of ``RANGES``.
        scenario: scenario or tier.
        trials: gains tried; the first are the law's own defaults, or those of ``STARTS``.
        episodes: validation episodes of each; a trial far behind is given up after ten.
        seed: of the search.
        advance: called with the number of trials done.

    Returns:
        ``gains``, ``rmse_m`` and ``lost`` of the best, ``default_rmse_m`` of the first gains tried,
            and the request.

    Raises:
        InputError: an unknown law or scenario, no trials, or too many episodes.
    """
    import optuna

    check_law(law)
    check_training_env(scenario)
    if trials < 1:
        raise InputError(f"tune: --trials must be at least 1, got {trials}")
    seeds = validation_seeds(episodes)
    env: Any = make_training_env(scenario)
    optuna.logging.set_verbosity(optuna.logging.WARNING)

    def objective(trial: Any) -> float:
        gains = {
            name: trial.suggest_float(name, low, high, log=True)
            for name, (low, high) in RANGES[law].items()
        }
        controller, rmse, lost = LAWS[law](**gains), [], 0
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
    default = LAWS[law]()
    start = {name: float(getattr(default, name)) for name in RANGES[law]}
    study.enqueue_trial({**start, **STARTS.get(law, {})})
    study.optimize(
        objective, n_trials=trials, callbacks=[lambda _, trial: advance(trial.number + 1)]
    )
    return {
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


def keep_gains(found: dict[str, Any], path: Path, command: str) -> None:
    """Write what a search found into a file of tuned gains, in place of what it held for this law
    and scenario.

    Raises:
        InputError: the file is there but holds no gains.
    """
    kept: Any = {}
    if path.exists():
        kept = read_yaml(path, "tuned gains") or {}
        if not isinstance(kept, dict) or not all(isinstance(v, dict) for v in kept.values()):
            raise InputError(
                f"{path}: expected laws, scenarios and their gains, as in controllers/tuned.yaml"
            )
    rounded = {name: float(f"{value:.4g}") for name, value in found["gains"].items()}
    rest = {key: value for key, value in found.items() if key not in ("law", "scenario", "gains")}
    kept.setdefault(found["law"], {})[found["scenario"]] = {
        "gains": rounded,
        **rest,
        "command": command,
    }
    with replaced(path) as partial:
        partial.write_text(yaml.safe_dump(kept, sort_keys=False, width=120), encoding="utf-8")
