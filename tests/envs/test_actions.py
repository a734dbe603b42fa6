"""Five actions and four observations on four tasks: their meaning, and what checkers say."""

import warnings
from dataclasses import replace
from itertools import cycle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from numpy.linalg import norm
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

import windwrench  # noqa: F401  registers the environments
from tests.support.outcomes import refused
from tests.support.sizes import rms
from tests.support.vector_flights import TASKS
from windwrench.dynamics import load_vehicle
from windwrench.dynamics.rotation import matrix_of
from windwrench.envs import ACTIONS, OBSERVATIONS
from windwrench.envs.plant import PlantSettings

QUIET = PlantSettings(disturbance_force=0.0, disturbance_torque=0.0, sensor_noise=False)
GIVEN = {"scenario": "calm", "settings": QUIET, "decision_hz": 200}


def flying(action, seconds, given=(), **named):
    """The loop after a constant action in still air, and the last ``info`` and observation."""
    env = gym.make("windwrench/WindHover-v2", action=action, **{**GIVEN, **named}).unwrapped
    env.reset(seed=0)
    for _ in range(round(seconds * env.decision_hz)):
        seen, _, lost, _, info = env.step(np.array(given, np.float32))
        assert not lost
    return env, info, seen


def turned(loop):
    return matrix_of(loop.quaternion)


@pytest.mark.parametrize("action", ACTIONS)
@pytest.mark.parametrize("vehicle", ["ardrone2", "crazyflie"])
def test_zero_hovers(action, vehicle):
    zero = [0.0] * (3 if action in ("velocity", "acceleration") else 4)
    env, info, _ = flying(action, 0.5, zero, vehicle=vehicle)
    assert info["error"] < 0.1
    assert_allclose(env.loop.command, load_vehicle(vehicle).hover_rate, rtol=0.05)


def test_a_velocity_and_an_acceleration_are_flown():
    env, *_ = flying("velocity", 1.5, [0.5, -0.3, 0.2])
    assert_allclose(env.loop.velocity, [0.5, -0.3, 0.2], atol=0.1)
    env, info, _ = flying("acceleration", 3.0, [0.25, 0.0, 0.0])
    assert info["command"].tolist() == [1.0, 0.0, 0.0]
    assert env.loop.position[0] - 2.3 == pytest.approx(1.0 / 4.0, abs=0.08)  # over the loop's gain


def test_an_attitude_is_roll_and_pitch_at_the_present_yaw_yaw_rate_and_thrust():
    env, info, _ = flying("attitude", 0.4, [0.4, -0.2, 0.25, 0.0])
    assert_allclose(info["command"], [0.2, -0.1, 0.5, 9.81], rtol=1e-6)
    R = turned(env.loop)
    yaw = np.arctan2(R[1, 0], R[0, 0])
    c = np.cos(yaw)
    s = np.sin(yaw)
    R = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ R
    assert np.arctan2(R[2, 1], R[2, 2]) == pytest.approx(0.2, abs=0.03)
    assert np.arcsin(-R[2, 0]) == pytest.approx(-0.1, abs=0.03)
    assert yaw % (2 * np.pi) - np.pi == pytest.approx(0.2, abs=0.1)  # from 180 degrees


def test_rates_are_of_the_body_and_thrust_lifts():
    env, info, _ = flying("rates", 0.15, [0.1, -0.05, 0.2, 0.5])
    wanted = info["command"]
    assert_allclose(wanted[:3], [11 / 18, -5.5 / 18, 0.4], rtol=1e-6)
    assert_allclose(env.loop.motion[1][3:5], wanted[:2], rtol=0.15)
    assert env.loop.motion[1][5] == pytest.approx(wanted[2], rel=0.5)  # yaw is slow
    assert wanted[3] == pytest.approx(9.81 * 1.35)
    assert env.loop.velocity[2] > 0.2


def test_rotors_are_rotor_speeds_from_none_to_the_largest():
    env, info, _ = flying("rotors", 0.1, [1.0, 1.0, 1.0, 1.0])
    assert info["command"] == pytest.approx(load_vehicle("ardrone2").omega_max)
    assert_array_equal(env.loop.command, info["command"])
    _, info, _ = flying("rotors", 0.1, [-1.0, -0.5, 0.0, 0.0])
    hover = load_vehicle("ardrone2").hover_rate
    assert_allclose(info["command"], hover * np.array([0.0, 0.5, 1.0, 1.0]))


