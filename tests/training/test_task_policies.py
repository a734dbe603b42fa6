"""Policies of the other tasks are trained, the same ones from the same seed."""

import numpy as np
import pytest

pytest.importorskip("torch", reason="torch is not installed: pip install 'windwrench[rl]'")

from windwrench.evaluation.tasks import TASKS
from windwrench.training.run import validate
from windwrench.training.task_policies import sac, teach

pytestmark = pytest.mark.slow


def test_a_taught_network_is_the_same_again():
    one, other = (teach("WindHover", 0, rounds=2, episodes=2, epochs=2) for _ in range(2))
    for name, array in one.weights.items():
        np.testing.assert_array_equal(array, other.weights[name])
    assert one.card["steps"] == 2000


def test_sac_trains_in_the_wind():
    pytest.importorskip("stable_baselines3", reason="stable_baselines3 is not installed")
    policy = sac("WindHover", 0, 1100)
    assert policy.card["squash"]
    assert np.isfinite(validate(policy, TASKS["WindHover"].environment("base"), 2, "WindHover")[0])
