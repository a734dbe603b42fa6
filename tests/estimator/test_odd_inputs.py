"""Inputs that no vehicle makes, and numbers at the ends of what is stated."""

import gc
import tracemalloc

import numpy as np
import pytest

from windwrench.dynamics import load_vehicle
from windwrench.envs.vector import TaskVectorEnv
from windwrench.estimator import ConstantGainFilter, UKFTuning, WrenchUKF
from windwrench.estimator.ekf import WrenchEKF

VEHICLE = load_vehicle("ardrone2")
HOVER = np.full(4, VEHICLE.hover_rate)
POSE = [0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0]
FILTERS = {"ukf": WrenchUKF, "ekf": WrenchEKF, "constant-gain": ConstantGainFilter}


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("speed", [1e9, 1e150])
def test_one_rotor_speed_that_no_vehicle_has_changes_nothing(name, speed):
    clean, spoiled = FILTERS[name](VEHICLE), FILTERS[name](VEHICLE)
    clean.reset(*POSE)
    spoiled.reset(*POSE)
    odd = HOVER.copy()
    odd[1] = speed
    for k in range(60):
        kept = clean.step(HOVER, *POSE).force
        found = spoiled.step(odd if k == 30 else HOVER, *POSE).force
    np.testing.assert_array_equal(found, kept)


def test_masked_entries_are_not_measured():
    ukf = WrenchUKF(VEHICLE)
    ukf.reset(*POSE)
    masked = np.ma.masked_array([5.0, 0.0, 1.0], mask=[True, False, False])
    assert ukf.step(HOVER, masked, None).status == "coasting"
    speeds = np.ma.masked_array(50.0 * HOVER, mask=True)
    assert np.abs(ukf.step(speeds, *POSE).force).max() < 1e-6


@pytest.mark.parametrize("name", ["ukf", "ekf"])
@pytest.mark.parametrize("noise", [1e-6, 1e-8, 1e-10])
def test_the_covariance_stays_positive_with_a_noise_of_nanometres(name, noise):
    one = FILTERS[name](VEHICLE, UKFTuning(position_noise=noise, attitude_noise=noise))
    one.reset(*POSE)
    for k in range(400):
        estimate = one.step(HOVER, *(POSE if not 50 < k < 250 else (None, None)))
        size = np.sqrt(np.diag(estimate.covariance))
        assert size.min() > 0.0
        assert np.linalg.eigvalsh(estimate.covariance / np.outer(size, size))[0] > -1e-12


def test_steps_and_episodes_hold_on_to_nothing():
    """Bytes that a filter and environments hold after five times as many steps: the least of three
    times, since a leak grows in each.
    """
    ukf, envs = WrenchUKF(VEHICLE), TaskVectorEnv(2, scenario="base")
    ukf.reset(*POSE)

    def work():
        envs.reset(seed=0)
        for _ in range(5):
            envs.step(np.zeros((2, 1), np.float32))
        for _ in range(100):
            ukf.step(HOVER, *POSE)

    work()
    tracemalloc.start()
    try:
        held = []
        for _ in range(4):
            for _ in range(5):
                work()
            gc.collect()
            held.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert np.diff(held).min() < 20_000
