"""Trajectories of every scenario, as a few numbers: what a change of the physics changes.

``python -m tests.support.golden_trajectories`` writes ``tests/golden/trajectories.json`` anew. Do
that only for a change of physics that is meant, and say it in the environment's version history,
with a new version of the environment's name.
"""

import json

import numpy as np

from tests.support.paths import ROOT
from windwrench.controllers import make_controller
from windwrench.envs import FanTrackingEnv
from windwrench.envs.scenarios import SCENARIOS

GOLDEN = ROOT / "tests" / "golden" / "trajectories.json"
SEED = 20161009
DECISIONS = 40  # 3.2 s
EVERY = 8  # decisions between two samples


def trajectory(scenario):
    """Return observations (5, 8), true wrench (5, 6) and position (5,) y in m of an episode's first
    seconds.
    """
    env, pilot = FanTrackingEnv(scenario), make_controller("admittance")
    pilot.reset()
    observation, info = env.reset(seed=SEED)
    kept = {"observation": [], "wrench": [], "y": [], "reward": []}
    for k in range(1, DECISIONS + 1):
        observation, reward, _, _, info = env.step(
            np.asarray(pilot(observation, info), dtype=np.float32)
        )
        if k % EVERY == 0:
            kept["observation"].append([float(x) for x in observation])
            kept["wrench"].append([float(x) for x in (*info["force"], *info["torque"])])
            kept["y"].append(float(info["y"]))
            kept["reward"].append(float(reward))
    return kept


if __name__ == "__main__":
    import gymnasium

    import windwrench  # noqa: F401 - registers the environment

    version = f"v{gymnasium.spec('windwrench/FanTracking-v0').version}"
    GOLDEN.parent.mkdir(exist_ok=True)
    kept = {
        "version": version,
        "seed": SEED,
        "scenarios": {name: trajectory(name) for name in SCENARIOS},
    }
    GOLDEN.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    print(f"wrote {GOLDEN}")
