"""The environments as stable-baselines3 sees them: where each one's episode ends, and which
episode follows.
"""

import numpy as np
import pytest

from windwrench.controllers.features import Features, History
from windwrench.envs.fan_tracking import FanTrackingEnv
from windwrench.envs.scenarios import SCENARIOS
from windwrench.envs.vector import TaskVectorEnv
from windwrench.training.training_envs import MixedFanTracking

pytest.importorskip("stable_baselines3", reason="pip install 'windwrench[rl]'")
from windwrench.training.vec_env import FeatureVecEnv

FEATURES = Features(("torque_z", "force_x", "velocity_y", "command"), 3)


def seed_of(environment, episode):
    return 100 * environment + episode


def make(count, limit, scenario="static"):
    return FeatureVecEnv(TaskVectorEnv(count, limit, scenario=scenario), FEATURES, seed_of)


def away(seed):
    """The direction in which the vehicle stands off the axis."""
    _, info = FanTrackingEnv("static").reset(seed=seed)
    return float(np.sign(info["offset"]))


def lone_flight(seed, commands, scenario="static"):
    """Features, rewards and losses of a single environment, computed by itself."""
    env, history = FanTrackingEnv(scenario), History(FEATURES, 1)
    observation, info = env.reset(seed=seed)
    history.restart(FEATURES.frames(observation[None]), [0])
    seen, rewards = [history.flat()[0]], []
    for command in commands:
        observation, reward, lost, _, info = env.step(np.array([command], dtype=np.float32))
        history.push(FEATURES.frames(observation[None]))
        seen.append(history.flat()[0])
        rewards.append(reward)
        if lost:
            break
    return np.array(seen), np.array(rewards), info["lost"]


def test_each_environment_ends_by_itself_with_its_own_last_observation():
    limit = 30
    env, direction = make(3, limit), away(seed_of(1, 0))
    first, _, lost = lone_flight(seed_of(1, 0), [direction] * limit)
    assert lost
    gone = len(first) - 1
    assert 5 < gone < limit
    seen = env.reset()
    np.testing.assert_array_equal(seen[1], first[0])
    still, _, _ = lone_flight(seed_of(0, 0), [0.0] * limit)
    for k in range(1, limit + 1):
        seen, _, dones, infos = env.step(
            np.array([[0.0], [direction if k <= gone else 0.0], [0.0]])
        )
        assert dones.tolist() == [k == limit, k == gone, k == limit]
        assert ["terminal_observation" in info for info in infos] == dones.tolist()
        if k == gone:
            np.testing.assert_array_equal(infos[1]["terminal_observation"], first[-1])
            assert infos[1]["TimeLimit.truncated"] is False
            assert infos[1]["episode"]["l"] == gone
            np.testing.assert_array_equal(
                seen[1], lone_flight(seed_of(1, 1), [])[0][0]
            )  # its next episode's first
            np.testing.assert_array_equal(seen[0], still[k])  # nobody else's changed
        if k == limit:
            for i in (0, 2):
                assert infos[i]["TimeLimit.truncated"] is True
            np.testing.assert_array_equal(infos[0]["terminal_observation"], still[-1])
            np.testing.assert_array_equal(seen[0], lone_flight(seed_of(0, 1), [])[0][0])
    assert not np.array_equal(infos[0]["terminal_observation"], infos[2]["terminal_observation"])


def test_a_vehicle_lost_at_the_last_moment_was_lost_not_out_of_time():
    direction = away(seed_of(0, 0))
    gone = len(lone_flight(seed_of(0, 0), [direction] * 60)[0]) - 1
    env = make(1, gone)
    env.reset()
    for _ in range(gone):
        _, _, dones, infos = env.step(np.array([[direction]]))
    assert dones[0]
    assert infos[0]["TimeLimit.truncated"] is False


def test_rewards_are_weighted_terms():
    commands = [0.5, -0.5, 0.2]
    _, rewards, _ = lone_flight(seed_of(0, 0), commands)
    env = make(1, 50)
    env.reset()
    np.testing.assert_allclose(
        [env.step(np.array([[c]]))[1][0] for c in commands], rewards, rtol=1e-6
    )
    squared = FeatureVecEnv(
        TaskVectorEnv(1, 50, scenario="static"),
        FEATURES,
        seed_of,
        {"tracking": 0.0, "change": 0.0, "squared": 1.0},
    )
    squared.reset()
    assert squared.step(np.array([[0.0]]))[1][0] == pytest.approx(-0.64, abs=0.1)  # about 0.8 m off


def test_the_scenario_of_a_mixed_episode_says_nothing_of_its_motion():
    env = MixedFanTracking(("base", "fast"), estimator="constant-gain")
    moved = {"base": set(), "fast": set()}
    for seed in range(60):
        _, info = env.reset(seed=seed)
        moved["base" if env.scenario is SCENARIOS["base"] else "fast"].add(info["fan_motion"])
    assert moved == {
        "base": {"sine", "triangle", "ramp", "still"},
        "fast": {"sine", "triangle", "ramp"},
    }
