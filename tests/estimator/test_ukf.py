"""The filters and the smoother against the literal ones, and what they must hold.

``tests/reproduction/test_figures.py`` hangs a mass on: rise time and lateral force.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from tests.support.flights import PERIOD, begin, fly, yawing_flight
from tests.support.model_flights import ANISOTROPIC, GUSTS
from tests.support.reference_filters import (
    KIT_ORDER,
    ReferenceSmoother,
    as_reference,
    initial_covariance,
    rotor_effects,
)
from tests.support.vehicles import VEHICLE
from windwrench import _core
from windwrench.dynamics import EffectSetting
from windwrench.dynamics.effects import compile_effects
from windwrench.estimator import UKFTuning, WrenchUKF
from windwrench.estimator.reference import difference, displaced
from windwrench.estimator.smoother import RecordingUKF

OFFSET = EffectSetting("com_offset", {"cx": 0.01, "cy": -0.006, "cz": 0.02})
DRAG = EffectSetting("rotor_drag", {"kdx": 1.5e-4, "kdy": 1.5e-4})
GROUND = EffectSetting("ground_effect", {"rho": 3.0})


@pytest.mark.parametrize(
    ("effects", "steps", "wrench", "yaw_rate", "tuning"),
    [
        ((), 200, {}, 3.0, ANISOTROPIC),
        ((), 60, {}, 60.0, ANISOTROPIC),
        ((DRAG, GROUND), 60, {"drag": 1.5e-4, "ground": 3.0}, 3.0, ANISOTROPIC),
        ((DRAG, OFFSET), 50, {"drag": 1.5e-4}, 3.0, GUSTS),
    ],
    ids=["plain", "sixty radians a second", "drag and ground", "drag, offset and gusts"],
)
def test_filter_and_smoother_equal_the_literal_ones(effects, steps, wrench, yaw_rate, tuning):
    vehicle = VEHICLE.with_effects(*effects)
    flight = yawing_flight(VEHICLE, steps, seed=3, yaw_rate=yaw_rate)
    fast = RecordingUKF(vehicle, tuning, PERIOD)
    acting = rotor_effects(vehicle, **wrench) if wrench else None
    slow = ReferenceSmoother(compile_effects(vehicle).vehicle, tuning, PERIOD, acting)
    begin(slow, flight, initial_covariance())
    missing = range(25, 40)
    for k, e in enumerate(fly(fast, flight, missing, initial_covariance()), 1):
        slow.predict(flight["rotors"][k])
        if k not in missing:
            slow.correct(flight["position"][k], flight["quaternion"][k])
            assert abs(e.nis - slow.nis) < 1e-9 * (1 + slow.nis)
        assert abs(as_reference(e, slow.state) - slow.state).max() < 1e-9
        assert abs(e.covariance - slow.covariance).max() < 1e-9
    found = fast.smooth(covariance=True)
    for k, (state, P) in enumerate(slow.smoothed()):
        e = found.at(k)
        size = np.sqrt(np.diag(P))
        assert_allclose(as_reference(e, state), state, rtol=0, atol=1e-8)
        assert abs((e.covariance - P) / np.outer(size, size)).max() < 1e-7


def test_gusts_rest_at_their_size_and_a_long_memory_is_a_walk():
    """Unseen, a force has mean zero and a standard deviation of walk sqrt(time / (2 period))."""
    walk, time = 3e-3, 0.2
    gusts = WrenchUKF(
        VEHICLE, UKFTuning(force_walk=walk, force_time=time, torque_time=time), PERIOD
    )
    flight = yawing_flight(VEHICLE, 300, seed=8)
    fly(gusts, flight)
    seen = gusts.estimate.force
    for _ in range(10):  # 0.05 s, in steps of another length
        gusts.predict(flight["rotors"][-1], 0.5 * PERIOD)
        gusts.predict(flight["rotors"][-1], 0.5 * PERIOD)
    assert_allclose(gusts.estimate.force, seen * np.exp(-10 * PERIOD / time), rtol=1e-9)
    for _ in range(400):
        e = gusts.predict(flight["rotors"][-1])
    assert_allclose(e.std[15:], walk * np.sqrt(time / (2.0 * PERIOD)), rtol=1e-3)
    assert abs(e.force).max() < 1e-4
    long = UKFTuning(force_time=1e9, torque_time=1e9)
    estimates = [fly(WrenchUKF(VEHICLE, t, PERIOD), flight)[-1] for t in (UKFTuning(), long)]
    assert_allclose(estimates[1].state[:19], estimates[0].state[:19], rtol=1e-6, atol=1e-9)
    assert_allclose(estimates[1].covariance, estimates[0].covariance, rtol=1e-6, atol=1e-12)


def test_asynchronous_measurements_agree_with_regular_ones():
    """Two predictions by half, position and attitude one after the other: next to no difference."""
    flight = yawing_flight(VEHICLE, 300, seed=8)
    whole, halves = (WrenchUKF(VEHICLE, UKFTuning(), PERIOD) for _ in range(2))
    a = fly(whole, flight)[-1]
    begin(halves, flight)
    for k in range(1, 300):
        for _ in range(2):
            halves.predict(flight["rotors"][k], PERIOD / 2)
        halves.correct(flight["position"][k], None)
        b = halves.correct(None, flight["quaternion"][k])
    assert_allclose(a.force, b.force, atol=0.02)
    assert_allclose(a.torque, b.torque, atol=0.002)
    # half-steps integrate the rate a little better
    assert_allclose(np.diag(a.covariance), np.diag(b.covariance), rtol=0.08)


@pytest.mark.parametrize(
    "vehicle",
    [
        VEHICLE,
        VEHICLE.with_effects(OFFSET),
        VEHICLE.with_effects(OFFSET, DRAG, GROUND),
        replace(
            VEHICLE,
            inertia=np.array([[2.2e-3, 3e-4, -2e-4], [3e-4, 3e-3, 1e-4], [-2e-4, 1e-4, 4.8e-3]]),
        ),
    ],
    ids=["plain", "offset", "effects", "full inertia"],
)
@pytest.mark.parametrize("rate", [0.0, 4.0])
def test_jacobian_equals_finite_differences(vehicle, rate):
    rng = default_rng(0)
    record = WrenchUKF(vehicle).record
    x = np.zeros(20)
    x[0:3] = [0.1, -0.2, 0.5]
    x[3:7] = Rotation.random(rng=rng).as_quat(scalar_first=True)
    x[7:10], x[10:13] = rng.standard_normal(3), rate * rng.standard_normal(3)
    x[13:16], x[16:19] = 0.05 * rng.standard_normal(3), rng.standard_normal(3)
    speeds = np.array([350.0, 380.0, 360.0, 400.0])
    start = x[KIT_ORDER]

    def stepped(error):
        after, A = np.zeros(20), np.zeros((12, 18))
        x[KIT_ORDER] = displaced(start, error)
        _core.drive(record.ctypes.data, speeds, PERIOD, 11.1)
        _core.move(record.ctypes.data, x, PERIOD, after, A)
        return after[KIT_ORDER], A

    centre, A = stepped(np.zeros(18))
    F = np.eye(18)
    F[:12] += A
    moved = [
        difference(stepped(e)[0], centre) - difference(stepped(-e)[0], centre)
        for e in 1e-5 * np.eye(18)
    ]
    assert np.abs(A).max() > 1
    assert np.allclose(F, np.transpose(moved) / 2e-5, rtol=0, atol=1e-8)