def test_observations_are_of_the_estimate_relative_to_the_reference():
    env, _, seen = flying("attitude", 0.4, [0.4, 0.0, 0.0, 0.0], observation="all", normalize=False)
    loop = env.loop
    row = env.many.episodes.references[0, 80]
    turn = seen[6:9]
    assert_allclose(turn, [0.2, 0.0, 0.0], atol=0.03)
    position, _, velocity, rate, torque, force = np.split(loop.state[:19], [3, 7, 10, 13, 16])
    expected = [*(row[:3] - position), *-velocity, *turn, *rate, *force, *torque]
    assert_allclose(seen[:18], expected, atol=1e-6)
    assert_allclose(seen[18:24], [*loop.specific, *loop.thrust], rtol=1e-5)
    assert_allclose(seen[24:], [0.4, 0.0, 0.0, 0.0], rtol=1e-6)
    parts = {"pose": slice(0, 12), "wrench": slice(0, 18), "imu": [*range(12), *range(18, 24)]}
    for name, some in parts.items():
        other = flying("attitude", 0.4, [0.4, 0.0, 0.0, 0.0], observation=name, normalize=False)
        assert_array_equal(other[2], np.concatenate([seen[some], seen[24:]]))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"action": "thrust"}, "action"),
        ({"observation": "camera"}, "observation"),
        ({"decision_hz": 60}, "decision_hz must be 200 Hz over a whole number"),
        ({"decision_hz": 400}, "decision_hz must be"),
        ({"action": "rotors", "observation": "own"}, "limits and scales must be"),
    ],
)
def test_what_is_unknown_is_named(given, said):
    with refused(said):
        gym.make("windwrench/WindHover-v2", **given)


@pytest.mark.parametrize("task", ["FanTracking", "WindTrajectory"])
def test_a_small_and_a_large_vehicle_find_the_task_as_hard_as_the_standard_one(task):
    """Force over weight, torque over weight times arm, and the error, of 10 s under the flight
    loop alone.
    """
    large = replace(
        load_vehicle("ardrone2"),
        name="large",
        mass=1.86,
        arm_l=0.2524,
        inertia=load_vehicle("ardrone2").inertia * 16.0,
        k=load_vehicle("ardrone2").k * 4.0,
        p=load_vehicle("ardrone2").p * 4.0,
    )
    felt = {}
    for vehicle in (load_vehicle("ardrone2"), load_vehicle("crazyflie"), large):
        scale = vehicle.weight * np.array([1.0, vehicle.arm_l])
        env = gym.make(f"windwrench/{task}-v2", vehicle=vehicle, decision_hz=50)
        rows = []
        for seed in range(2):
            env.reset(seed=seed)
            for _ in range(250):
                *_, lost, _, info = env.step(np.zeros(env.action_space.shape, np.float32))
                assert not lost
                size = [norm(info[name]) for name in ("force", "torque")]
                rows.append([*(size / scale), info.get("error", abs(info.get("offset", 0.0)))])
        felt[vehicle.name] = rms(rows, axis=0)
    for name in ("crazyflie", "large"):
        force, torque, error = felt[name] / felt["ardrone2"]
        assert (force, error) == (pytest.approx(1.0, abs=0.25), pytest.approx(1.0, abs=0.35))
        assert 0.4 < torque < 2.0  # the rotors' own part goes with the inertia


def numbers(envs, decisions, seed=3):
    rng = default_rng(1)
    rows = []
    envs.reset(seed=seed)
    shape = 2, *envs.action_space.shape[-1:]
    for _ in range(decisions):
        actions = rng.uniform(-0.1, 0.1, shape).astype(np.float32)
        seen, rewards, *_ = envs.step(actions[: getattr(envs, "num_envs", 1)])
        rows.append(np.column_stack([seen, rewards]))
    return np.array(rows)


# each action, observation and task
COMBINED = [*zip(cycle(TASKS), ACTIONS, cycle(OBSERVATIONS))]


@pytest.mark.parametrize(("task", "action", "observation"), COMBINED)
def test_five_actions_and_four_observations_on_four_tasks(task, action, observation):
    """Gymnasium's and SB3's checkers, and all ways to fly many, in drawn vehicles and winds."""
    given = {"action": action, "observation": observation, "decision_hz": 100, "episode_s": 0.2}
    given |= {"scenario": "varied"}
    name = f"windwrench/{task}-v2"
    env = gym.make(name, **given)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=True)
        pytest.importorskip("stable_baselines3.common.env_checker").check_env(env)
    ways = {"vectorization_mode": "sync"}, {}, {"plant": "lanes"}
    made = (gym.make_vec(name, num_envs=2, **way, **given) for way in ways)
    sync, mujoco, lanes = (numbers(envs, 3) for envs in made)
    assert_array_equal(sync, mujoco)
    assert_allclose(lanes, mujoco, atol=2e-5)
    assert lanes.shape[2] == env.observation_space.shape[0] + 1
