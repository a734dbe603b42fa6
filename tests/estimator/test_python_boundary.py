"""What Python hands to compiled code, and what it keeps of it."""

import copy

import numpy as np
import pytest

from windwrench.dynamics import load_vehicle
from windwrench.estimator import WrenchUKF

VEHICLE = load_vehicle("ardrone2")
QUATERNION = np.array([0.5, 0.1, -0.2, 0.8]) / np.linalg.norm([0.5, 0.1, -0.2, 0.8])
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
