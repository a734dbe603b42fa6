"""Environments in lanes fly what MuJoCo's fly."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from numba import njit

from tests.support.vector_flights import fly, make
from windwrench.dynamics import load_vehicle
from windwrench.dynamics.vehicle import EffectSetting
from windwrench.envs.closed_loop import ClosedLoop
from windwrench.envs.lanes.flight import LOOPS, Blocks, fly_freely
from windwrench.envs.plant import SUBSTEPS, TICK, PlantSettings, load_world
from windwrench.envs.scenarios import SCENARIOS
from windwrench.runtime.vector_lanes import WIDTH


@pytest.mark.parametrize("name", SCENARIOS)
def test_a_second_is_mujocos(name):
    lanes, reference = (fly(make(3, plant, scenario=name), 13) for plant in ("lanes", "mujoco"))
    assert np.abs(lanes - reference).max() < 1e-9


@pytest.mark.parametrize(
    "given",
    [
        {"settings": PlantSettings(dropout=0.2)},
        {"vehicle": "crazyflie"},
        {"effects": [EffectSetting("com_offset", {"cx": 0.01, "cy": -0.02, "cz": 0.005})]},
        {"observe": "pose"},
        {"observe": "history", "normalize": True},
        {"fan_path": lambda t: 0.3 * np.sin(t)},
    ],
    ids=lambda given: next(iter(given)),
)
def test_so_it_is_with_what_can_be_set(given):
    lanes, reference = (fly(make(2, plant, **given), 6) for plant in ("lanes", "mujoco"))
    assert np.abs(lanes - reference).max() < 1e-6  # numbers that are seen are rounded to 32 bits


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_episodes_end_and_begin_as_mujocos(mode):
    given = {"scenario": "fast", "max_episode_steps": 7, "autoreset_mode": mode}
    lanes, reference = (fly(make(WIDTH + 1, plant, **given), 20) for plant in ("lanes", "mujoco"))
    assert np.abs(lanes - reference).max() < 1e-9


@njit
def fly_on(address, steps, dt):
    loop = LOOPS_AT(address)
    for _ in range(steps):
        fly_freely(loop, dt)


LOOPS_AT = LOOPS.at


def test_a_body_that_tumbles_moves_as_in_mujoco():
    """Centre of mass off the centre, inertia with products, another turn in each lane."""
    inertia = np.array([[2.2, 0.3, -0.2], [0.3, 3.0, 0.1], [-0.2, 0.1, 4.0]]) * 1e-3
    vehicle = replace(load_vehicle("ardrone2"), inertia=inertia, com=np.array([0.02, -0.03, 0.01]))
    blocks = Blocks(1, ClosedLoop(vehicle))
    rng = np.random.default_rng(0)
    start, wrench = rng.normal(0, 5, (6, WIDTH)), rng.normal(0, 0.02, (6, WIDTH))
    blocks.loops["qpos"][0], blocks.loops["qpos"][0, 3] = 0.0, 1.0
    blocks.loops["qvel"][0], blocks.loops["xfrc"][0] = start, wrench
    fly_on(blocks.loops.ctypes.data, round(SUBSTEPS / TICK), TICK / SUBSTEPS)
    model, data = load_world(vehicle, drawn=False)
    for lane in range(WIDTH):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = [0, 0, 0, 1, 0, 0, 0]
        data.qvel[:] = start[:, lane]
        data.xfrc_applied[model.body("vehicle").id] = wrench[:, lane]
        for _ in range(round(SUBSTEPS / TICK)):
            mujoco.mj_step(model, data)
        np.testing.assert_allclose(blocks.loops["qpos"][0, :, lane], data.qpos, atol=1e-9)
        np.testing.assert_allclose(blocks.loops["qvel"][0, :, lane], data.qvel, atol=1e-8)
