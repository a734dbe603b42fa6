"""The stages of the loop: a user's own by their names, what is late, and poses that are lost."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from tests.support.vector_flights import TASKS, fly, fly_alone, make, make_single
from tests.support.vehicles import VEHICLE
from windwrench.envs import SCENARIOS, FanTrackingEnv, Stage
from windwrench.envs.closed_loop import STAGES, ClosedLoop
from windwrench.envs.plant import PlantSettings
from windwrench.envs.wind_scenarios import WIND_SCENARIOS


def push(loop):
    loop.applied[2] = -0.2


def alone(name, **given):
    return fly_alone(make_single(name, **given), seed=3)


@pytest.mark.parametrize("name", TASKS)
def test_stage_by_stage_the_flight_is_that_of_the_compiled_call_bit_for_bit(name):
    seen = []
    watch = Stage("watch", lambda loop: seen.append(loop.ticks), before="estimate")
    assert_array_equal(alone(name, stages=[watch]), alone(name))
    assert seen[0] == -300
    assert (np.diff(seen) == 1).all()


def test_so_it_flies_in_a_vector_of_environments():
    given = {"stages": [Stage("push", push, before="actuate")]}
    single = [lambda: make_single(**given)] * 2
    many = fly(make(2, **given), 4)
    assert_array_equal(many, fly(gym.vector.SyncVectorEnv(single), 4))
    assert not np.array_equal(many, fly(make(2), 4))


def test_a_sensor_an_actuator_and_a_wind_of_one_s_own_change_the_flight():
    def offset(loop):
        loop.sample[4] += 0.02

    def stop(loop):
        if loop.time >= 0.0:
            loop.command[:] = 0.0

    def flying(*stage):
        env = FanTrackingEnv("static", stages=[Stage(*stage)] if stage else [])
        env.reset(seed=0)
        return env

    pushed, free = (
        env.step(np.zeros(1))[4]["force"][2] for env in (flying("push", push, "actuate"), flying())
    )
    assert pushed - free == pytest.approx(-0.2, abs=0.02)
    loop = flying("offset", offset, "estimate").loop
    assert loop.state[0] - loop.position[0] == pytest.approx(0.02, abs=0.005)
    env = flying("stop", stop, "actuate")
    height = env.loop.position[2]
    for _ in range(4):
        env.step(np.zeros(1))
    assert height - env.loop.position[2] == pytest.approx(0.5 * 9.81 * 0.32**2, rel=0.25)  # falls


def test_stages_run_before_the_one_that_they_name_in_the_order_given():
    order = []
    places = {"second": "sense", "last": "move", "third": "sense", "first": "wind"}
    stages = [
        Stage(name, lambda loop, name=name: order.append(name), before)
        for name, before in places.items()
    ]
    env = FanTrackingEnv("static", stages=stages)
    env.reset(seed=0)
    assert order[:4] == ["first", "second", "third", "last"]
    assert [name for name in env.loop.stages if name in STAGES] == list(STAGES)


QUIET = PlantSettings(motor_lag=0.0, sensor_noise=False)
LATE = PlantSettings(
    actuator_delay=0.01, pose_delay=0.015, imu_delay=0.02, dropout=0.2, dropout_burst=0.03
)


def ticking(settings, ticks, **given):
    """Yield a loop after each tick, with where it was before."""
    rng = default_rng(3)
    loop = ClosedLoop(VEHICLE, settings=settings, **given)
    loop.reset(rng, np.array([0.0, 0.0, 1.0]))
    loop.setpoint[:3] = 0.5, 0.2, 1.2
    for _ in range(ticks):
        before = loop.position.copy()
        loop.run(rng.standard_normal((1, loop.noise_size)))
        yield loop, before


@pytest.mark.parametrize("ticks", [0, 1, 4, 20])
def test_rotors_follow_commands_and_a_pose_is_one_of_so_many_ticks_ago(ticks):
    late = 0.005 * ticks
    largest = VEHICLE.omega_max
    flown = [
        (np.clip(loop.command, 0, largest), loop.unrounded.copy(), before, loop.sample[4:7].copy())
        for loop, before in ticking(replace(QUIET, actuator_delay=late, pose_delay=late), 60)
    ]
    commands, speeds, places, measured = (np.array(part) for part in zip(*flown, strict=True))
    assert_array_equal(speeds[ticks:], commands[: 60 - ticks])
    assert_array_equal(measured[ticks:], places[: 60 - ticks])


def test_an_accelerometer_tells_what_it_felt_so_many_ticks_ago():
    felt = []
    told = []
    for loop, _ in ticking(replace(QUIET, imu_delay=0.015), 40, accelerometer=(0.0, 0.0)):
        record = loop.record[0]
        felt.append(record["plant"]["rotation"].T @ loop.world.xfrc[:3] / VEHICLE.mass)
        told.append(record["flight"]["rotation"].T @ loop.specific)
    assert_allclose(told[3:], felt[:-3], atol=1e-9)
    assert abs(np.array(told) - np.array(felt)).max() > 0.01


def test_lost_poses_have_the_stated_share_and_come_in_runs_of_the_stated_length():
    settings = PlantSettings(dropout=0.2, dropout_burst=0.03)
    lost = ~np.array([loop.seen for loop, _ in ticking(settings, 20_000)])
    runs = np.count_nonzero(lost[1:] & ~lost[:-1])
    assert lost.mean() == pytest.approx(0.2, abs=0.03)
    assert 0.005 * lost.sum() / runs == pytest.approx(0.03, rel=0.1)


@pytest.mark.parametrize("task", TASKS)
def test_lanes_are_late_as_mujoco_is_with_delays_stated_and_drawn(task):
    kind = (SCENARIOS if task.startswith("Fan") else WIND_SCENARIOS)["varied"]
    drawn = replace(
        kind.variation, actuator_delay=(0.0, 0.02), pose_delay=(0.0, 0.03), dropout=(0.0, 0.2)
    )
    flown = {}
    for how, given in (
        ("as stated", {"settings": LATE}),
        ("as drawn", {"scenario": replace(kind, variation=drawn)}),
        ("at once", {}),
    ):
        for plant in ("mujoco", "lanes"):
            flown[how, plant] = fly(make(3, plant, task, **given), 6, seed=7)
        assert_allclose(flown[how, "lanes"], flown[how, "mujoco"], atol=2e-5)
    assert abs(flown["as stated", "lanes"] - flown["at once", "lanes"]).max() > 1e-3
