"""The wrench filter against its literal reference, and what it must hold."""

import numpy as np
import pytest

from tests.support.flights import PERIOD, matrix, yawing_flight
from tests.support.reference_smoother import as_reference
from windwrench.dynamics import EffectSetting, InputError, load_vehicle
from windwrench.dynamics.effects import compile_effects
from windwrench.estimator import UKFTuning, WrenchUKF
from windwrench.estimator.reference import ReferenceUKF

VEHICLE = load_vehicle("ardrone2")
ANISOTROPIC = UKFTuning(
    motor_torque_noise=(0.02, 0.03, 0.04),
    torque_walk=(2e-4, 3e-4, 4e-4),
    thrust_noise=(0.2, 0.3, 0.4),
    force_walk=(2e-3, 3e-3, 4e-3),
    position_noise=(0.001, 0.002, 0.003),
    attitude_noise=(0.003, 0.005, 0.008),
)


def initial_covariance(seed=1):
    rng = np.random.default_rng(seed)
    A = np.eye(18) + 0.15 * rng.standard_normal((18, 18))
    scale = np.repeat([0.003, 0.3, 0.003, 0.1, 0.02, 0.3], 3)
    return (A @ A.T) * np.outer(scale, scale)


def run_both(vehicle, steps, flight, effect_wrench=None, missing=()):
    P = initial_covariance()
    fast, slow = (
        WrenchUKF(vehicle, ANISOTROPIC, PERIOD),
        ReferenceUKF(compile_effects(vehicle).vehicle, ANISOTROPIC, PERIOD, effect_wrench),
    )
    start = flight["true_x"][0], flight["true_q"][0], P, flight["velocity"][0], flight["omega"][0]
    fast.reset(*start)
    slow.reset(*start)
    worst = 0.0
    for k in range(1, steps):
        W, x, q = (flight[n][k] for n in ("rotors", "position", "quaternion"))
        slow.predict(W)
        if k in missing:
            e = fast.step(W)
        else:
            e = fast.step(W, x, q)
            slow.correct(x, q)
            worst = max(worst, abs(e.nis - slow.nis) / (1 + slow.nis))
        worst = max(
            worst,
            np.abs(as_reference(e, slow.state) - slow.state).max(),
            np.abs(e.covariance - slow.covariance).max(),
        )
    return worst, e


def test_equals_the_literal_filter_over_a_yawing_flight():
    flight = yawing_flight(VEHICLE, 1001, seed=3)
    worst, _ = run_both(VEHICLE, 1001, flight, missing=range(300, 320))
    assert worst < 1e-9


def test_equals_the_literal_filter_with_a_centre_of_mass_offset():
    vehicle = VEHICLE.with_effects(
        EffectSetting("com_offset", {"cx": 0.01, "cy": -0.006, "cz": 0.02})
    )
    worst, _ = run_both(vehicle, 200, yawing_flight(VEHICLE, 200, seed=4))
    assert worst < 1e-9


def test_equals_the_literal_filter_with_effects_that_depend_on_the_state():
    kd, rho = 1.5e-4, 3.0
    vehicle = VEHICLE.with_effects(
        EffectSetting("rotor_drag", {"kdx": kd, "kdy": kd}),
        EffectSetting("ground_effect", {"rho": rho}),
    )

    def wrench(x, q, v, w, W):
        C, force, torque = matrix(q), np.zeros(3), np.zeros(3)
        for (sx, sy), rate, k in zip(
            [(1, 1), (-1, 1), (-1, -1), (1, -1)], W, vehicle.k, strict=True
        ):
            r = VEHICLE.arm_l * np.array([sx, sy, 0.0])
            u = C.T @ v + np.cross(w, r)
            ratio = rho * (vehicle.rotor_radius / (4 * (x + C @ r)[2])) ** 2
            f = -rate * kd * u * [1, 1, 0] + [0, 0, k * rate**2 * (1 / (1 - ratio) - 1)]
            force, torque = force + C @ f, torque + np.cross(r, f)
        return force, torque

    worst, _ = run_both(vehicle, 200, yawing_flight(VEHICLE, 200, seed=5), wrench)
    assert worst < 1e-9


