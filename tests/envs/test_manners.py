"""What an agent sees, and how episodes follow each other."""

from dataclasses import fields, replace

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from tests.support.vector_flights import make
from windwrench.envs import SCENARIOS, FanTrackingEnv
from windwrench.envs.observing import FRAMES, SCALES
from windwrench.envs.scenarios import Variation

NAME = "windwrench/FanTracking-v0"
ACTIONS = np.random.default_rng(1).uniform(-0.6, 0.6, (12, 1)).astype(np.float32)


def seen(**kwargs):
    env = FanTrackingEnv("fast", **kwargs)
    rows = [env.reset(seed=3)[0]]
    for action in ACTIONS:
        frame, _, lost, *_ = env.step(action)
        assert not lost
        assert frame in env.observation_space
        rows.append(frame)
    return np.array(rows)


def test_a_normalised_observation_is_the_frame_over_fixed_scales():
    np.testing.assert_array_equal(seen(normalize=True), seen() / np.float32(SCALES))
    assert 0.05 < np.abs(seen(normalize=True)[:, [0, 5, 6, 7]]).mean() < 2.0


def test_a_part_of_the_frame_lacks_the_force_along_the_jet():
    np.testing.assert_array_equal(seen(observe="wrench-without-fx"), seen()[:, 1:])


def test_the_history_holds_the_last_frames_and_begins_full():
    frames, history = seen(), seen(observe="history")
    padded = np.concatenate([np.repeat(frames[:1], FRAMES - 1, axis=0), frames])
    for k, row in enumerate(history):
        np.testing.assert_array_equal(row.reshape(FRAMES, 8), padded[k : k + FRAMES])


def test_the_pose_alone_tells_no_wrench():
    env = FanTrackingEnv("fast", observe="pose")
    first, _ = env.reset(seed=3)
    np.testing.assert_array_equal(first[:3], 0.0)
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
        [lambda: gym.make(NAME, max_episode_steps=4, **given)] * 2, autoreset_mode=mode
    )
    assert native.metadata["autoreset_mode"] is mode
    np.testing.assert_array_equal(native.reset(seed=5)[0], plain.reset(seed=5)[0])
    for action in ACTIONS[:10]:
        one, other = (envs.step(np.stack([action, -action])) for envs in (native, plain))
        for *_, infos in (one, other):  # arrays in an array of objects
            infos["final_obs"] = list(infos.get("final_obs", ()))
        np.testing.assert_equal(one, other)


def test_the_stated_distribution_is_the_one_drawn_from():
    narrow = Variation(**{f.name: (1.0, 1.0) for f in fields(Variation) if f.default})
    narrow = replace(narrow, mass=(1.3, 1.3), distance=(2.5, 2.5))
    env = FanTrackingEnv(replace(SCENARIOS["varied"], variation=narrow))
    env.reset(seed=0)
    assert env.loop.model.body_mass.sum() == pytest.approx(1.3 * env.vehicle.mass)
    assert env.loop.position[0] == pytest.approx(2.5, abs=0.3)  # it drifts while the filter settles
    rng = np.random.default_rng(0)
    drawn = [Variation().draw(rng)["mass"] for _ in range(200)]
    assert 0.93 <= min(drawn) < 0.94
    assert 1.06 < max(drawn) <= 1.07
