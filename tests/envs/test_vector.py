"""Many environments in one process are as many single ones."""

import time
from concurrent.futures import ThreadPoolExecutor

import gymnasium as gym
import numpy as np
import pytest

import windwrench  # noqa: F401  registers the environment
from windwrench.dynamics import InputError
from windwrench.runtime.compiled import compiled_without_gil
from windwrench.runtime.work_sharing import (
    all_done,
    next_task,
    open_tasks,
    stop_looking,
    task_done,
    tasks_open,
)

NAME = "windwrench/FanTracking-v0"


def make(num_envs, **kwargs):
    return gym.make_vec(NAME, num_envs=num_envs, vectorization_mode="vector_entry_point", **kwargs)


def test_each_is_the_single_environment_with_its_seed():
    envs = make(3, scenario="fast")
    singles = [gym.make(NAME, scenario="fast") for _ in range(3)]
    frames, _ = envs.reset(seed=40)
    np.testing.assert_array_equal(
        frames, [env.reset(seed=40 + i)[0] for i, env in enumerate(singles)]
    )
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


def rows(envs, seed, count, max_steps=None):
    """Everything that the first steps return, as one array (count, n, .)."""
    rng, out = np.random.default_rng(seed), []
    frames, infos = envs.reset(seed=seed)
    for _ in range(count):
        frames, rewards, lost, over, infos = envs.step(
            rng.uniform(-1, 1, (envs.num_envs, 1)).astype(np.float32)
        )
        numbers = [infos[name] for name in NUMBERS]
        out.append(
            np.column_stack(
                [frames, rewards, lost, over, *numbers, infos["force"], infos["torque"]]
            )
        )
    return np.array(out)


NUMBERS = (
    "reward_tracking",
    "reward_change",
    "fan_y",
    "fan_velocity",
    "y",
    "offset",
    "time",
    "lost",
)


@pytest.mark.parametrize("estimator", ["ukf", "constant-gain"])
@pytest.mark.parametrize("threads", [2, 5])
def test_threads_give_the_same_bits(estimator, threads):
    given = {"scenario": "varied", "estimator": estimator, "max_episode_steps": 7}
    alone, spread = make(5, **given), make(5, threads=threads, **given)
    np.testing.assert_array_equal(rows(alone, 3, 20), rows(spread, 3, 20))
    spread.close()


def test_an_episode_after_another_is_that_of_the_single_environment():
    envs, single = make(2, max_episode_steps=5), gym.make(NAME, max_episode_steps=5)
    envs.reset(seed=1)
    single.reset(seed=2)
    ended = False
    for k in range(18):
        action = np.array([0.1 * (k % 7) - 0.3], np.float32)
        frames, rewards, lost, over, infos = envs.step(np.stack([action, action]))
        if ended:
            frame, info = single.reset()
            reward, terminated, truncated = 0.0, False, False
        else:
            frame, reward, terminated, truncated, info = single.step(action)
        np.testing.assert_array_equal(frames[1], frame)
        assert (rewards[1], lost[1], over[1]) == (reward, terminated, truncated)
        assert {key for key in infos if not key.startswith("_")} == set(info)
        for key, value in info.items():
            np.testing.assert_array_equal(infos[key][1], value)
            assert infos[f"_{key}"].all()
        ended = terminated or truncated


def test_a_lost_vehicle_starts_anew_and_the_others_fly_on():
    envs = make(2, scenario="static", max_episode_steps=1000)
    _, infos = envs.reset(seed=0)
    away = np.array([[np.sign(infos["offset"][0])], [0.0]], np.float32)
    lost = np.zeros(2, bool)
    while not lost.any():
        _, _, lost, _, infos = envs.step(away)
        assert infos["time"][0] < 6.0
    assert lost.tolist() == [True, False]
    then = infos["time"][1]
    _, rewards, lost, _, infos = envs.step(away)
    assert not lost.any()
    assert rewards[0] == 0.0
    assert infos["time"].tolist() == [0.0, pytest.approx(then + 0.08)]


