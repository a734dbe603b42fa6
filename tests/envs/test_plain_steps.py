"""Where MuJoCo or NumPy do not offer their C functions, flights go through Python and are the same
bit for bit.
"""

import _thread
import multiprocessing
import re
import sys
import threading
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import mujoco
import numpy as np
import pytest

from tests.envs.test_golden import KEPT, TOLERANCE
from tests.support.golden_trajectories import trajectory
from windwrench.dynamics import load_vehicle
from windwrench.envs import FanTrackingEnv, mujoco_step, plain_steps
from windwrench.envs.closed_loop import ClosedLoop
from windwrench.envs.plant import NOISE
from windwrench.envs.recording import record_flight
from windwrench.envs.scenarios import SCENARIOS
from windwrench.envs.suspended_load import SuspendedLoad
from windwrench.envs.vector import FanTrackingVectorEnv
from windwrench.envs.watched_fan_tracking import SensingFanTracking
from windwrench.runtime import random_normals
from windwrench.runtime.addresses import library_function

VEHICLE = load_vehicle("ardrone2")
NOTE = re.compile(
    r"windwrench: (.*): flights call (.*) through Python, .*; the results are the same"
)


def choose_anew():
    """Forget what was found: it is looked for once a process."""
    plain_steps._choose.cache_clear()
    mujoco_step.mj_step_address.cache_clear()
    random_normals.normals_address.cache_clear()


@pytest.fixture
def plain(monkeypatch):
    """Have MuJoCo and NumPy called through Python."""
    monkeypatch.setenv("WINDWRENCH_PLAIN_STEPS", "1")
    choose_anew()
    yield
    choose_anew()


@pytest.fixture
def through_python(monkeypatch):
    """Returns a flight's result with MuJoCo and NumPy called through Python."""

    def call(fly):
        with monkeypatch.context() as patch:
            patch.setenv("WINDWRENCH_PLAIN_STEPS", "1")
            choose_anew()
            result = fly()
        choose_anew()
        return result

    choose_anew()
    yield call
    choose_anew()


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_trajectories_are_those_of_the_environments_version(scenario, plain):
    now, golden = trajectory(scenario), KEPT["scenarios"][scenario]
    for name, tolerance in TOLERANCE.items():
        np.testing.assert_allclose(now[name], golden[name], rtol=0, atol=tolerance)


@pytest.mark.parametrize("scenario", ["gusty", "varied"])
@pytest.mark.parametrize("kind", [FanTrackingEnv, SensingFanTracking])
def test_an_episode_is_the_same_bit_for_bit(scenario, kind, through_python):
    def fly():
        env, rng, seen = kind(scenario), np.random.default_rng(0), []
        env.reset(seed=3)
        for _ in range(25):
            frame, reward, *_, info = env.step(rng.uniform(-1, 1, 1).astype(np.float32))
            seen.append([*frame, reward, *info["force"], *info["torque"], *env.loop.data.qpos])
        return np.array([*seen, np.full(len(seen[0]), env.np_random.uniform())])

    np.testing.assert_array_equal(through_python(fly), fly())


@pytest.mark.parametrize("threads", [1, 3])
def test_many_environments_are_the_same_bit_for_bit(threads, through_python):
    def fly(threads=threads):
        envs = FanTrackingVectorEnv(5, scenario="base", threads=threads, max_episode_steps=7)
        rng, seen = np.random.default_rng(0), []
        envs.reset(seed=4)
        for _ in range(20):
            frames, rewards, lost, over, infos = envs.step(rng.uniform(-1, 1, (5, 1)))
            seen.append(np.column_stack([frames, rewards, lost, over, infos["force"], infos["y"]]))
        envs.close()
        return np.array(seen)

    np.testing.assert_array_equal(through_python(fly), fly(threads=1))


def test_a_recorded_flight_is_the_same_bit_for_bit(through_python):
    def fly():
        return record_flight(VEHICLE, trajectory="circle", seconds=3.0, seed=5)

    one, other = fly(), through_python(fly)
    assert one.keys() == other.keys()
    for name in one:
        np.testing.assert_array_equal(one[name], other[name])


def test_a_flight_with_a_load_is_the_same_bit_for_bit(through_python):
    def fly():
        loop, rng = ClosedLoop(VEHICLE, load=SuspendedLoad()), np.random.default_rng(0)
        loop.reset(rng, np.array([0.0, 0.0, 1.2]))
        loop.hang_load()
        loop.run(rng.standard_normal((200, NOISE)))
        assert loop.healthy()
        return np.concatenate([*loop.motion, loop.state, loop.load_pull()])

    np.testing.assert_array_equal(fly(), through_python(fly))


