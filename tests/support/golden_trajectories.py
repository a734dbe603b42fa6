"""Trajectories of every task and scenario, as a few numbers: what a change of the physics changes.

``python -m tests.support.golden_trajectories`` writes ``tests/golden/trajectories.json``, of
``FanTracking`` under its admittance law, and ``tests/golden/tasks.json``, of the other tasks under
random commands, anew. Do that only for a change of physics that is meant, and say it in the
environment's version history, with a new version of the environment's name.
"""

import json

import gymnasium
import numpy as np
from numpy.random import default_rng

import windwrench  # noqa: F401 - registers the environments
from tests.support.paths import ROOT
from windwrench.controllers import make_controller
from windwrench.evaluation.tasks import TASKS

GOLDEN = ROOT / "tests" / "golden" / "trajectories.json"
GOLDEN_TASKS = ROOT / "tests" / "golden" / "tasks.json"
SEED = 20161009
SEED_OF_TASKS = 20261124
DECISIONS = 40
EVERY = 8  # decisions between two samples


def trajectory(task, scenario):
    """Return observations, true wrench (5, 6), reward (5,), and ``y`` (FanTracking) or ``error``
    (5,) in m, of an episode's first decisions.
    """
    env = TASKS[task].environment(scenario)
    is_fan = task == "FanTracking"
    seed, place = (SEED, "y") if is_fan else (SEED_OF_TASKS, "error")
    drawn = default_rng(seed).uniform(-0.5, 0.5, (DECISIONS, *env.action_space.shape))
    pilot = make_controller("admittance")
    pilot.reset()
    observation, info = env.reset(seed=seed)
    kept = {"observation": [], "wrench": [], place: [], "reward": []}
    for k in range(1, DECISIONS + 1):
        action = pilot(observation, info) if is_fan else drawn[k - 1]
        observation, reward, _, _, info = env.step(np.asarray(action, dtype=np.float32))
        if k % EVERY == 0:
            kept["observation"].append([float(x) for x in observation])
            kept["wrench"].append([float(x) for x in (*info["force"], *info["torque"])])
            kept[place].append(float(info[place]))
            kept["reward"].append(float(reward))
    return kept


def recorded(task):
    """Return what is kept of a task."""
    return {
        "version": f"v{gymnasium.spec(f'windwrench/{task}-v0').version}",
        "seed": SEED if task == "FanTracking" else SEED_OF_TASKS,
        "scenarios": {name: trajectory(task, name) for name in TASKS[task].scenarios},
    }


if __name__ == "__main__":
    others = {task: recorded(task) for task in TASKS if task != "FanTracking"}
    for path, kept in ((GOLDEN, recorded("FanTracking")), (GOLDEN_TASKS, others)):
        path.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
        print(f"wrote {path}")
