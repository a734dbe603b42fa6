"""The steady filter of a pose, the noise that makes its innovations likeliest, and what a
coefficient changes in the innovations of all axes.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.linalg import inv, solve
from numpy.testing import assert_allclose
from scipy.linalg import solve_discrete_are
from scipy.spatial.transform import Rotation

from tests.support.flown import VEHICLE, recorded
from windwrench.envs.plant import PlantSettings
from windwrench.identification.diagnosis.column import Column
from windwrench.identification.diagnosis.likelihood import Likelihood, _twist
from windwrench.identification.diagnosis.noise_search import NoiseSearch, _free
from windwrench.identification.diagnosis.regression import RegressedFlights
from windwrench.identification.diagnosis.steady_filter import (
    PAIRS,
    PULL,
    PoseNoise,
    steady_filter,
)

PERIOD = 0.01
GRAVITY = 9.81
TRUE = PoseNoise(
    np.repeat([2e-4, 1e-3], 3),
    np.repeat([0.4, 3.0], 3),
    np.repeat([0.3, 0.15], 3),
    np.repeat([0.1, 1.0], 3),
)
STEP = np.array([0.5 * PERIOD**2, PERIOD])  # of pose and rate, by an acceleration


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


def test_the_likeliest_noise_and_gusts_are_those_that_were_flown():
    """The flight loop answers gusts before the pose shows them: the rotors' gains tell how much."""
    background = PlantSettings()
    found = Likelihood(
        RegressedFlights([recorded(seconds=25.0, background=background)], VEHICLE), {}
    )
    stated = VEHICLE.mocap.sigma_pos_m, VEHICLE.mocap.sigma_att_rad
    assert_allclose(found.noise.pose, np.repeat(stated, 3), rtol=0.06)
    flown = background.disturbance_force, background.disturbance_torque
    assert_allclose([gust.rms for gust in found.gusts()], np.repeat(flown, 3), rtol=0.35)


def assert_gradient(search, at, numbers):
    """Assert that a search's gradient by some of its numbers is that of the height."""
    _, right = search._slopes(at, search._height(at)[1])
    for i in numbers:
        step = 1e-4 * np.eye(len(at))[i]
        rise = (search._height(at + step)[0] - search._height(at - step)[0]) / 2e-4
        assert rise == pytest.approx(-right[i], rel=0.01, abs=0.5)


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
    assert_gradient(search, at, range(-27, 0))


def test_gyroscopic_torques_grow_with_the_rate():
    J = np.array([[2.0, 0.1, 0.0], [0.1, 3.0, 0.2], [0.0, 0.2, 5.0]])
    rate = np.array([0.3, -0.7, 1.9])
    found = np.tensordot(rate, _twist(replace(VEHICLE, inertia=J)), 1)
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
        at = bases[0].columns[Column("constant_torque", name)]
        z[at] = -value / bases[0].size[at]
    linear, exact = (z @ base.total @ z - bases[0].total[-1, -1] for base in bases)
    assert linear == pytest.approx(exact, rel=0.03)
