"""Many environments in one process are as many single ones."""

import gymnasium as gym
import mujoco
import numpy as np
import pytest

import windwrench  # noqa: F401  registers the environment
from windwrench.dynamics import InputError

NAME = "windwrench/FanTracking-v0"


def make(num_envs, **kwargs):
    return gym.make_vec(NAME, num_envs=num_envs, vectorization_mode="vector_entry_point", **kwargs)


def rows(envs, seed, count):
    """Everything that the first steps return, as one array (count, n, .)."""
    rng, out = np.random.default_rng(seed), []
    frames, infos = envs.reset(seed=seed)
    for _ in range(count):
        frames, rewards, lost, over, infos = envs.step(
            rng.uniform(-1, 1, (envs.num_envs, 1)).astype(np.float32)
        )
        numbers = [infos[name] for name in NUMBERS]
        out.append(
            np.column_stack(
                [frames, rewards, lost, over, *numbers, infos["force"], infos["torque"]]
            )
        )
    return np.array(out)


NUMBERS = (
    "reward_tracking",
    "reward_change",
    "fan_y",
    "fan_velocity",
    "y",
    "offset",
    "time",
    "lost",
)


@pytest.mark.parametrize(("estimator", "threads"), [("ukf", 5), ("constant-gain", 2)])
def test_threads_give_the_same_bits(estimator, threads):
    given = {"scenario": "varied", "estimator": estimator, "max_episode_steps": 7}
    alone, spread = make(5, **given), make(5, threads=threads, **given)
    np.testing.assert_array_equal(rows(alone, 3, 20), rows(spread, 3, 20))
    spread.close()


def test_seeds_may_be_listed_and_a_part_reset():
    envs = make(3)
    frames, _ = envs.reset(seed=[7, 5, 7])
    np.testing.assert_array_equal(frames[0], frames[2])
    assert not np.array_equal(frames[0], frames[1])
    for _ in range(2):
        envs.step(np.zeros((3, 1), np.float32))
    again, infos = envs.reset(
        seed=[7, None, None], options={"reset_mask": np.array([True, False, False])}
    )
    np.testing.assert_array_equal(again[0], frames[0])
    assert infos["time"].tolist() == [0.0, pytest.approx(0.16), pytest.approx(0.16)]
    with pytest.raises(InputError, match="3 seeds"):
        envs.reset(seed=[1, 2])


@pytest.mark.parametrize("actions", [np.zeros(3), np.zeros((2, 1)), np.full((3, 1), np.nan)])
def test_bad_actions_are_named_and_nothing_flies(actions):
    envs = make(3)
    envs.reset(seed=0)
    with pytest.raises(InputError, match=r"shape \(3, 1\)"):
        envs.step(actions)
    assert (envs.step(np.zeros((3, 1)))[4]["time"] == 0.08).all()


@pytest.mark.parametrize(("name", "value"), [("threads", 0), ("num_envs", 0), ("num_envs", -1)])
def test_numbers_below_one_are_refused(name, value):
    with pytest.raises(InputError, match=name):
        make(**{"num_envs": 2, name: value})


def test_mujoco_s_clock_is_a_user_s_again_after_a_flight():
    envs, calls = make(1), []

    def clock():
        calls.append(0)
        return 0.0

    envs.reset(seed=0)
    mujoco.set_mjcb_time(clock)
    try:
        envs.step(np.zeros((1, 1)))
        assert not calls  # no step of the flight is timed
        assert mujoco.get_mjcb_time() is clock
    finally:
        mujoco.set_mjcb_time(None)