def test_seeds_may_be_listed_and_a_part_reset():
    envs = make(3)
    frames, _ = envs.reset(seed=[7, 5, 7])
    np.testing.assert_array_equal(frames[0], frames[2])
    assert not np.array_equal(frames[0], frames[1])
    for _ in range(2):
        envs.step(np.zeros((3, 1), np.float32))
    again, infos = envs.reset(
        seed=[7, None, None], options={"reset_mask": np.array([True, False, False])}
    )
    np.testing.assert_array_equal(again[0], frames[0])
    assert infos["time"].tolist() == [0.0, pytest.approx(0.16), pytest.approx(0.16)]
    with pytest.raises(InputError, match="3 seeds"):
        envs.reset(seed=[1, 2])


@pytest.mark.parametrize("actions", [np.zeros(3), np.zeros((2, 1)), np.full((3, 1), np.nan)])
def test_bad_actions_are_named_and_nothing_flies(actions):
    envs = make(3)
    envs.reset(seed=0)
    with pytest.raises(InputError, match=r"shape \(3, 1\)"):
        envs.step(actions)
    assert (envs.step(np.zeros((3, 1)))[4]["time"] == 0.08).all()


def test_threads_must_be_positive():
    with pytest.raises(InputError, match="threads"):
        make(2, threads=0)


@pytest.mark.parametrize("count", [0, -1])
def test_too_few_are_refused(count):
    with pytest.raises(InputError, match="num_envs"):
        make(count)


def test_tasks_are_taken_once_each_by_however_many_threads():
    tasks, taken = np.zeros(3, dtype=np.int64), np.zeros(20_000, dtype=np.int64)
    for _ in range(3):
        taken[:] = 0
        open_tasks(tasks)
        assert not all_done(tasks, len(taken))
        with ThreadPoolExecutor(4) as pool:
            for done in [pool.submit(take_all, tasks, taken) for _ in range(4)]:
                done.result()
        assert (taken == 1).all()
        assert all_done(tasks, len(taken))


@compiled_without_gil
def take_all(tasks, taken):
    while True:
        n = next_task(tasks)
        if n >= len(taken):
            break
        taken[n] += 1
        task_done(tasks)


def test_tasks_open_for_a_thread_that_looks_and_say_who_has_left():
    tasks = np.zeros(3, dtype=np.int64)
    assert open_tasks(tasks) == 0
    assert look(tasks, 1, 1)
    tasks[0] = 1
    assert not look(tasks, 1, 1000)
    go(tasks)
    go(tasks)
    assert open_tasks(tasks) == 2
    assert tasks.tolist() == [0, 0, 0]


@compiled_without_gil
def look(tasks, count, patience):
    return tasks_open(tasks, count, patience)


@compiled_without_gil
def go(tasks):
    stop_looking(tasks)


def test_helpers_sleep_and_are_called_back_and_the_bits_stay(monkeypatch):
    """Steps come about as long after each other as a helper's patience lasts, so that they meet it
    in every state.
    """
    monkeypatch.setattr("windwrench.envs.vector.PATIENCE", 2000)
    alone, spread = make(4, scenario="base"), make(4, threads=3, scenario="base")
    alone.reset(seed=0)
    spread.reset(seed=0)
    called = []
    call_others = spread._call_others
    spread._call_others = lambda work, count: called.append(count) or call_others(work, count)
    pauses = np.random.default_rng(0).uniform(0.0, 3e-5, 200)
    for pause in pauses:
        if pause > 1e-5:
            time.sleep(pause)
        frames = spread.step(np.zeros((4, 1)))[0]
        np.testing.assert_array_equal(frames, alone.step(np.zeros((4, 1)))[0])
    assert called[0] == 2
    assert len(called) > 1
    assert max(called) <= 2
    spread.close()
    alone.close()


def test_a_thread_that_fails_with_a_turn_in_hand_is_not_waited_for():
    envs = make(3, threads=2)
    envs.reset(seed=0)
    envs.step(np.zeros((3, 1)))
    envs._pool.submit(int).result()  # by then the helper has left
    decide, help_on = envs._call, envs._help

    def wait_and_decide():
        while envs._tasks[0] == 0:
            time.sleep(0.001)
        decide()

    def fail():
        next_task(envs._tasks)
        raise RuntimeError("a thread's own fault")

    envs._call, envs._help = wait_and_decide, fail
    with pytest.raises(RuntimeError, match="own fault"):
        envs.step(np.zeros((3, 1)))
    envs._call, envs._help = decide, help_on
    assert len(envs.step(np.zeros((3, 1)))[0]) == 3
    envs.close()
