"""A decision: its normals are NumPy's, and what ends or forbids it."""

import copy
import pickle

import numpy as np
import pytest

from windwrench.dynamics import InputError
from windwrench.envs import FanTrackingEnv
from windwrench.envs.plant import NOISE
from windwrench.envs.vector import FanTrackingVectorEnv


@pytest.mark.parametrize("estimator", ["ukf", "constant-gain"])
def test_a_decision_is_sixteen_ticks_with_numpy_s_normals(estimator):
    env, twin = (FanTrackingEnv("fast", estimator=estimator) for _ in range(2))
    env.reset(seed=6)
    twin.reset(seed=6)
    for _ in range(5):
        env.step(np.array([0.3], np.float32))
        twin.command = np.array([float(np.float32(0.3))])
        twin._fly(twin.np_random.standard_normal((16, NOISE)))
        for name in ("state", "covariance", "external", "position", "quaternion", "velocity"):
            one, other = getattr(env.loop, name), getattr(twin.loop, name)
            np.testing.assert_array_equal(one, other, name)
        assert env.loop.time == twin.loop.time
    assert env.np_random.uniform() == twin.np_random.uniform()


def test_a_generator_that_is_put_in_is_drawn_from():
    env, twin = FanTrackingEnv(), FanTrackingEnv()
    env.reset(seed=1)
    twin.reset(seed=1)
    env.np_random, other = (
        np.random.Generator(np.random.SFC64(4)),
        np.random.Generator(np.random.SFC64(4)),
    )
    env.step(np.zeros(1, np.float32))
    twin.step(np.zeros(1, np.float32))
    assert not np.array_equal(env.loop.state, twin.loop.state)
    other.standard_normal((16, NOISE))
    assert env.np_random.uniform() == other.uniform()


def test_after_a_reset_that_failed_there_is_no_step():
    env = FanTrackingEnv(fan_path=lambda t: t[:-1])
    with pytest.raises(InputError, match="fan_path"):
        env.reset(seed=0)
    with pytest.raises(InputError, match="reset before step"):
        env.step(np.zeros(1, np.float32))


@pytest.mark.parametrize("threads", [1, 2])
def test_one_state_that_is_no_number_is_lost_and_the_others_fly_on(threads, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log where it runs
    envs, healthy = FanTrackingVectorEnv(3, threads=threads), FanTrackingVectorEnv(3)
    actions = np.zeros((3, 1), np.float32)
    envs.reset(seed=0)
    healthy.reset(seed=0)
    envs.envs[1].loop.data.qvel[0] = np.nan
    frames, _, lost, _, infos = envs.step(actions)
    assert lost.tolist() == infos["lost"].tolist() == [False, True, False]
    assert frames in envs.observation_space
    np.testing.assert_array_equal(frames[[0, 2]], healthy.step(actions)[0][[0, 2]])
    _, rewards, lost, _, infos = envs.step(actions)
    assert not lost.any()
    assert (rewards[1], infos["time"][1]) == (0.0, 0.0)
    envs.close()


def test_many_environments_want_a_reset_of_all_first():
    envs = FanTrackingVectorEnv(2)
    with pytest.raises(InputError, match="reset before step"):
        envs.step(np.zeros((2, 1), np.float32))
    envs.reset(seed=0, options={"reset_mask": np.array([True, False])})
    with pytest.raises(InputError, match="reset before step"):
        envs.step(np.zeros((2, 1), np.float32))


@pytest.mark.parametrize("copied", [copy.deepcopy, pickle.dumps])
def test_a_flight_in_progress_is_not_copied(copied):
    env = FanTrackingEnv("static")
    copy.deepcopy(env).reset(
        seed=0
    )  # before its first flight there is nothing that could be shared
    env.reset(seed=0)
    with pytest.raises(InputError, match="cannot be copied or pickled"):
        copied(env)
