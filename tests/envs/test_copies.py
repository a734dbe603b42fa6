"""A copy of an environment goes on as the original does, and leaves it alone."""

import copy

import gymnasium as gym
import numpy as np
import pytest

from windwrench.dynamics import InputError
from windwrench.envs import Copyable


def make():
    return gym.make("windwrench:windwrench/FanTracking-v0", scenario="gusty")


def test_a_copy_goes_on_like_the_original_bit_for_bit():
    env = Copyable(make)
    env.reset(seed=5)
    for action in (0.1, -0.3, 0.5):
        env.step([action])
    other, third = env.copy(), copy.deepcopy(env)
    ahead = [env.step([0.2])[0] for _ in range(3)]
    np.testing.assert_array_equal(ahead, [other.step([0.2])[0] for _ in range(3)])
    astray = [third.step([-0.2])[0] for _ in range(3)]
    assert not np.array_equal(ahead, astray)
    # the episodes that follow, without a seed of their own, are the same too
    np.testing.assert_array_equal(env.reset()[0], other.reset()[0])
    np.testing.assert_array_equal(env.step([0.0])[0], other.copy().step([0.0])[0])


def test_a_seed_gives_the_episode_of_the_bare_environment():
    env, bare = Copyable(make), make()
    np.testing.assert_array_equal(env.reset(seed=9)[0], bare.reset(seed=9)[0])
    np.testing.assert_array_equal(env.step([0.4])[0], bare.step(np.array([0.4]))[0])


def test_an_action_that_was_refused_is_no_part_of_the_episode():
    env = Copyable(make)
    env.reset(seed=1)
    with pytest.raises(InputError):
        env.step([np.nan])
    env.copy().step([0.1])


@pytest.mark.parametrize("wrong", [gym.spaces.Discrete(2), lambda: 3, "FanTracking"])
def test_what_makes_no_environment_is_refused(wrong):
    with pytest.raises(InputError, match="expected a function that makes an environment"):
        Copyable(wrong)
