"""The fan-tracking environment: its interface, its repeatability, how it starts and ends."""

import copy
import pickle
import subprocess
import sys
import warnings

import gymnasium as gym
import numpy as np
import pytest

import windwrench
from windwrench.controllers import Admittance
from windwrench.dynamics import InputError, load_vehicle
from windwrench.dynamics.vehicle import EffectSetting
from windwrench.envs import FanTrackingEnv
from windwrench.envs.plant import NOISE
from windwrench.envs.vector import FanTrackingVectorEnv
from windwrench.evaluation.episodes import fly_episode

NAME = "windwrench/FanTracking-v0"


def commands(count, seed=0):
    return np.random.default_rng(seed).uniform(-0.5, 0.5, (count, 1)).astype(np.float32)


def fly(env, seed, count=15):
    """Everything that an episode's first decisions return, as one array."""
    observation, info = env.reset(seed=seed)
    rows = [[*observation, 0.0, info["y"], info["fan_y"]]]
    for action in commands(count):
        observation, reward, _, _, info = env.step(action)
        rows.append([*observation, reward, info["y"], info["fan_y"]])
    return np.array(rows, dtype=np.float64)


def test_stable_baselines_checker_finds_nothing():
    checker = pytest.importorskip(
        "stable_baselines3.common.env_checker",
        reason="stable_baselines3 is not installed: pip install 'windwrench[rl]'",
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        checker.check_env(gym.make(NAME), warn=True)


def test_the_name_makes_it_with_a_time_limit():
    env = gym.make(NAME, scenario="static")
    env.reset(seed=0)
    ends = [env.step(np.zeros(1, np.float32))[2:4] for _ in range(250)]
    assert ends == [(False, False)] * 249 + [(False, True)]
    assert isinstance(env.unwrapped, FanTrackingEnv)
    assert env.spec.max_episode_steps == 250
    assert windwrench.__version__


def test_the_name_with_its_module_makes_it_without_an_import_from_any_folder(tmp_path):
    code = (
        "import gymnasium as gym, sys\n"
        "env = gym.make('windwrench:windwrench/FanTracking-v0')\n"
        "print(env.reset(seed=1)[0].shape)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.stdout.strip() == "(8,)", done.stderr


@pytest.mark.parametrize("scenario", ["base", "varied"])
def test_an_episode_does_not_feel_another_environment(scenario):
    alone = fly(FanTrackingEnv(scenario), 3)
    env, other = FanTrackingEnv(scenario), FanTrackingEnv("gusty")
    other.reset(seed=9)
    observation, info = env.reset(seed=3)
    rows = [[*observation, 0.0, info["y"], info["fan_y"]]]
    for action in commands(15):
        other.step(np.array([0.7], np.float32))
        observation, reward, _, _, info = env.step(action)
        other.step(np.array([-0.2], np.float32))
        rows.append([*observation, reward, info["y"], info["fan_y"]])
    np.testing.assert_array_equal(np.array(rows, dtype=np.float64), alone)


def test_an_episode_and_numpy_s_global_random_state_leave_each_other_alone():
    env = FanTrackingEnv("varied")
    first = fly(env, 5)
    np.random.seed(123)  # noqa: NPY002
    expected = np.random.random(3)  # noqa: NPY002
    np.random.seed(123)  # noqa: NPY002
    np.testing.assert_array_equal(fly(env, 5), first)
    np.testing.assert_array_equal(np.random.random(3), expected)  # noqa: NPY002


def test_what_is_there_to_be_drawn_does_not_change_the_flight():
    np.testing.assert_array_equal(
        fly(FanTrackingEnv(render_mode="rgb_array"), 3), fly(FanTrackingEnv(), 3)
    )


def test_the_reward_is_as_stated():
    env = FanTrackingEnv()
    env.reset(seed=2)
    last = 0.0
    for command in (0.4, -0.2, 1.0, 3.0):  # the last is clipped to 1
        _, reward, _, _, info = env.step(np.array([command], np.float32))
        used = min(float(np.float32(command)), 1.0)
        assert reward == pytest.approx(
            1 / (1 + (info["offset"] / 0.3) ** 2) - 0.05 * (used - last) ** 2, rel=1e-12
        )
        assert info["offset"] == pytest.approx(info["y"] - info["fan_y"])
        last = used


def test_the_observation_is_the_estimated_wrench_velocity_and_last_command():
    env = FanTrackingEnv("static")
    env.reset(seed=4)
    for _ in range(25):
        observation, _, _, _, info = env.step(np.array([0.25], np.float32))
    assert observation[7] == np.float32(0.25)
    assert observation[6] == pytest.approx(0.25, abs=0.15)
    assert observation[0] == pytest.approx(info["force"][0], abs=0.25)
    assert env.loop.velocity[1] == pytest.approx(observation[6], abs=0.05)


@pytest.mark.parametrize(
    "action",
    [
        np.array([np.nan]),
        np.array([np.inf]),
        np.zeros(2),
        np.zeros((1, 1)),
        0.3,
        np.array([]),
    ],
)
def test_a_bad_action_is_named(action):
    env = FanTrackingEnv()
    env.reset(seed=0)
    with pytest.raises(InputError, match=r"action must be one finite number in m/s, shape \(1,\)"):
        env.step(action)


def test_step_and_render_before_reset_are_named():
    env = FanTrackingEnv(render_mode="rgb_array")
    with pytest.raises(InputError, match="reset before step"):
        env.step(np.zeros(1, np.float32))
    with pytest.raises(InputError, match="reset"):
        env.render()
    with pytest.raises(InputError, match="render_mode"):
        FanTrackingEnv().render()


def test_a_given_fan_path_is_followed():
    env = FanTrackingEnv("static", fan_path=lambda t: 0.1 * np.sin(t))
    _, info = env.reset(seed=0)
    assert info["fan_motion"] == "given"
    for k in range(1, 30):
        _, _, _, _, info = env.step(np.zeros(1, np.float32))
        assert info["fan_y"] == pytest.approx(0.1 * np.sin(k * 0.08 - 0.005), abs=1e-9)
        assert info["fan_velocity"] == pytest.approx(0.1 * np.cos(k * 0.08), abs=1e-3)


@pytest.mark.parametrize(
    "path", [lambda t: 0.0, lambda t: t[:-1], lambda t: np.full_like(t, np.nan)]
)
def test_after_a_bad_fan_path_which_is_named_there_is_no_step(path):
    env = FanTrackingEnv(fan_path=path)
    with pytest.raises(InputError, match="fan_path must return"):
        env.reset(seed=0)
    with pytest.raises(InputError, match="reset before step"):
        env.step(np.zeros(1, np.float32))


def test_a_vehicle_that_leaves_is_lost():
    env = FanTrackingEnv("static")
    env.reset(seed=0)
    side = np.sign(env.loop.position[1])
    terminated = False
    while not terminated:
        assert env.loop.time < 6.0
        observation, reward, terminated, truncated, info = env.step(np.array([side], np.float32))
        assert observation in env.observation_space
    assert not truncated
    assert info["lost"]
    assert abs(info["offset"]) > 2.5
    assert reward < 0.05


def test_the_constant_gain_flies_much_the_same():
    full, constant = (
        fly(FanTrackingEnv(), 7, 25),
        fly(FanTrackingEnv(estimator="constant-gain"), 7, 25),
    )
    assert not np.array_equal(full, constant)
    np.testing.assert_allclose(constant[:, :3], full[:, :3], atol=0.02)  # N
    np.testing.assert_allclose(constant[:, 3:6], full[:, 3:6], atol=0.003)  # Nm
    np.testing.assert_allclose(constant[:, 9], full[:, 9], atol=0.005)  # m


@pytest.mark.parametrize("what", ["plant", "filter"])
def test_a_state_that_is_no_number_is_lost(what, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log where it runs
    env = FanTrackingEnv()
    env.reset(seed=0)
    env.step(np.zeros(1, np.float32))
    if what == "plant":
        env.loop.data.qvel[0] = np.nan
    else:
        env.loop.state[16] = np.nan
    observation, _, lost, _, info = env.step(np.zeros(1, np.float32))
    # the filter starts over at the last pose; the plant cannot
    assert lost == info["lost"] == (what == "plant")
    assert np.isfinite(env.loop.state[:19]).all()
    assert observation in env.observation_space


def test_without_a_time_limit_it_flies_on_and_the_fan_stands_still_after_20_s():
    env = FanTrackingEnv("static", fan_path=lambda t: 0.01 * t)
    env.reset(seed=0)
    seen = [env.step(np.zeros(1, np.float32))[4]["fan_y"] for _ in range(260)]
    assert seen[248] == pytest.approx(0.01 * (249 * 0.08 - 0.005))
    assert seen[-1] == pytest.approx(0.01 * 20.0)
    assert len(set(seen[-5:])) == 1


def test_reset_refuses_options_that_it_does_not_know():
    env = gym.make("windwrench/FanTracking-v0")
    env.reset(seed=0, options={})
    with pytest.raises(InputError, match=r"unknown option.*'speed'; expected none"):
        env.reset(options={"speed": 1.0})
    envs = gym.make_vec(
        "windwrench/FanTracking-v0", num_envs=2, vectorization_mode="vector_entry_point"
    )
    envs.reset(options={"reset_mask": np.array([True, False])})
    with pytest.raises(InputError, match=r"unknown option 'mask'.*expected one of reset_mask"):
        envs.reset(options={"mask": 1})


def test_a_decision_is_sixteen_ticks_with_numpy_s_normals():
    env, twin = FanTrackingEnv("fast"), FanTrackingEnv("fast")
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


def test_one_state_that_is_no_number_is_lost_and_the_others_fly_on(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log where it runs
    envs, healthy = FanTrackingVectorEnv(3, threads=2), FanTrackingVectorEnv(3)
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


VEHICLE = load_vehicle("ardrone2")
HEAVY = EffectSetting("mass", {"dm": 0.06})


def test_a_declared_effect_does_not_come_into_the_world_twice():
    for model in (VEHICLE, VEHICLE.with_effects(HEAVY)):
        env = FanTrackingEnv("base", vehicle=model, truth=VEHICLE, effects=(HEAVY,))
        env.reset(seed=0)
        body = env.loop.model.body("vehicle").id
        assert env.loop.model.body_mass[body] == pytest.approx(0.525)


def test_without_a_truth_the_true_vehicle_is_as_declared():
    vehicle = VEHICLE.with_effects(EffectSetting("rotor_drag", {"kdx": 1e-4, "kdy": 1e-4}))
    flown = [
        fly_episode(FanTrackingEnv("varied", vehicle=vehicle, truth=truth), Admittance(), 5)
        for truth in (None, vehicle, VEHICLE)
    ]
    assert np.array_equal(flown[0].observation, flown[1].observation)
    assert not np.array_equal(flown[0].observation, flown[2].observation)


def test_the_flight_loop_knows_a_declared_mass():
    """The flight loop commands the thrust that the true weight needs: the height does not sag."""
    heights = []
    for model in (VEHICLE, VEHICLE.with_effects(HEAVY)):
        env = FanTrackingEnv("static", vehicle=model, truth=VEHICLE, effects=(HEAVY,))
        env.reset(seed=0)  # it settles for 1.5 s
        heights.append(float(env.loop.position[2] - env.fan.height))
    assert heights[0] < -0.05
    assert abs(heights[1]) < 0.3 * abs(heights[0])
