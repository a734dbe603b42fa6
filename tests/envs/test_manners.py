"""What an agent sees, how episodes follow each other, versions of a task, and copies that go on."""

import copy
import pickle
from dataclasses import fields, replace

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from numpy.random import default_rng
from numpy.testing import assert_array_equal, assert_equal

from tests.support.vector_flights import fly_alone, make, make_single
from windwrench.dynamics import EffectSetting
from windwrench.envs import SCENARIOS, FanTrackingEnv
from windwrench.envs.fan_tracking import FRAMES, SCALES
from windwrench.envs.scenarios import Variation
from windwrench.evaluation.tasks import TASKS

ACTIONS = default_rng(1).uniform(-0.6, 0.6, (12, 1)).astype(np.float32)


def seen(**kwargs):
    env = FanTrackingEnv("fast", **kwargs)
    rows = [env.reset(seed=3)[0]]
    for action in ACTIONS:
        frame, _, lost, *_ = env.step(action)
        assert not lost
        assert frame in env.observation_space
        rows.append(frame)
    return np.array(rows)


def test_views_are_the_frame_over_fixed_scales_a_part_of_it_and_the_last_ones():
    """The history begins full."""
    frames = seen()
    history = seen(observe="history")
    scaled = seen(normalize=True)
    assert_array_equal(scaled, frames / np.float32(SCALES))
    assert 0.05 < abs(scaled[:, [0, 5, 6, 7]]).mean() < 2.0
    assert_array_equal(seen(observe="wrench-without-fx"), frames[:, 1:])
    padded = np.concatenate([np.repeat(frames[:1], FRAMES - 1, axis=0), frames])
    for k, row in enumerate(history):
        assert_array_equal(row.reshape(FRAMES, 8), padded[k : k + FRAMES])


def test_the_pose_alone_tells_no_wrench():
    env = FanTrackingEnv("fast", observe="pose")
    first, _ = env.reset(seed=3)
    assert_array_equal(first[:3], 0.0)
    for action in ACTIONS:
        frame, *_ = env.step(action)
    state = env.loop.state
    assert frame[3] == np.float32(state[8])
    assert frame[7] == ACTIONS[-1]
    # leans towards the fan, which lies at -x, and looks at it
    assert -0.3 < frame[4] < -0.05
    assert abs(frame[6]) < 0.2


@pytest.mark.parametrize(
    ("mode", "seen"),
    [
        (AutoresetMode.SAME_STEP, {"observe": "history"}),
        (AutoresetMode.NEXT_STEP, {"observe": "pose", "normalize": True}),
    ],
)
def test_episodes_follow_each_other_as_gymnasium_s_own_vector_environment_has_it(mode, seen):
    given = {"scenario": "fast", **seen}
    native = make(2, autoreset_mode=mode, max_episode_steps=4, **given)
    plain = gym.vector.SyncVectorEnv(
        [lambda: make_single(max_episode_steps=4, **given)] * 2, autoreset_mode=mode
    )
    assert native.metadata["autoreset_mode"] is mode
    assert_array_equal(native.reset(seed=5)[0], plain.reset(seed=5)[0])
    for action in ACTIONS[:10]:
        one, other = (envs.step(np.stack([action, -action])) for envs in (native, plain))
        for *_, infos in (one, other):  # arrays in an array of objects
            infos["final_obs"] = list(infos.get("final_obs", ()))
        assert_equal(one, other)


def test_the_stated_distribution_is_the_one_drawn_from():
    narrow = Variation(**{f.name: (1.0, 1.0) for f in fields(Variation) if f.default})
    narrow = replace(narrow, mass=(1.3, 1.3), distance=(2.5, 2.5))
    env = FanTrackingEnv(replace(SCENARIOS["varied"], variation=narrow))
    env.reset(seed=0)
    assert env.loop.model.body_mass.sum() == pytest.approx(1.3 * env.vehicle.mass)
    assert env.loop.position[0] == pytest.approx(2.5, abs=0.3)  # it drifts while the filter settles
    rng = default_rng(0)
    drawn = [Variation().draw(rng)["mass"] for _ in range(200)]
    assert 0.93 <= min(drawn) < 0.94
    assert 1.06 < max(drawn) <= 1.07


@pytest.mark.parametrize("task", TASKS)
def test_gymnasium_s_checker_finds_nothing_and_spaces_are_scaled(task):
    env = gym.make(f"windwrench/{task}-v1")
    check_env(env.unwrapped, skip_render_check=True)
    kind = TASKS[task].environment
    assert env.spec.max_episode_steps == TASKS[task].decisions
    assert_array_equal(env.action_space.high, np.ones(env.action_space.shape))
    bound = np.array(kind.limits, dtype=np.float32) / np.array(kind.scales, dtype=np.float32)
    assert_array_equal(env.observation_space.high, bound)
    assert_array_equal(env.observation_space.low, -bound)


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("plant", ["single", "mujoco", "lanes"])
def test_an_old_id_is_the_new_one_in_si_units_which_info_has(task, plant):
    kind = TASKS[task].environment
    scales = np.array(kind.scales, dtype=np.float32)
    largest = np.float32(kind.largest_action)

    def made(name, **given):
        if plant == "single":
            return gym.make(name, **given)
        return gym.make_vec(name, num_envs=2, plant=plant, **given)

    name = f"windwrench/{task}-v"
    with pytest.warns(DeprecationWarning, match=f"{name}0 is kept until 3.0; take {name}1 with"):
        old = made(f"{name}0")
    plain = made(f"{name}1", normalize=False)
    scaled = made(f"{name}1")
    seed = 4 if plant == "single" else [4, 5]
    a, _ = plain.reset(seed=seed)
    b, told = scaled.reset(seed=seed)
    assert_array_equal(old.reset(seed=seed)[0], a)
    assert_array_equal(told["observation"], a)
    assert_array_equal(told["command"], 0.0)
    rng = default_rng(1)
    for _ in range(6):
        action = rng.uniform(-1.0, 1.0, scaled.action_space.shape).astype(np.float32)
        a, reward, *_ = plain.step(largest * action)
        b, other, *_, told = scaled.step(action)
        assert_array_equal(old.step(largest * action)[0], a)
        assert_array_equal(told["observation"], a)
        assert_array_equal(told["command"], largest * action)
        assert_array_equal(b, a / scales)
        assert_array_equal(other, reward)


def test_info_has_the_frame_of_another_view():
    frames, info = make_single(observe="history").reset(seed=3)
    assert_array_equal(frames[-8:], info["observation"])


LAG = [EffectSetting("motor_lag", {"tau": 0.03}), EffectSetting("rotor_drag", {"kdx": 1e-4})]
COPIES = {"deepcopy": copy.deepcopy, "pickle": lambda env: pickle.loads(pickle.dumps(env))}


@pytest.mark.parametrize("how", COPIES)
@pytest.mark.parametrize("name", TASKS)
@pytest.mark.parametrize(
    "given",
    [{"scenario": "varied"}, {"scenario": "noisy", "effects": LAG, "estimator": "constant-gain"}],
    ids=["varied", "effects"],
)
def test_a_copy_in_flight_goes_on_like_the_original_bit_for_bit(name, how, given):
    env = make_single(name, **given)
    env.reset(seed=5)
    fly_alone(env)
    other = COPIES[how](env)
    fly_alone(COPIES[how](env), 2)  # what is done to one leaves the others alone
    assert_array_equal(fly_alone(env), fly_alone(other))
    # the episodes that follow, without a seed of their own, are the same too
    assert_array_equal(env.reset()[0], other.reset()[0])
    assert_array_equal(fly_alone(env), fly_alone(other))
