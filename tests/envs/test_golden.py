"""The physics is the one that the environment's version stands for; processes and threads do not
change it.
"""

import json
import re
import threading
from concurrent.futures import ThreadPoolExecutor

import gymnasium
import pytest
from numpy.testing import assert_allclose

import windwrench  # noqa: F401 - registers the environment
from tests.support.golden_trajectories import GOLDEN, GOLDEN_TASKS, SEED, SEED_OF_TASKS, trajectory
from tests.support.vector_flights import fly_alone
from windwrench.envs import FanTrackingEnv
from windwrench.evaluation.tasks import TASKS

KEPT = json.loads(GOLDEN_TASKS.read_bytes())
KEPT["FanTracking"] = json.loads(GOLDEN.read_bytes())
# Not bit for bit: compilers of other processors contract and order sums otherwise, and the loop's
# feedback lets that grow within 3 s, to some 1e-12 on most and, between two that were tried, to
# 1.5e-8 in the wrench and 4e-10 in y and reward (scenario noisy). Observations are of single
# precision. Random commands of the other tasks let differences grow further.
TOLERANCE = {"observation": 1e-6, "wrench": 1e-7, "y": 1e-9, "reward": 1e-9}
TOLERANCE_OF_TASKS = {"observation": 2e-5, "wrench": 1e-6, "error": 1e-8}


@pytest.mark.parametrize(
    ("task", "scenario"), [(task, name) for task in TASKS for name in TASKS[task].scenarios]
)
def test_trajectories_are_those_of_the_environments_version(task, scenario):
    now = trajectory(task, scenario)
    golden = KEPT[task]["scenarios"][scenario]
    tolerances = TOLERANCE if task == "FanTracking" else TOLERANCE_OF_TASKS
    for name, tolerance in tolerances.items():
        assert_allclose(
            now[name],
            golden[name],
            rtol=0,
            atol=tolerance,
            err_msg=(
                f"{task}, {scenario}: {name} differs from tests/golden. Is a change of physics "
                "meant? Then say it in the version history in the environment's docstring, bump "
                "the version of its name, and run python -m tests.support.golden_trajectories"
            ),
        )


@pytest.mark.parametrize("task", TASKS)
def test_the_golden_trajectories_are_of_this_version(task):
    kept = KEPT[task]
    assert kept["version"] == f"v{gymnasium.spec(f'windwrench/{task}-v0').version}"
    assert kept["seed"] == (SEED if task == "FanTracking" else SEED_OF_TASKS)
    assert set(kept["scenarios"]) == set(TASKS[task].scenarios)
    history = TASKS[task].environment.__doc__.partition("## Version history")[2]
    assert kept["version"] in re.findall(r"^\s+\* (v\d+):", history, re.M)


def test_sixteen_threads_at_once_fly_the_same_trajectories():
    def flown(seed):
        return fly_alone(FanTrackingEnv("base"), 25, seed).tobytes()

    alone = [flown(seed) for seed in range(4)]
    ready = threading.Barrier(16)

    def fly(i):
        ready.wait()
        return flown(i % 4)

    with ThreadPoolExecutor(16) as pool:
        assert list(pool.map(fly, range(16))) == [alone[i % 4] for i in range(16)]
