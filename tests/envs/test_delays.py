"""What is late by so many ticks, and poses that are lost in runs."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.vector_flights import TASKS, fly, make
from windwrench.dynamics import load_vehicle
from windwrench.envs import SCENARIOS
from windwrench.envs.closed_loop import ClosedLoop
from windwrench.envs.plant import PlantSettings
from windwrench.envs.wind_scenarios import WIND_SCENARIOS

VEHICLE = load_vehicle("ardrone2")
QUIET = PlantSettings(motor_lag=0.0, sensor_noise=False)
LATE = PlantSettings(
    actuator_delay=0.01, pose_delay=0.015, imu_delay=0.02, dropout=0.2, dropout_burst=0.03
)


def ticking(settings, ticks, **given):
    """Yield a loop after each tick, with where it was before."""
    rng = np.random.default_rng(3)
    loop = ClosedLoop(VEHICLE, settings=settings, **given)
    loop.reset(rng, np.array([0.0, 0.0, 1.0]))
    loop.setpoint[:3] = 0.5, 0.2, 1.2
    for _ in range(ticks):
        before = loop.position.copy()
        loop.run(rng.standard_normal((1, loop.noise_size)))
        yield loop, before


@pytest.mark.parametrize("ticks", [0, 1, 4])
def test_rotors_follow_what_was_commanded_so_many_ticks_ago(ticks):
    flown = [
        (loop.command.copy(), loop.unrounded.copy())
        for loop, _ in ticking(replace(QUIET, actuator_delay=0.005 * ticks), 40)
    ]
    commands, speeds = (np.array(part) for part in zip(*flown, strict=True))
    largest = next(ticking(QUIET, 1))[0].record[0]["plant"]["omega_max"]
    np.testing.assert_array_equal(speeds[ticks:], np.clip(commands, 0, largest)[: 40 - ticks])


@pytest.mark.parametrize("ticks", [0, 3, 20])
def test_a_pose_is_that_of_so_many_ticks_ago(ticks):
    flown = [
        (before, loop.sample[4:7].copy())
        for loop, before in ticking(replace(QUIET, pose_delay=0.005 * ticks), 60)
    ]
    places, measured = (np.array(part) for part in zip(*flown, strict=True))
    np.testing.assert_array_equal(measured[ticks:], places[: 60 - ticks])


def test_an_accelerometer_tells_what_it_felt_so_many_ticks_ago():
    felt, told = [], []
    for loop, _ in ticking(replace(QUIET, imu_delay=0.015), 40, accelerometer=(0.0, 0.0)):
        record = loop.record[0]
        felt.append(record["plant"]["rotation"].T @ loop.world.xfrc[:3] / VEHICLE.mass)
        told.append(record["flight"]["rotation"].T @ loop.specific)
    np.testing.assert_allclose(told[3:], felt[:-3], atol=1e-9)
    assert np.abs(np.array(told) - np.array(felt)).max() > 0.01


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
        np.testing.assert_allclose(flown[how, "lanes"], flown[how, "mujoco"], atol=2e-5)
    assert np.abs(flown["as stated", "lanes"] - flown["at once", "lanes"]).max() > 1e-3
