"""Many environments in one process are as many single ones."""

import gymnasium as gym
import numpy as np
import pytest

import windwrench  # noqa: F401  registers the environment
from windwrench.dynamics import InputError

NAME = "windwrench/FanTracking-v0"


def make(num_envs, **kwargs):
    return gym.make_vec(NAME, num_envs=num_envs, vectorization_mode="vector_entry_point", **kwargs)


def test_each_is_the_single_environment_with_its_seed():
    envs = make(3, scenario="fast")
    singles = [gym.make(NAME, scenario="fast") for _ in range(3)]
    frames, _ = envs.reset(seed=40)
    np.testing.assert_array_equal(frames, [env.reset(seed=40 + i)[0] for i, env in enumerate(singles)])
    rng = np.random.default_rng(0)
    for _ in range(30):
        actions = rng.uniform(-1, 1, (3, 1)).astype(np.float32)
        frames, rewards, lost, over, infos = envs.step(actions)
        for i, env in enumerate(singles):
            frame, reward, terminated, truncated, info = env.step(actions[i])
            np.testing.assert_array_equal(frames[i], frame)
            assert (rewards[i], lost[i], over[i]) == (reward, terminated, truncated)
            assert infos["offset"][i] == info["offset"]


def test_an_episode_that_ends_starts_anew_at_the_next_step():
    envs = make(2, max_episode_steps=5)
    assert envs.metadata["autoreset_mode"] is gym.vector.AutoresetMode.NEXT_STEP
    envs.reset(seed=1)
    for k in range(1, 8):
        _, rewards, lost, over, infos = envs.step(np.zeros((2, 1), dtype=np.float32))
        assert not lost.any()
        assert over.all() == (k == 5)
        if k == 6:
            assert (rewards == 0).all()
            assert (infos["time"] == 0).all()


@pytest.mark.parametrize("count", [0, -1])
def test_too_few_are_refused(count):
    with pytest.raises(InputError, match="num_envs"):
        make(count)
