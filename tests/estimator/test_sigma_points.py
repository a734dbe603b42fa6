"""Sigma points side by side against one at a time, and what Python hands to compiled code."""

import copy

import numpy as np
import pytest

from windwrench.dynamics import EffectSetting, load_vehicle
from windwrench.estimator import WrenchUKF
from windwrench.estimator.error_state import displace, error_from
from windwrench.estimator.filter_record import drive, propagate
from windwrench.estimator.sigma_points import errors_of_points, propagate_points, spread_points
from windwrench.runtime.compiled import compiled

VEHICLE = load_vehicle("ardrone2")
OFFSET = VEHICLE.with_effects(EffectSetting("com_offset", {"cx": 0.01, "cy": -0.006, "cz": 0.02}))
QUATERNION = np.array([0.5, 0.1, -0.2, 0.8]) / np.linalg.norm([0.5, 0.1, -0.2, 0.8])


@compiled
def both_ways(record, rotor_speeds, spread, dt, out):
    f = record[0]
    drive(f, rotor_speeds, dt, 0.0)
    propagate(f, f.x, dt, f.centre)
    for k in range(12):
        displace(f.x, f.S[k % 6], spread if k < 6 else -spread, f.rho, f.q, f.point)
        propagate(f, f.point, dt, f.next)
        error_from(f.next, f.centre, out[k])
    spread_points(f, spread)
    propagate_points(f, dt)
    errors_of_points(f)


@pytest.mark.parametrize("vehicle", [VEHICLE, OFFSET], ids=["centred", "offset"])
@pytest.mark.parametrize(
    "rate", [0.0, 3.0, 60.0]
)  # at 60 rad/s the series for a turn no longer serves
def test_points_side_by_side_are_those_one_at_a_time_bit_for_bit(vehicle, rate):
    rng = np.random.default_rng(0)
    ukf = WrenchUKF(vehicle)
    ukf.reset(
        [0.3, -0.2, 1.0],
        QUATERNION,
        velocity=[1.0, -0.5, 0.2],
        angular_velocity=[0.3 * rate, -0.1, rate],
    )
    f = ukf.record[0]
    f["x"][13:19] = 0.1 * rng.standard_normal(6)
    f["S"] = 0.05 * rng.standard_normal((12, 18))
    expected = np.zeros((12, 18))
    both_ways(ukf.record, np.array([380.0, 390.0, 400.0, 410.0]), 5.0, 0.005, expected)
    np.testing.assert_array_equal(f["errors"].T, expected)
    assert np.abs(expected[:, :12]).min() > 0.0


ARGUMENTS = np.array([380.0, 390.0, 400.0, 410.0]), np.array([0.01, 0.0, 1.0]), QUATERNION


@pytest.mark.parametrize(
    "form",
    [
        list,
        lambda a: np.repeat(a, 2)[::2],
        lambda a: a.astype(">f8"),
        lambda a: a.astype(np.longdouble),
        lambda a: [np.array(v) for v in a],
    ],
    ids=["list", "strided", "big-endian", "long", "list of arrays"],
)
def test_any_form_of_the_same_numbers_gives_the_same_estimate(form):
    states = []
    for change in (np.asarray, form):
        estimator = WrenchUKF(VEHICLE)
        estimator.reset([0, 0, 1], QUATERNION)
        for _ in range(5):
            estimate = estimator.step(*(change(a) for a in ARGUMENTS))
        states.append(estimate.state)
    np.testing.assert_array_equal(*states)


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy])
def test_a_copy_and_an_estimate_go_their_own_way(duplicate):
    one = WrenchUKF(VEHICLE)
    one.reset([0, 0, 1], QUATERNION)
    first, other = one.step(*ARGUMENTS), duplicate(one)
    state, covariance = first.state.copy(), first.covariance.copy()
    second = one.step(*ARGUMENTS)
    assert not np.array_equal(second.state, state)
    np.testing.assert_array_equal(second.state, one.estimate.state)
    one.step(*ARGUMENTS)
    np.testing.assert_array_equal(first.state, state)
    np.testing.assert_array_equal(first.covariance, covariance)
    np.testing.assert_array_equal(other.step(*ARGUMENTS).state, second.state)
