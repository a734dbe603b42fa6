"""What the felt wrench is worth: the same law and the same learner, retrained for each observation.

``python -m windwrench.evidence.felt_wrench``: on all tasks, in ``base`` and ``noisy``, the linear
law by hindsight and plain PPO learn from the four observations of ``windwrench.envs``, at equal
budget. Every policy flies the same test episodes, whose seeds no training draws. A figure is the
relative change of the mean RMSE after 3 s where something is taken from the observation; its
interval is over policies and episodes (``evaluation.statistics``). In the fan's tasks an
accelerometer draws its own noise: fan and start are the same, the rest of the noise is not.
"""

import json
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import torch
import typer
from numpy.typing import ArrayLike, NDArray

from windwrench import __version__
from windwrench.controllers.trained_policy import load_policy
from windwrench.envs import OBSERVATIONS
from windwrench.evaluation.episodes import benchmark_seeds, fly_episode
from windwrench.evaluation.statistics import hierarchical_bootstrap, mean, relative_change
from windwrench.evaluation.tasks import task_of
from windwrench.evidence.kept_results import DOCS
from windwrench.evidence.runner import Jobs, kept_lines, run_tasks, start
from windwrench.runtime.code_digest import code_digest
from windwrench.runtime.page_files import write_json
from windwrench.runtime.provenance import commit
from windwrench.training.configuration import load_config
from windwrench.training.task_policies import linear
from windwrench.training.train import train

Array = NDArray[np.float64]
Cell = tuple[Any, ...]  # as the arguments of ``flown``

RESULTS = "results/tasks/felt_wrench.json"  # below docs/
LAW, LEARNER = "linear", "ppo"
WORLDS: Sequence[tuple[str, str]] = (
    ("FanTracking", "noisy"),
    ("FanTracking", "base"),
    ("WindHover", "noisy"),
    ("FanTracking2D", "noisy"),
    ("WindTrajectory", "noisy"),
    ("FanTracking2D", "base"),
    ("WindHover", "base"),
    ("WindTrajectory", "base"),
)
# what is taken, and from what: changes from the second observation to the first
TAKEN = {
    "wrench": ("imu", "all"),
    "accelerometer": ("wrench", "all"),
    "both": ("pose", "all"),
    "wrench where there is no accelerometer": ("pose", "wrench"),
}
TEST_SEED = 6805  # of the benchmark
LAW_EPISODES = 64  # of each of four rounds
STEPS = 100_000  # decisions of the learner
# configuration of the learner, the same for all observations: chosen with "all" on validation
# episodes
SETTINGS = (
    "estimator=ukf-lanes",
    "environments=64",
    "learner.n_steps=64",
    "learner.batch_size=512",
    "learner.learning_rate=0.001",
    "learning_rate_end=0.0002",
    "learner.gamma=0.9",
    "checkpoint=1000000000",
    "validation.every=25000",
    "validation.episodes=8",
)
_ROOMS = (
    *("core", "runtime", "dynamics", "estimator", "controllers", "envs"),
    *("evaluation", "training"),
)


def flown(
    kind: str, task: str, scenario: str, observation: str, seed: int, steps: int, episodes: int
) -> dict[str, Any]:
    """Train one policy and fly it.

    Args:
        kind: ``LAW`` or ``LEARNER``.
        task: its name.
        scenario: of training and test.
        observation: one of ``OBSERVATIONS``.
        seed: of the training.
        steps: decisions of the learner; of the law, episodes of each round.
        episodes: to test it in.

    Returns: ``rmse_settled_m`` of each episode, ``lost`` episodes and ``training_cpu_s``.
    """
    began, known = time.process_time(), task_of(task)
    policy = trained(kind, task, scenario, observation, seed, steps)
    seconds = time.process_time() - began
    env = known.make(scenario, observation=observation)
    tested = [fly_episode(env, policy, each) for each in benchmark_seeds(TEST_SEED, episodes)]
    return {
        "rmse_settled_m": [round(each.rmse_settled, 6) for each in tested],
        "lost": sum(each.lost for each in tested),
        "training_cpu_s": round(seconds, 1),
    }


