"""The steady filter of a pose, the noise that makes its innovations likeliest, and what a
coefficient changes in the innovations of all axes.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.linalg import inv, solve
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy.linalg import solve_discrete_are
from scipy.spatial.transform import Rotation

from tests.support.flown import VEHICLE, recorded
from windwrench._core import sensitivities
from windwrench.identification.diagnosis.likelihood import OWN, Likelihood, gyration
from windwrench.identification.diagnosis.noise_search import NoiseSearch, _free
from windwrench.identification.diagnosis.regression import RegressedFlights
from windwrench.identification.diagnosis.steady_filter import (
    PAIRS,
    PULL,
    PoseNoise,
    steady_filter,
)

PARTNER = np.array([4, 3, 5, 1, 0, 2])  # the axis that an axis is filtered with
PERIOD = 0.01
GRAVITY = 9.81
TRUE = PoseNoise(
    np.repeat([2e-4, 1e-3], 3),
    np.repeat([0.4, 3.0], 3),
    np.repeat([0.3, 0.15], 3),
    np.repeat([0.1, 1.0], 3),
)
GAIN = 0.7  # on the jumps of the disturbance of up
PULLS = np.append(GRAVITY * PULL, np.zeros(3))
STEP = np.array([0.5 * PERIOD**2, PERIOD])  # of pose and rate, by an acceleration


def moved(state, push):
    """Return the states (6, 3) of the axes a period on."""
    turn = state[PARTNER]
    a = state[:, 2] + push + PULLS * (turn[:, 0] + 0.5 * PERIOD * turn[:, 1])
    keep = np.exp(-PERIOD / TRUE.time)
    pose = state[:, 0] + PERIOD * state[:, 1] + STEP[0] * a
    return np.column_stack([pose, state[:, 1] + STEP[1] * a, keep * state[:, 2]])


@pytest.fixture(scope="module")
def search():
    """Return a search on 30 s of a pose that moves by what TRUE says."""
    rng = default_rng(1)
    n = 3000
    jumps = np.zeros((n, 6, 1))
    jumps[:, 2, 0] = 0.3 * rng.standard_normal(n)
    spread = TRUE.disturbance * np.sqrt(-np.expm1(-2.0 * PERIOD / TRUE.time))
    state = np.zeros((6, 3))
    pose = np.empty((n, 6))
    for k in range(n):
        state[:, 2] += GAIN * jumps[k, :, 0]
        pose[k] = state[:, 0] + TRUE.pose * rng.standard_normal(6)
        state = moved(state, TRUE.white * rng.standard_normal(6))
        state[:, 2] += spread * rng.standard_normal(6)

    pull = np.zeros((n, 3, 2))
    pull[:, 1, 0], pull[:, 0, 1] = PULLS[1], PULLS[0]
    still = (np.tile([1.0, 0.0], (n, 1)), np.zeros((n, 3)))
    none = np.empty((n, 6, 0))

    def see(steady, gains, slopes):
        own = (OWN @ gains)[:, 0]
        x = np.zeros((6, 3))
        innovations = np.empty((n, 6))
        disturbance = np.empty((n, 6))
        for k in range(n):
            x[:, 2] += own * jumps[k, :, 0]
            e = innovations[k] = pose[k] - x[:, 0]
            x += steady.gain[:, :, 0] * e[:, None] + steady.gain[:, :, 1] * e[PARTNER, None]
            disturbance[k] = x[:, 2]
            x = moved(x, 0.0)
            x[:, 2] = steady.keep * disturbance[k]
        slopes = np.empty((6, 7, 0)) if slopes is None else slopes
        each = np.ascontiguousarray(jumps * OWN)
        out = np.empty((n, 6, 3 + slopes.shape[2]))
        sensitivities(
            PERIOD,
            steady.gain,
            steady.keep,
            still[0],
            pull,
            still[1],
            np.zeros((n, 3, 3)),
            none,
            none,
            each,
            np.array([2, 2, 2]),
            slopes,
            innovations,
            disturbance,
            np.zeros((6, 3, out.shape[2])),
            out,
        )
        return [(innovations[100:], out[100:])]

    return NoiseSearch(see, np.array([1e2]), PERIOD, GRAVITY)


def test_the_gains_are_those_of_the_riccati_equation():
    found = steady_filter(TRUE, PERIOD, GRAVITY)
    for pair, pull in zip(PAIRS, GRAVITY * PULL, strict=True):
        F = np.zeros((6, 6))
        Q = np.zeros((6, 6))
        H = np.zeros((2, 6))
        for i, axis in enumerate(pair):
            at = slice(3 * i, 3 * i + 3)
            push = np.append(STEP, 0.0)
            F[at, at] = [[1.0, PERIOD, STEP[0]], [0.0, 1.0, PERIOD], [0.0, 0.0, found.keep[axis]]]
            Q[at, at] = TRUE.white[axis] ** 2 * np.outer(push, push)
            Q[at, at][2, 2] = TRUE.disturbance[axis] ** 2 * (1.0 - found.keep[axis] ** 2)
            H[i, 3 * i] = 1.0
        F[:3, 3:] = pull * np.outer(push, [1.0, 0.5 * PERIOD, 0.0])
        R = np.diag(TRUE.pose[pair] ** 2)
        P = solve_discrete_are(F.T, H.T, Q, R)
        S = H @ P @ H.T + R
        K = P @ H.T @ inv(S)
        assert_allclose(found.covariance[np.ix_(pair, pair)], S, rtol=1e-6, atol=1e-15)
        for i, axis in enumerate(pair):
            own = np.column_stack([K[3 * i : 3 * i + 3, i], K[3 * i : 3 * i + 3, 1 - i]])
            assert_allclose(found.gain[axis], own, rtol=1e-5, atol=1e-6)


def test_the_likeliest_noise_is_the_true_one(search):
    near = PoseNoise(2.0 * TRUE.pose, 0.5 * TRUE.disturbance, np.full(6, 0.4), 0.3 * TRUE.white)
    found, gains = search.likeliest(near, np.zeros((3, 1)))
    assert_allclose(found.pose, TRUE.pose, rtol=0.06)
    assert_allclose(found.disturbance, TRUE.disturbance, rtol=0.35)
    there, here = (steady_filter(x, PERIOD, GRAVITY).covariance for x in (TRUE, found))
    assert_allclose(np.diagonal(here), np.diagonal(there), rtol=0.06)
    assert_allclose(gains.ravel(), [0.0, 0.0, GAIN], atol=0.1)


def assert_gradient(search, at, numbers):
    """Assert that a search's gradient by some of its numbers is that of the height."""
    height, _, right = search._slopes(at)
    assert_allclose(height, search._height(at))
    for i in numbers:
        step = 1e-4 * np.eye(len(at))[i]
        rise = (search._height(at + step) - search._height(at - step)) / 2e-4
        assert rise == pytest.approx(-right[i], rel=0.01, abs=0.5)