def test_torque_error_in_a_yawing_flight():
    torque = np.array([0.01, -0.015, 0.02])
    flight = yawing_flight(VEHICLE, 3000, seed=6, torque=torque)
    ukf = WrenchUKF(VEHICLE, UKFTuning(), PERIOD)
    ukf.reset(
        flight["position"][0],
        flight["quaternion"][0],
        velocity=flight["velocity"][0],
        angular_velocity=flight["omega"][0],
    )
    estimates = [
        ukf.step(*(flight[n][k] for n in ("rotors", "position", "quaternion")))
        for k in range(1, 3000)
    ]
    error = np.array([e.torque - torque for e in estimates])[600:]
    assert np.sqrt(np.mean(np.sum(error**2, axis=1))) < 0.005
    force_error = np.array([e.force - [0.3, -0.2, -0.1] for e in estimates])[600:]
    assert np.sqrt(np.mean(force_error**2)) < 0.05


def test_the_sign_of_a_quaternion_means_nothing():
    flight = yawing_flight(VEHICLE, 300, seed=7)
    results = []
    for signs in (np.ones(300), np.random.default_rng(0).choice([-1.0, 1.0], 300)):
        ukf = WrenchUKF(VEHICLE, UKFTuning(), PERIOD)
        ukf.reset(flight["position"][0], signs[0] * flight["quaternion"][0])
        for k in range(1, 300):
            e = ukf.step(
                flight["rotors"][k], flight["position"][k], signs[k] * flight["quaternion"][k]
            )
        results.append((e.torque, e.force, e.covariance, e.nis))
    for a, b in zip(*results, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-12)


def test_weights_sum_to_one():
    slow = ReferenceUKF(VEHICLE, UKFTuning(), PERIOD)
    slow.reset([0, 0, 1], [1, 0, 0, 0], initial_covariance())
    for noise in (slow.Q, slow.R):
        assert slow.sigma_points(noise)[1].sum() == pytest.approx(1.0, abs=1e-14)


def hover(ukf, steps, torque, force, sigma_position, sigma_attitude, seed=0):
    """Hover measured under a wrench that the rotors balance; the wrench steps on
    at the first step."""
    rng = np.random.default_rng(seed)
    weight = ukf.vehicle.weight - force[2]
    W = ukf.vehicle.rotor_speeds(weight, -np.asarray(torque))
    hold = ukf.vehicle.rotor_speeds(ukf.vehicle.weight, np.zeros(3))
    position, estimates = np.array([0.0, 0.0, 1.0]), []
    ukf.reset(position, [1, 0, 0, 0])
    for k in range(steps):
        q = np.concatenate([[1.0], 0.5 * sigma_attitude * rng.standard_normal(3)])
        measured = position + sigma_position * rng.standard_normal(3)
        estimates.append(ukf.step(hold if k < 1000 else W, measured, q / np.linalg.norm(q)))
    return np.array([e.force for e in estimates]), np.array([e.torque for e in estimates])


