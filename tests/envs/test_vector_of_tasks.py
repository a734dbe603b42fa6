"""Environments of each of the four tasks side by side fly as single ones do."""

import copy

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

TASKS = "FanTracking", "FanTracking2D", "WindHover", "WindTrajectory"


def make_vec(task, plant, **given):
    return gym.make_vec(
        f"windwrench:windwrench/{task}-v0",
        num_envs=3,
        vectorization_mode="vector_entry_point",
        plant=plant,
        **given,
    )


def fly(envs, decisions=6):
    """Return frames, rewards and true forces of all decisions."""
    rng = np.random.default_rng(1)
    seen = [envs.reset(seed=[4, 5, 6])[0]]
    told = []
    for _ in range(decisions):
        actions = rng.uniform(-0.5, 0.5, envs.action_space.shape).astype(np.float32)
        frames, rewards, _, _, infos = envs.step(actions)
        seen.append(frames)
        told.append(np.column_stack([rewards, infos["force"], infos["torque"]]))
    return np.array(seen), np.array(told)


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("scenario", ["base", "varied"])
def test_side_by_side_is_single_bit_for_bit_and_lanes_to_rounding(task, scenario):
    frames, told = fly(make_vec(task, "mujoco", scenario=scenario))
    for i, seed in enumerate((4, 5, 6)):
        env, rng = (
            gym.make(f"windwrench:windwrench/{task}-v0", scenario=scenario),
            np.random.default_rng(1),
        )
        np.testing.assert_array_equal(env.reset(seed=seed)[0], frames[0, i])
        for k in range(6):
            shape = (3, *env.action_space.shape)
            action = rng.uniform(-0.5, 0.5, shape).astype(np.float32)[i]
            frame, reward, _, _, info = env.step(action)
            np.testing.assert_array_equal(frame, frames[k + 1, i])
            np.testing.assert_array_equal([reward, *info["force"], *info["torque"]], told[k, i])
    in_lanes = fly(make_vec(task, "lanes", scenario=scenario))
    np.testing.assert_allclose(in_lanes[0], frames, atol=2e-5)
    np.testing.assert_allclose(in_lanes[1], told, atol=1e-6)


@pytest.mark.parametrize("task", TASKS[1:])
@pytest.mark.parametrize("plant", ["mujoco", "lanes"])
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_episodes_follow_one_another_in_both_modes_and_copies_go_on(task, plant, mode):
    envs = make_vec(task, plant, autoreset_mode=mode)
    envs.reset(seed=2)
    still = np.zeros(envs.action_space.shape, dtype=np.float32)
    ended = 0
    while not ended:
        _, _, lost, out, infos = envs.step(still)
        ended = int(np.sum(lost | out))
    assert ("final_obs" in infos) == (mode == AutoresetMode.SAME_STEP)
    other = copy.deepcopy(envs)
    for _ in range(2):
        np.testing.assert_array_equal(envs.step(still)[0], other.step(still)[0])
