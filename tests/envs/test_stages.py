"""Stages of a user's own stand in the loop by their names."""

import gymnasium as gym
import numpy as np
import pytest

from tests.support.vector_flights import TASKS, fly_alone, make
from tests.support.vector_flights import fly as flown
from windwrench.envs import FanTrackingEnv, Stage
from windwrench.envs.closed_loop import STAGES


def fly(name, **given):
    return fly_alone(gym.make(f"windwrench/{name}-v0", **given), seed=3)


@pytest.mark.parametrize("name", TASKS)
def test_stage_by_stage_the_flight_is_that_of_the_compiled_call_bit_for_bit(name):
    seen = []
    watch = Stage("watch", lambda loop: seen.append(loop.ticks), before="estimate")
    np.testing.assert_array_equal(fly(name, stages=[watch]), fly(name))
    assert seen[0] == -300
    assert np.all(np.diff(seen) == 1)


def test_so_it_flies_in_a_vector_of_environments():
    def push(loop):
        loop.applied[2] = -0.2

    given = {"stages": [Stage("push", push, before="actuate")]}
    alone = [lambda: gym.make("windwrench/FanTracking-v0", **given)] * 2
    many = flown(make(2, **given), 4)
    np.testing.assert_array_equal(many, flown(gym.vector.SyncVectorEnv(alone), 4))
    assert not np.array_equal(many, flown(make(2), 4))


def test_a_sensor_an_actuator_and_a_wind_of_one_s_own_change_the_flight():
    def offset(loop):
        loop.sample[4] += 0.02

    def stop(loop):
        if loop.time >= 0.0:
            loop.command[:] = 0.0

    def push(loop):
        loop.applied[2] = -0.2

    env = FanTrackingEnv("static", stages=[Stage("push", push, before="actuate")])
    plain = FanTrackingEnv("static")
    for one in (env, plain):
        one.reset(seed=0)
    pushed, free = (one.step(np.zeros(1))[4]["force"][2] for one in (env, plain))
    assert pushed - free == pytest.approx(-0.2, abs=0.02)

    env = FanTrackingEnv("static", stages=[Stage("offset", offset, before="estimate")])
    env.reset(seed=0)
    assert env.loop.state[0] - env.loop.position[0] == pytest.approx(0.02, abs=0.005)

    env = FanTrackingEnv("static", stages=[Stage("stop", stop, before="actuate")])
    env.reset(seed=0)
    height = env.loop.position[2]
    for _ in range(4):
        env.step(np.zeros(1))
    assert height - env.loop.position[2] == pytest.approx(0.5 * 9.81 * 0.32**2, rel=0.25)  # falls


def test_stages_run_before_the_one_that_they_name_in_the_order_given():
    order = []
    stages = [
        Stage("second", lambda loop: order.append("second"), before="sense"),
        Stage("last", lambda loop: order.append("last"), before="move"),
        Stage("third", lambda loop: order.append("third"), before="sense"),
        Stage("first", lambda loop: order.append("first"), before="wind"),
    ]
    env = FanTrackingEnv("static", stages=stages)
    env.reset(seed=0)
    assert order[:4] == ["first", "second", "third", "last"]
    assert [name for name in env.loop.stages if name in STAGES] == list(STAGES)