def trained(kind: str, task: str, scenario: str, observation: str, seed: int, steps: int) -> Any:
    """Return a policy; arguments as of ``flown``."""
    torch.set_num_threads(1)
    if kind == LAW:
        return linear(task, scenario, seed, observation, episodes=steps)
    config = load_config(LEARNER, [*SETTINGS, f"steps={steps}"], task=task)
    with tempfile.TemporaryDirectory() as folder:
        path = train(config, scenario, seed, Path(folder), task=task, observation=observation)
        return load_policy(path)


def change(fewer: ArrayLike, more: ArrayLike) -> dict[str, Any]:
    """Return the relative change of the mean from ``more`` to ``fewer``, matrices (policies,
    episodes) of the same episodes, and its 95 % interval.
    """
    interval = hierarchical_bootstrap(relative_change, fewer, more)
    return {"change": float(relative_change(fewer, more)), "ci95": list(interval)}


def rows(results: Mapping[Cell, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return a row for each kind and world: figures by observation, and changes by what is
    taken. A training seed counts where all observations have been flown.
    """
    whole = [key for key in results if all(_beside(key, o) in results for o in OBSERVATIONS)]
    found: dict[tuple[str, str, str], dict[str, list[Mapping[str, Any]]]] = {}
    for key in whole:
        world = found.setdefault(key[:3], {})
        world.setdefault(key[3], []).append(results[key])
    return [_row(*key, by_observation) for key, by_observation in found.items()]


def _beside(key: Cell, observation: str) -> Cell:
    """Return the same policy's cell of another observation."""
    return (*key[:3], observation, *key[4:])


def _row(
    kind: str, task: str, scenario: str, found: Mapping[str, Sequence[Mapping[str, Any]]]
) -> dict[str, Any]:
    scores = {o: np.array([one["rmse_settled_m"] for one in each]) for o, each in found.items()}
    seconds = [one["training_cpu_s"] for each in found.values() for one in each]
    return {
        "kind": kind,
        "task": task,
        "scenario": scenario,
        "policies": len(scores["all"]),
        "rmse_settled_m": {o: float(mean(each)) for o, each in scores.items()},
        "lost": {o: sum(one["lost"] for one in each) for o, each in found.items()},
        "taken": {name: change(scores[a], scores[b]) for name, (a, b) in TAKEN.items()},
        "training_cpu_s": float(np.mean(seconds)),
    }


def study(
    out: Annotated[Path, typer.Option(help="Results file.")] = DOCS / RESULTS,
    done: Annotated[Path, typer.Option(help="File of finished policies.")] = Path(
        "results/felt_wrench.jsonl"
    ),
    quick: Annotated[bool, typer.Option(help="A few short trainings, to see that it works.")] = (
        False
    ),
    finished: Annotated[
        bool, typer.Option(help="Write what is finished, and fly nothing more.")
    ] = False,
    seeds: Annotated[int, typer.Option(min=1, help="Trainings of each learned policy.")] = 2,
    jobs: Jobs = 1,
) -> None:
    """Retrain and fly all policies; an interrupted study goes on."""
    worlds, law_episodes, steps, episodes = WORLDS, LAW_EPISODES, STEPS, 40
    if quick:
        worlds, law_episodes, steps, episodes, seeds = WORLDS[:1], 8, 8192, 4, 1
    code = commit()
    # what leads comes first: a study that is stopped has it
    parts = [(LAW, worlds[:5]), (LEARNER, worlds[:2]), (LAW, worlds[5:]), (LEARNER, worlds[2:])]
    sizes = {LAW: (law_episodes, 1), LEARNER: (steps, seeds)}
    wanted: list[Any] = [
        (kind, task, scenario, observation, seed, sizes[kind][0], episodes)
        for kind, some in parts
        for task, scenario in some
        for seed in range(sizes[kind][1])
        for observation in OBSERVATIONS
    ]
    stamp = code_digest(_ROOMS, ("evidence/felt_wrench.py",))
    if finished:
        kept = {tuple(json.loads(key)): result for key, result in kept_lines(done, stamp)}
        results = {task: kept[task] for task in wanted if task in kept}
    else:
        results = run_tasks(flown, wanted, done, jobs, stamp)
    request = {"seeds": seeds, "law_episodes": law_episodes, "steps": steps, "episodes": episodes}
    request |= {"test_seed": TEST_SEED}
    told = {"version": __version__, "commit": code, "request": request, "settings": SETTINGS}
    write_json({**told, "rows": rows(results)}, out)


if __name__ == "__main__":
    start(study)
