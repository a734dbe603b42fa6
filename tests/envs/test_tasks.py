"""The tasks: interface, specification, repeatability, physics, and how episodes start and end."""

import re
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.linalg import norm
from numpy.random import SFC64, random
from numpy.testing import assert_allclose, assert_array_equal

import windwrench  # noqa: F401  registers the environments
from tests.support.outcomes import refused
from tests.support.vector_flights import fly_alone
from tests.support.vehicles import VEHICLE
from windwrench.controllers import Admittance
from windwrench.controllers import wind_observation as seen
from windwrench.dynamics.vehicle import EffectSetting
from windwrench.envs import FanTrackingEnv
from windwrench.envs.fan_tracking_2d import FanTracking2DEnv
from windwrench.envs.plant import NOISE
from windwrench.envs.wind import GridWind, Uniform
from windwrench.envs.wind_tasks import WindHoverEnv
from windwrench.evaluation.episodes import fly_episode
from windwrench.evaluation.tasks import TASKS


@pytest.mark.parametrize("cls", [WindHoverEnv, FanTracking2DEnv])
def test_the_docstring_s_tables_are_the_spaces(cls):
    env = cls()
    limits = np.zeros(env.observation_space.shape[0])
    table = cls.__doc__.partition("## Observation space")[2].partition("##")[0]
    rows = re.findall(r"^\s+\| (\d+)(?:-(\d+))? *\|(.*)\|", table, re.M)
    for row in rows:
        limits[int(row[0]) : int(row[1] or row[0]) + 1] = float(row[2].split("|")[1])
    assert rows
    assert_array_equal(env.observation_space.high, limits.astype(np.float32))


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
            action = np.float32(np.minimum(action, 1.0))
            error = info["y"] - info["fan_y"]
        else:
            target = info["fan"] if name == "FanTracking2D" else info["reference"]
            error = norm(info["position"] - target)
        assert info.get("error", info.get("offset")) == pytest.approx(error)
        assert info["reward_change"] == pytest.approx(-weight * np.sum((action - last) ** 2))
        assert info["reward_tracking"] == pytest.approx(1 / (1 + (error / width) ** 2))
        assert reward == info["reward_tracking"] + info["reward_change"]
        last = action


def test_a_steady_wind_half_of_one_s_own_pushes_as_its_drag_says_and_all_see_it():
    half = Uniform((2.0, 0.0, 0.0))
    env = WindHoverEnv("calm", winds=[half, SimpleNamespace(velocity=half.velocity)])
    env.reset(seed=0)
    for _ in range(150):
        observation, _, lost, _, info = env.step(np.zeros(3))
    assert not lost
    assert_allclose(info["wind"], [4.0, 0.0, 0.0], atol=1e-9)
    expected = 4 * 0.020 * 4.0 + 0.5 * 1.2 * 0.060 * 16.0  # rotors, and the hull
    assert info["force"][0] == pytest.approx(expected, abs=0.15)
    assert observation[seen.FORCE][0] == pytest.approx(expected, abs=0.2)
    # accelerometer less rotors is the same force
    pushed = observation[seen.SPECIFIC_FORCE] - observation[seen.ROTOR_FORCE]
    assert 0.465 * pushed[0] == pytest.approx(expected, abs=0.2)


def test_a_lost_vehicle_ends_the_episode():
    # a storm that comes with the grid's second half
    wind = np.zeros((3, 1, 1, 1, 3))
    wind[1:, ..., 0] = 16.0
    env = WindHoverEnv("calm", winds=[GridWind(([0, 1, 2], [0], [0], [0]), wind)])
    env.reset(seed=0)
    steps = (env.step(np.zeros(3)) for _ in range(200))
    assert next(info["lost"] for _, _, lost, _, info in steps if lost)


STILL = np.zeros(1, np.float32)


