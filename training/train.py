"""Training a policy with stable-baselines3."""

import json
import platform
import re
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, fields
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..controllers.trained_policy import TrainedPolicy, save_policy
from ..evaluation.episodes import fly_episode
from ..runtime.errors import InputError
from ..runtime.regular_files import read_json
from ..runtime.whole_files import replaced
from .configuration import Config, features_of
from .seeds import FIRST_VALIDATION_SEED, training_seed, validation_seeds
from .training_envs import check_training_env, make_training_env, make_training_envs

_PACKAGES = ("stable-baselines3", "sb3-contrib", "torch", "numpy", "mujoco", "gymnasium", "numba")


@dataclass
class Progress:
    """How a run has gone so far; ``progress.json`` in its folder."""

    steps: list[int] = field(default_factory=list)  # of each validation
    rmse_m: list[float] = field(default_factory=list)  # mean over the validation episodes
    lost: list[int] = field(default_factory=list)  # episodes of each validation
    best: int = -1  # index of the best
    seconds: float = 0.0  # of all parts of the run, validation included

    @property
    def best_rmse(self) -> float:
        """The smallest validation RMSE, m."""
        return self.rmse_m[self.best]


def versions() -> dict[str, str]:
    """Return the versions that a policy was trained with."""
    found = {"windwrench": __version__, "python": platform.python_version()}
    for name in _PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


def card_of(config: Config, scenario: str, seed: int, steps: int, squash: bool) -> dict[str, Any]:
    """Return the card of a policy: all that is needed to fly it, and to train it again."""
    features = features_of(config)
    return {
        "algorithm": config["algorithm"],
        "scenario": scenario,
        "seed": seed,
        "steps": steps,
        "features": asdict(features),
        "repeat": config["repeat"],
        "activation": config["activation"],
        "squash": squash,
        "seeds": {
            "training": [0, FIRST_VALIDATION_SEED - 1],
            "validation": [
                FIRST_VALIDATION_SEED,
                FIRST_VALIDATION_SEED + config["validation"]["episodes"] - 1,
            ],
        },
        "config": config,
        "versions": versions(),
    }


def validate(policy: TrainedPolicy, env: Any, seeds: Sequence[int]) -> tuple[float, int]:
    """Fly validation episodes with the full filter; return the mean RMSE (m) and how many were
    lost.
    """
    flown = [fly_episode(env, policy, seed) for seed in seeds]
    return float(np.mean([e.rmse for e in flown])), sum(e.lost for e in flown)


def take_stock(
    policy: TrainedPolicy,
    card: dict[str, Any],
    progress: Progress,
    env: Any,
    seeds: Sequence[int],
    folder: Path,
) -> tuple[float, int]:
    """Validate a policy, save it as the last one, and as the best if it is, and note it in
    ``progress``.

    Returns:
        Its mean RMSE (m) and how many episodes were lost, as of ``validate``.
    """
    rmse, lost = validate(policy, env, seeds)
    progress.steps.append(card["steps"])
    progress.rmse_m.append(rmse)
    progress.lost.append(lost)
    card["validation"] = {"rmse_m": rmse, "lost": lost, "episodes": len(seeds)}
    save_policy(card, policy.weights, folder / "last.npz")
    if progress.best < 0 or rmse < progress.best_rmse:
        progress.best = len(progress.rmse_m) - 1
        save_policy(card, policy.weights, folder / "best.npz")
    return rmse, lost


def write_json(data: Any, path: Path) -> None:
    """Write JSON at once or not at all, each list of numbers on a line of its own."""
    text = json.dumps(data, indent=1, allow_nan=False)
    text = re.sub(r"\[\s+([^][{}]*?)\s+\]", lambda found: f"[{' '.join(found[1].split())}]", text)
    with replaced(path) as partial:
        partial.write_text(text + "\n", encoding="utf-8")


def progress_from(data: Any, path: Path) -> Progress:
    """Return the progress that a file holds.

    Raises:
        InputError: it holds something else.
    """
    try:
        progress = Progress(**data)
        counts = len(progress.steps), len(progress.rmse_m), len(progress.lost)
        whole = (
            len(set(counts)) == 1
            and -1 <= progress.best < counts[0]
            and all(isinstance(n, int) for n in (progress.best, *progress.steps, *progress.lost))
            and all(isinstance(x, int | float) for x in (progress.seconds, *progress.rmse_m))
        )
    except TypeError:
        whole = False
    if not whole:
        raise InputError(
            f"{path}: does not hold the progress of a training "
            f"({', '.join(f.name for f in fields(Progress))}); delete {path.parent} to start anew"
        )
    return progress


def read_progress(folder: Path) -> Progress | None:
    """Return how a run in ``folder`` has gone; None where there is none.

    Raises:
        InputError: the file cannot be read, or holds something else.
    """
    path = folder / "progress.json"
    if not path.exists():
        return None
    return progress_from(read_json(path, "the progress of a training"), path)


