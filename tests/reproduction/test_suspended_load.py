"""A load that hangs on the plant by a thread."""

from dataclasses import replace

import numpy as np
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from windwrench.dynamics import load_vehicle
from windwrench.envs.plant import NOISE, PlantSettings
from windwrench.reproduction.suspended_load import LoadedLoop, SuspendedLoad

VEHICLE = replace(load_vehicle("ardrone2"), omega_lsb=0.0)
STILL = PlantSettings(disturbance_force=0.0, disturbance_torque=0.0, sensor_noise=False)
LOAD = SuspendedLoad(anchor=(0.1, -0.05, -0.02), length=0.2)


def _hung(load, seconds):
    loop = LoadedLoop(VEHICLE, settings=STILL, load=load)
    loop.reset(default_rng(0), np.array([0.0, 0.0, 1.5]))
    loop.hang_load()
    loop.run(np.zeros((round(seconds * 200), NOISE)))
    return loop


def test_a_load_at_rest_pulls_with_its_weight():
    loop = _hung(LOAD, 40.0)
    weight = LOAD.mass * 9.81
    expected = [0, 0, -weight, 0.05 * weight, 0.1 * weight, 0]
    assert_allclose(loop.load_pull(), expected, atol=0.01 * weight)
    assert 0.0 < loop.data.tendon("thread").length[0] - LOAD.length < 1e-3


def test_the_load_does_not_touch_the_vehicle_before_it_is_hung_on():
    flown = []
    for load in (None, LOAD):
        loop = LoadedLoop(VEHICLE, load=load)
        rng = default_rng(3)
        loop.reset(rng, np.array([0.0, 0.0, 1.5]))
        loop.run(rng.standard_normal((400, NOISE)))
        flown.append(np.concatenate([loop.state[:19], loop.position, loop.quaternion]))
    assert_array_equal(flown[0], flown[1])


def test_reset_takes_the_load_off():
    loop = _hung(LOAD, 1.0)
    loop.reset(default_rng(0), np.array([0.0, 0.0, 1.5]))
    loop.run(np.zeros((200, NOISE)))
    assert_array_equal(loop.load_pull(), 0.0)
