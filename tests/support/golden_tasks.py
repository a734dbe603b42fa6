"""Trajectories of the tasks beside ``FanTracking``, as a few numbers.

``python -m tests.support.golden_tasks`` writes ``tests/golden/tasks.json`` anew. Do that only for a
change of physics that is meant, and say it in the environment's version history, with a new version
of the environment's name.
"""

import json

import numpy as np

from tests.support.paths import ROOT
from windwrench.evaluation.tasks import TASKS

GOLDEN = ROOT / "tests" / "golden" / "tasks.json"
SEED = 20261124
DECISIONS = 40
EVERY = 8  # decisions between two samples


def trajectory(task, scenario):
    """Return observations, true wrench (5, 6), error (5,) m and reward of an episode's first
    decisions.
    """
    env = TASKS[task].environment(scenario)
    actions = np.random.default_rng(SEED).uniform(-0.5, 0.5, (DECISIONS, *env.action_space.shape))
    env.reset(seed=SEED)
    kept = {"observation": [], "wrench": [], "error": [], "reward": []}
    for k, action in enumerate(actions.astype(np.float32), 1):
        observation, reward, _, _, info = env.step(action)
        if k % EVERY == 0:
            kept["observation"].append([float(x) for x in observation])
            kept["wrench"].append([float(x) for x in (*info["force"], *info["torque"])])
            kept["error"].append(float(info["error"]))
            kept["reward"].append(float(reward))
    return kept


if __name__ == "__main__":
    import gymnasium

    import windwrench  # noqa: F401 - registers the environments

    kept = {
        task: {
            "version": f"v{gymnasium.spec(f'windwrench/{task}-v0').version}",
            "seed": SEED,
            "scenarios": {name: trajectory(task, name) for name in TASKS[task].scenarios},
        }
        for task in TASKS
        if task != "FanTracking"
    }
    GOLDEN.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    print(f"wrote {GOLDEN}")
