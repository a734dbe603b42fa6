"""What the felt wrench is worth: paired figures, and policies that do not see what is taken."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from windwrench.envs import OBSERVATIONS

pytest.importorskip("stable_baselines3", reason="pip install 'windwrench[rl]'")

from windwrench.evaluation.tasks import task_of
from windwrench.evidence.felt_wrench import LAW, change, rows, trained


def test_a_change_is_paired_over_the_episodes():
    hard = 10.0 ** default_rng(0).uniform(-1.0, 1.0, (1, 40))
    found = change(1.1 * hard, hard)
    assert_allclose([found["change"], *found["ci95"]], 0.1)
    assert np.ptp(change(1.1 * hard[:, ::-1], hard)["ci95"]) > 0.2


def test_a_row_compares_each_observation_with_the_one_that_has_more():
    results = {
        ("ppo", "WindHover", "noisy", name, seed): {"rmse_settled_m": [x, x]}
        | {"lost": seed, "training_cpu_s": 1.0}
        for name, x in zip(OBSERVATIONS, (8.0, 4.0, 3.0, 2.0), strict=True)
        for seed in (0, 1)
    }
    (row,) = rows(results)
    assert (row["policies"], row["lost"]["pose"], row["rmse_settled_m"]["imu"]) == (2, 1, 3.0)
    changes = [each["change"] for each in row["taken"].values()]
    assert changes == [0.5, 1.0, 3.0, 1.0]  # all to imu, to wrench, to pose; wrench to pose


@pytest.mark.parametrize("observation", ["imu", "all"])  # all of the others, and all
def test_a_law_answers_a_change_of_the_wrench_only_where_it_sees_the_wrench(observation):
    policy = trained(LAW, "FanTracking", "base", observation, 0, 8)
    env = task_of("FanTracking").make("base", observation=observation)
    commands = set()
    env.reset(seed=0)
    for felt in (0.0, 0.1):
        env.many.state.estimate.force[:] += felt
        policy.reset()
        commands.add(float(policy(env.see(env.many.state)[0])[0]))
    assert len(commands) == (2 if observation == "all" else 1)