def claim(folder: Path, config: Config, scenario: str, seed: int) -> None:
    """Write what a run is into its folder.

    Raises:
        InputError: the folder holds another run.
    """
    path = folder / "training.json"
    run = {"config": config, "scenario": scenario, "seed": seed}
    if path.exists():
        kept = read_json(path, "what a training in this folder is")
        if not isinstance(kept, dict):
            raise InputError(
                f"{path}: does not say what the training in its folder is ({', '.join(run)}); "
                f"give another --out, or delete {folder}"
            )
        if {k: kept.get(k) for k in run} != run:
            raise InputError(
                f"{folder}: holds a run with another configuration, scenario or seed; "
                "give another --out, or delete it"
            )
    write_json({**run, "versions": versions()}, path)


def train(
    config: Config,
    scenario: str,
    seed: int,
    folder: Path,
    advance: Callable[[int], None] = lambda steps: None,
    report: Callable[[Progress], None] = lambda progress: None,
    stop_after: int | None = None,
) -> Path:
    """Train a policy; return the path of the best one on the validation episodes.

    ``folder`` then holds ``best.npz`` and ``last.npz`` with their cards, ``progress.json``,
    ``training.json``, TensorBoard's events, and ``checkpoint.pt``. Called again after a run was
    killed, it goes on from the last checkpoint and ends with the same policies, bit for bit, as a
    run that was not.

    Args:
        config: as of ``load_config``.
        scenario: scenario or tier to train in.
        seed: of the run.
        folder: for its files.
        advance: called with the number of decisions (over all environments) that the run stands at.
        report: called after each validation.
        stop_after: decisions after which to return early, at the next checkpoint; for tests.

    Raises:
        InputError: a scenario that does not exist, or a folder with another run.
    """
    from .checkpoint import load_checkpoint, save_checkpoint
    from .learners import make_learner, squashes, weights_of
    from .vec_env import FeatureVecEnv

    check_training_env(scenario)
    claim(folder, config, scenario, seed)
    features, algorithm = features_of(config), config["algorithm"]
    envs = make_training_envs(
        scenario, config["environments"], config["estimator"], config["repeat"], features.sources
    )
    env = FeatureVecEnv(
        envs, features, lambda i, episode: training_seed(seed, i, episode), config["reward"]
    )
    learner = make_learner(config, env, seed)
    learner.set_logger(_logger(folder))
    judge, seeds = (
        make_training_env(scenario, sources=features.sources),
        validation_seeds(config["validation"]["episodes"]),
    )
    progress, checkpoint = Progress(), folder / "checkpoint.pt"
    if checkpoint.exists():
        progress = progress_from(load_checkpoint(learner, env, checkpoint), checkpoint)
    every, between = config["validation"]["every"], config["checkpoint"]
    began, before = time.perf_counter(), progress.seconds
    follow = _follower(advance)
    while learner.num_timesteps < config["steps"]:
        done = learner.num_timesteps
        target = min((done // every + 1) * every, (done // between + 1) * between, config["steps"])
        learner.learn(target - done, callback=follow, reset_num_timesteps=False, log_interval=4)
        done = learner.num_timesteps
        if (
            done // every > (progress.steps[-1] // every if progress.steps else 0)
            or done >= config["steps"]
        ):
            card = card_of(config, scenario, seed, done, squashes(algorithm))
            policy = TrainedPolicy(card, weights_of(learner, algorithm))
            rmse, lost = take_stock(policy, card, progress, judge, seeds, folder)
            learner.logger.record("validation/rmse_m", rmse)
            learner.logger.record("validation/lost", lost)
            learner.logger.dump(done)
            report(progress)
        progress.seconds = before + time.perf_counter() - began
        write_json(asdict(progress), folder / "progress.json")
        if done // between > (done - 1) // between or done >= config["steps"]:
            save_checkpoint(learner, env, asdict(progress), checkpoint)
            if stop_after is not None and done >= stop_after:
                break
    env.close()
    return folder / "best.npz"


def _logger(folder: Path) -> Any:
    from stable_baselines3.common.logger import configure

    try:
        import torch.utils.tensorboard  # noqa: F401
    except ImportError:
        return configure(str(folder), ["csv"])
    return configure(str(folder / "tensorboard"), ["tensorboard"])


def _follower(advance: Callable[[int], None]) -> Any:
    from stable_baselines3.common.callbacks import BaseCallback

    class Follow(BaseCallback):  # type: ignore[misc]
        """Tell how far the run is, and what the episodes of training that ended were worth."""

        def _on_step(self) -> bool:
            advance(self.num_timesteps)
            for info in self.locals["infos"]:
                if "rmse" in info:
                    self.logger.record_mean("rollout/rmse_m", info["rmse"])
            return True

    return Follow()
