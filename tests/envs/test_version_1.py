"""Version 1 of each task is version 0 with observations and actions divided by fixed scales."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import windwrench  # noqa: F401  registers the environments
from windwrench.evaluation.tasks import TASKS

COUNT = 2
SEEDS = [4, 5]


def make(task, version, **given):
    return gym.make(f"windwrench/{task}-v{version}", **given)


@pytest.mark.parametrize("task", TASKS)
def test_gymnasium_s_checker_finds_nothing_and_spaces_are_scaled(task):
    env = make(task, 1)
    check_env(env.unwrapped, skip_render_check=True)
    kind = TASKS[task].environment
    assert env.spec.max_episode_steps == TASKS[task].decisions
    np.testing.assert_array_equal(env.action_space.high, np.ones(kind.action_size))
    bound = np.array(kind.limits, dtype=np.float32) / np.array(kind.scales, dtype=np.float32)
    np.testing.assert_array_equal(env.observation_space.high, bound)
    np.testing.assert_array_equal(env.observation_space.low, -bound)


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("plant", ["single", "mujoco", "lanes"])
def test_it_is_version_0_after_scaling_which_info_says_in_si_units(task, plant):
    kind = TASKS[task].environment
    scales, largest = np.array(kind.scales, dtype=np.float32), np.float32(kind.largest_action)

    def made(version):
        if plant == "single":
            return make(task, version)
        return gym.make_vec(f"windwrench/{task}-v{version}", num_envs=COUNT, plant=plant)

    plain, scaled = made(0), made(1)
    seed = SEEDS[0] if plant == "single" else SEEDS
    (a, _), (b, told) = plain.reset(seed=seed), scaled.reset(seed=seed)
    np.testing.assert_array_equal(told["observation"], a)
    np.testing.assert_array_equal(told["command"], 0.0)
    rng = np.random.default_rng(1)
    for _ in range(6):
        action = rng.uniform(-1.0, 1.0, scaled.action_space.shape).astype(np.float32)
        a, reward, *_, info = plain.step(largest * action)
        b, other, *_, told = scaled.step(action)
        np.testing.assert_array_equal(told["observation"], a)
        np.testing.assert_array_equal(told["command"], largest * action)
        np.testing.assert_array_equal(b, a / scales)
        np.testing.assert_array_equal(other, reward)
        assert set(told) - set(info) == {"observation", "command"} | (
            set() if plant == "single" else {"_observation", "_command"}
        )


def test_si_units_and_other_views_are_still_there():
    env = make("FanTracking", 1, normalize=False, observe="history")
    frames, info = env.reset(seed=3)
    np.testing.assert_array_equal(frames[-8:], info["observation"])