@pytest.mark.parametrize("threads", [1, 2])
def test_a_state_that_mujoco_reset_is_lost(threads, plain, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log where it runs
    envs = FanTrackingVectorEnv(3, threads=threads)
    actions = np.zeros((3, 1))
    envs.reset(seed=0)
    assert not envs.step(actions)[2].any()
    envs.envs[1].loop.data.qvel[0] = np.nan
    assert envs.step(actions)[2].tolist() == [False, True, False]
    assert [env.loop.was_reset for env in envs.envs] == [False, True, False]
    assert not envs.step(actions)[2].any()  # a new episode
    assert not envs.envs[1].loop.was_reset
    envs.close()


def test_a_reset_in_the_first_tick_is_seen(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    loop, rng = ClosedLoop(VEHICLE), np.random.default_rng(0)
    loop.reset(rng, np.array([0.0, 0.0, 1.2]))
    loop.data.qvel[0] = np.nan
    assert not loop.was_reset
    loop.run(np.zeros((1, NOISE)))
    assert loop.was_reset
    loop.run(np.zeros((3, NOISE)))
    assert loop.was_reset
    loop.reset(rng, np.array([0.0, 0.0, 1.2]))
    loop.run(np.zeros((1, NOISE)))
    assert not loop.was_reset


def test_an_interrupt_ends_a_flight(plain, capfd):
    loop = ClosedLoop(VEHICLE)
    loop.reset(np.random.default_rng(0), np.array([0.0, 0.0, 1.2]))
    threading.Timer(0.02, _thread.interrupt_main).start()
    with pytest.raises(KeyboardInterrupt):
        loop.run(np.zeros((20_000, NOISE)))  # for some 0.2 s
    assert loop.healthy()
    assert "ignored" not in capfd.readouterr().err


def fly_once(seed):
    """Return an observation; in a worker process, too."""
    env = FanTrackingEnv("static")
    env.reset(seed=seed)
    return env.step(np.zeros(1, np.float32))[0]


def notes(capfd):
    """Return what was said of plain steps; a busy machine says that it compiles, too."""
    return [
        found for line in capfd.readouterr().err.splitlines() if (found := NOTE.fullmatch(line))
    ]


def test_it_is_said_once_by_however_many_environments_threads_and_workers(plain, capfd):
    with ThreadPoolExecutor(4) as pool:
        seen = list(pool.map(fly_once, [1] * 8))
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        seen += list(pool.map(fly_once, [1] * 2))
    envs = FanTrackingVectorEnv(2, scenario="static")
    envs.reset(seed=1)
    np.testing.assert_array_equal(seen, np.tile(envs.step(np.zeros((2, 1)))[0][0], (10, 1)))
    (note,) = notes(capfd)
    assert note.groups() == ("WINDWRENCH_PLAIN_STEPS is set", "MuJoCo and NumPy")


@pytest.mark.parametrize("value", ["", "0"])
def test_nothing_is_said_where_nothing_is_missing(value, monkeypatch, capfd):
    monkeypatch.setenv("WINDWRENCH_PLAIN_STEPS", value)
    choose_anew()
    fly_once(0)
    assert plain_steps._choose() == (False, False)
    assert not notes(capfd)


def without_library(patch, tmp_path):
    patch.setattr(mujoco, "__file__", str(tmp_path / "__init__.py"))


def without_symbol(patch, tmp_path):
    patch.setattr(
        mujoco_step, "library_function", lambda path, name: library_function(path, f"no_{name}")
    )


def without_addresses(patch, tmp_path):
    patch.delattr(mujoco.MjData, "_address")


def without_exported_normals(patch, tmp_path):
    patch.setattr("numpy.random._generator.__file__", np.random.bit_generator.__file__)


def without_generator_module(patch, tmp_path):
    patch.setitem(sys.modules, "numpy.random._generator", None)


@pytest.mark.parametrize(
    ("hide", "library", "said"),
    [
        (without_library, "MuJoCo", "mj_step"),
        (without_symbol, "MuJoCo", "no_mj_step in libmujoco"),
        (without_addresses, "MuJoCo", "the address of MjData"),
        (without_exported_normals, "NumPy", "random_standard_normal_fill in bit_generator"),
        (without_generator_module, "NumPy", "random_standard_normal_fill"),
    ],
)
def test_what_is_missing_is_named_and_the_flight_is_the_same(
    hide, library, said, monkeypatch, tmp_path, capfd
):
    choose_anew()
    expected = fly_once(7)
    with monkeypatch.context() as patch:
        hide(patch, tmp_path)
        choose_anew()
        seen = fly_once(7), fly_once(7)
        plain = plain_steps._choose()
    choose_anew()
    np.testing.assert_array_equal(seen, (expected, expected))
    assert plain == (library == "MuJoCo", library == "NumPy")
    (note,) = capfd.readouterr().err.splitlines()
    reason, called = NOTE.fullmatch(note).groups()
    version = mujoco.__version__ if library == "MuJoCo" else np.__version__
    assert reason.startswith(f"{library.lower()} {version} does not offer ")
    assert said in reason
    assert called == library


def test_both_that_are_missing_are_said_in_one_line(monkeypatch, tmp_path, capfd):
    with monkeypatch.context() as patch:
        without_library(patch, tmp_path)
        without_exported_normals(patch, tmp_path)
        choose_anew()
        fly_once(0)
    choose_anew()
    (note,) = capfd.readouterr().err.splitlines()
    reason, called = NOTE.fullmatch(note).groups()
    assert "mj_step" in reason
    assert "random_standard_normal_fill" in reason
    assert called == "MuJoCo and NumPy"