def test_the_name_with_its_module_makes_it_without_an_import_from_any_folder(tmp_path):
    code = (
        "import gymnasium as gym, sys\n"
        "env = gym.make('windwrench:windwrench/FanTracking-v1')\n"
        "print(env.reset(seed=1)[0].shape)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.stdout.strip() == "(8,)", done.stderr


def test_an_episode_and_numpy_s_global_random_state_leave_each_other_alone():
    env = FanTrackingEnv("varied")
    first = fly_alone(env, 15, 5)
    np.random.seed(123)  # noqa: NPY002
    expected = random(3)  # noqa: NPY002
    np.random.seed(123)  # noqa: NPY002
    assert_array_equal(fly_alone(env, 15, 5), first)
    assert_array_equal(random(3), expected)  # noqa: NPY002


def test_after_a_bad_fan_path_which_is_named_there_is_no_step():
    env = FanTrackingEnv(fan_path=lambda t: 0.0)
    with refused("fan_path must return"):
        env.reset(seed=0)
    with refused("reset before step"):
        env.step(STILL)


def test_a_filter_whose_state_is_no_number_starts_over():
    env = FanTrackingEnv()
    env.reset(seed=0)
    env.step(STILL)
    env.loop.state[16] = np.nan
    observation, _, lost, _, info = env.step(STILL)
    assert not lost
    assert not info["lost"]
    assert np.isfinite(env.loop.state[:19]).all()
    assert observation in env.observation_space


def test_a_generator_that_is_put_in_is_drawn_from():
    env = FanTrackingEnv()
    twin = FanTrackingEnv()
    env.reset(seed=1)
    twin.reset(seed=1)
    env.np_random, other = (np.random.Generator(SFC64(4)) for _ in range(2))
    env.step(STILL)
    twin.step(STILL)
    assert not np.array_equal(env.loop.state, twin.loop.state)
    other.standard_normal((16, NOISE))
    assert env.np_random.uniform() == other.uniform()


HEAVY = EffectSetting("mass", {"dm": 0.06})


def test_without_a_truth_the_true_vehicle_is_as_declared():
    vehicle = VEHICLE.with_effects(EffectSetting("rotor_drag", {"kdx": 1e-4, "kdy": 1e-4}))
    flown = [
        fly_episode(FanTrackingEnv("varied", vehicle=vehicle, truth=truth), Admittance(), 5)
        for truth in (None, vehicle, VEHICLE)
    ]
    assert np.array_equal(flown[0].observation, flown[1].observation)
    assert not np.array_equal(flown[0].observation, flown[2].observation)


def test_a_declared_mass_comes_into_the_world_once_and_the_flight_loop_knows_it():
    heights = []
    for model in (VEHICLE, VEHICLE.with_effects(HEAVY)):
        env = FanTrackingEnv("static", vehicle=model, truth=VEHICLE, effects=(HEAVY,))
        env.reset(seed=0)  # it settles for 1.5 s
        body = env.loop.model.body("vehicle").id
        assert env.loop.model.body_mass[body] == pytest.approx(0.525)
        heights.append(float(env.loop.position[2] - env.fan.height))
    assert heights[0] < -0.05
    assert abs(heights[1]) < 0.3 * abs(heights[0])


def test_a_given_fan_path_is_followed_for_20_s_and_then_the_fan_stands_still():
    env = FanTrackingEnv("static", fan_path=lambda t: 0.1 * np.sin(t))
    _, info = env.reset(seed=0)
    assert info["fan_motion"] == "given"
    infos = [env.step(STILL)[4] for _ in range(260)]  # no time limit of its own
    for k in (1, 2, 29, 249):
        seen = infos[k - 1]
        assert seen["fan_y"] == pytest.approx(0.1 * np.sin(k * 0.08 - 0.005), abs=1e-9)
        assert seen["fan_velocity"] == pytest.approx(0.1 * np.cos(k * 0.08), abs=1e-3)
    assert infos[-1]["fan_y"] == pytest.approx(0.1 * np.sin(20.0))
    assert len({seen["fan_y"] for seen in infos[-5:]}) == 1