def test_the_search_follows_the_likelihood(search):
    x = np.column_stack([np.log([TRUE.pose, TRUE.disturbance, TRUE.time]).T, np.full(6, 0.1)])
    assert_gradient(search, np.append([0.0, 0.0, 0.3], x), range(27))


def test_the_search_follows_the_likelihood_where_a_vehicle_spins(monkeypatch):
    log = recorded("hover", seconds=12.0)
    spin = Rotation.from_rotvec(np.outer(log.t, [0.0, 0.0, 6.0]))
    q = spin * Rotation.from_quat(log.quaternion, scalar_first=True)
    searches = []
    monkeypatch.setattr(NoiseSearch, "likeliest", lambda *x: searches.append(x) or x[1:])
    Likelihood(
        RegressedFlights([replace(log, quaternion=q.as_quat(scalar_first=True))], VEHICLE), {}
    )
    search, near, gains = searches[0]
    at = np.append(gains, _free(near) + np.array([0.0, 0.0, 0.0, 0.1]))
    assert_gradient(search, at, range(-24, 0))


def test_gyroscopic_torques_grow_with_the_rate():
    J = np.array([[2.0, 0.1, 0.0], [0.1, 3.0, 0.2], [0.0, 0.2, 5.0]])
    rate = np.array([0.3, -0.7, 1.9])
    found = gyration(replace(VEHICLE, inertia=J), rate[None])[0]
    for i, step in enumerate(1e-4 * np.eye(3)):
        there, here = (solve(J, np.cross(w, J @ w)) for w in (rate + step, rate - step))
        assert_allclose(found[:, i], (here - there) / 2e-4, atol=1e-9)


def test_columns_say_what_a_coefficient_changes_in_the_innovations():
    """An attitude's innovation also moves the position's filter: without that 11 % are missing."""
    torque = {"tx": 0.003, "ty": -0.002, "tz": 0.0}
    flights = RegressedFlights([recorded(seconds=12.0)], VEHICLE)
    declared = Likelihood(flights, {})
    amended = Likelihood(flights, {"constant_torque": torque}, declared, same_noise=True)
    bases = [x.base(["constant_torque"], {}) for x in (declared, amended)]
    z = np.zeros(len(bases[0].total))
    z[-1] = 1.0
    for name, value in torque.items():
        at = bases[0].columns["constant_torque", name]
        z[at] = -value / bases[0].size[at]
    linear, exact = (z @ base.total @ z - bases[0].total[-1, -1] for base in bases)
    assert linear == pytest.approx(exact, rel=0.03)