@pytest.mark.parametrize(("sigma_position", "sigma_attitude"), [(0.001, 0.005), (0.01, 0.05)])
def test_static_load_is_read_within_the_paper_s_spread(sigma_position, sigma_attitude):
    ukf = WrenchUKF(
        VEHICLE, UKFTuning(position_noise=sigma_position, attitude_noise=sigma_attitude), PERIOD
    )
    force, torque = hover(ukf, 8000, (0.067, 0, 0), (0, 0, -0.52), sigma_position, sigma_attitude)
    settled = slice(4000, None)
    np.testing.assert_allclose(force[settled].mean(0), [0, 0, -0.52], atol=0.01)
    np.testing.assert_allclose(torque[settled].mean(0), [0.067, 0, 0], atol=0.002)
    assert np.all(force[settled].std(0) < 0.025)
    assert np.all(torque[settled].std(0) < 0.01)
    # mean over seeds: a single noisy curve crosses 10 and 90 % more than once
    curves = [
        hover(ukf, 3000, (0.067, 0, 0), (0, 0, -0.52), sigma_position, sigma_attitude, seed)
        for seed in range(8)
    ]
    for curve, final in (
        (np.mean([f[:, 2] for f, _ in curves], 0), -0.52),
        (np.mean([t[:, 0] for _, t in curves], 0), 0.067),
    ):
        share = curve[1000:] / final
        rise = PERIOD * (np.argmax(share > 0.9) - np.argmax(share > 0.1))
        assert 0.8 < rise < 1.2
    lateral = np.mean([f[1000:, :2] for f, _ in curves], 0)
    assert np.abs(lateral).max() < 0.1
    assert np.abs(force[1000:, :2]).max() < 0.1


def test_asynchronous_measurements_agree_with_regular_ones():
    """Predicting in two halves and measuring position and attitude one after the other changes next
    to nothing.
    """
    flight = yawing_flight(VEHICLE, 400, seed=8)
    whole, halves = WrenchUKF(VEHICLE, UKFTuning(), PERIOD), WrenchUKF(VEHICLE, UKFTuning(), PERIOD)
    for ukf in (whole, halves):
        ukf.reset(flight["position"][0], flight["quaternion"][0])
    for k in range(1, 400):
        W, x, q = (flight[n][k] for n in ("rotors", "position", "quaternion"))
        a = whole.step(W, x, q)
        halves.predict(W, PERIOD / 2)
        halves.predict(W, PERIOD / 2)
        halves.correct(x, None)
        b = halves.correct(None, q)
    np.testing.assert_allclose(a.force, b.force, atol=0.02)
    np.testing.assert_allclose(a.torque, b.torque, atol=0.002)
    # half-steps integrate the rate a little better
    np.testing.assert_allclose(np.diag(a.covariance), np.diag(b.covariance), rtol=0.08)


def test_a_missing_measurement_is_a_prediction():
    ukf = WrenchUKF(VEHICLE, UKFTuning(), PERIOD)
    ukf.reset([0, 0, 1], [1, 0, 0, 0])
    W = np.full(4, VEHICLE.hover_rate)
    none, nan = [], []
    for results, x, q in ((none, None, None), (nan, np.full(3, np.nan), np.full(4, np.nan))):
        ukf.reset([0, 0, 1], [1, 0, 0, 0])
        for _ in range(20):
            e = ukf.step(W, x, q)
        results.extend([e.position, e.covariance, e.nis])
    assert np.isnan(none[2])
    assert np.isnan(nan[2])
    np.testing.assert_array_equal(none[1], nan[1])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: UKFTuning(torque_walk=-1.0), "torque_walk"),
        (lambda: UKFTuning(position_noise=(1, 2)), "position_noise"),
        (lambda: UKFTuning(force_walk="a"), "force_walk"),
        (lambda: WrenchUKF(VEHICLE, period=0.0), "period"),
        (lambda: WrenchUKF(VEHICLE, gate=2.0), "gate"),
        (lambda: WrenchUKF(VEHICLE).reset([0, 0], [1, 0, 0, 0]), "position"),
        (lambda: WrenchUKF(VEHICLE).reset([0, 0, 0], [3, 0, 0, 0]), "length 1"),
        (
            lambda: WrenchUKF(VEHICLE).reset([0, 0, 0], [1, 0, 0, 0], -np.eye(18)),
            "positive definite",
        ),
    ],
)
def test_bad_settings_are_named(make, words):
    with pytest.raises(InputError, match=words):
        make()
