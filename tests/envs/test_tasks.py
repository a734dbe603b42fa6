"""The tasks beside FanTracking: interface, specification, physics, and what their laws reach."""

import re

import numpy as np
import pytest

import windwrench  # noqa: F401  registers the environments
from windwrench.controllers import wind_observation as seen
from windwrench.dynamics import InputError
from windwrench.envs.fan_tracking_2d import FanTracking2DEnv
from windwrench.envs.wind import GridWind, Uniform
from windwrench.envs.wind_tasks import WindHoverEnv
from windwrench.evaluation.tasks import TASKS


@pytest.mark.parametrize("cls", [WindHoverEnv, FanTracking2DEnv])
def test_the_docstring_s_tables_are_the_spaces(cls):
    rows = re.findall(r"^\s+\| (\d+)(?:-(\d+))? +\|.*?\| (\d+(?:\.\d+)?) +\|", cls.__doc__, re.M)
    env = cls()
    size = env.observation_space.shape[0]
    limits = np.zeros(size)
    table = cls.__doc__.partition("## Observation space")[2].partition("##")[0]
    for row in re.findall(r"^\s+\| (\d+)(?:-(\d+))? *\|(.*)\|", table, re.M):
        first, last = int(row[0]), int(row[1] or row[0])
        limits[first : last + 1] = float(row[2].split("|")[1])
    assert rows
    np.testing.assert_array_equal(env.observation_space.high, limits.astype(np.float32))


@pytest.mark.parametrize(
    ("name", "weight", "width", "actions"),
    [
        ("FanTracking", 0.05, 0.3, [[0.4], [-0.2], [1.0], [3.0]]),  # the last is clipped to 1
        ("FanTracking2D", 0.05, 0.3, [[0.5, -0.5], [0.1, 0.2]]),
        ("WindHover", 0.002, 0.1, [[1.0, 0.0, -2.0], [1.0, 1.0, 1.0]]),
    ],
)
def test_the_rewards_are_as_stated(name, weight, width, actions):
    env = TASKS[name].environment()
    env.reset(seed=2)
    last = np.zeros(len(actions[0]))
    for action in np.array(actions):
        _, reward, _, _, info = env.step(action)
        if name == "FanTracking":
            action, error = np.float32(np.minimum(action, 1.0)), info["y"] - info["fan_y"]
            assert info["offset"] == pytest.approx(error)
        else:
            target = info["fan"] if name == "FanTracking2D" else info["reference"]
            error = np.linalg.norm(info["position"] - target)
            assert info["error"] == pytest.approx(error)
        assert info["reward_change"] == pytest.approx(-weight * np.sum((action - last) ** 2))
        assert info["reward_tracking"] == pytest.approx(1 / (1 + (error / width) ** 2))
        assert reward == info["reward_tracking"] + info["reward_change"]
        last = action


@pytest.mark.parametrize(
    ("name", "action"),
    [
        *(("FanTracking", action) for action in ([np.nan], [np.inf], [0, 0], [[0]], 0.3, [])),
        *(("WindHover", action) for action in ([1.0, 2.0], [1.0, np.nan, 0.0])),
        ("FanTracking2D", [1.0]),
    ],
)
def test_a_bad_action_and_unknown_options_are_named(name, action):
    env = TASKS[name].environment()
    with pytest.raises(InputError, match=r"reset before step|call reset"):
        env.step(np.zeros(env.action_space.shape))
    env.reset(seed=0, options={})
    with pytest.raises(InputError, match=r"action must be .*shape \("):
        env.step(np.array(action))
    with pytest.raises(InputError, match=r"unknown option.*'speed'"):
        env.reset(options={"speed": 1})


def test_a_steady_wind_pushes_as_its_drag_says_and_all_see_it():
    env = WindHoverEnv("calm", winds=[Uniform((4.0, 0.0, 0.0))])
    env.reset(seed=0)
    for _ in range(150):
        observation, _, lost, _, info = env.step(np.zeros(3))
    assert not lost
    np.testing.assert_allclose(info["wind"], [4.0, 0.0, 0.0], atol=1e-9)
    expected = 4 * 0.020 * 4.0 + 0.5 * 1.2 * 0.060 * 16.0  # rotors, and the hull
    assert info["force"][0] == pytest.approx(expected, abs=0.15)
    assert observation[seen.FORCE][0] == pytest.approx(expected, abs=0.2)
    # accelerometer less rotors is the same force
    pushed = observation[seen.SPECIFIC_FORCE] - observation[seen.ROTOR_FORCE]
    assert 0.465 * pushed[0] == pytest.approx(expected, abs=0.2)


def test_a_wind_of_one_s_own_blows_as_the_kit_s_own_does():
    class Breeze:
        def velocity(self, points, time):
            return np.tile([1.0, -0.5, 0.2], (len(points), 1))

    for winds in ([Breeze()], [Uniform((1.0, -0.5, 0.2))]):
        env = WindHoverEnv("calm", winds=winds)
        env.reset(seed=0)
        *_, info = env.step(np.zeros(3))
        np.testing.assert_allclose(info["wind"], [1.0, -0.5, 0.2])


def test_a_lost_vehicle_ends_the_episode():
    # a storm that comes with the grid's second half
    wind = np.zeros((3, 1, 1, 1, 3))
    wind[1:, ..., 0] = 16.0
    env = WindHoverEnv("calm", winds=[GridWind(([0, 1, 2], [0], [0], [0]), wind)])
    env.reset(seed=0)
    for _ in range(200):
        *_, lost, _, info = env.step(np.zeros(3))
        if lost:
            break
    assert lost
    assert info["lost"]
