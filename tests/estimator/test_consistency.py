"""The consistency toolkit, and the filters under it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from windwrench.dynamics import EffectSetting, InputError, load_vehicle
from windwrench.estimator import UKFTuning, WrenchEstimate, WrenchUKF
from windwrench.estimator.consistency import (
    check_consistency,
    chi2_band,
    nees,
    plot,
    simulate_model,
    state_error,
)
from windwrench.estimator.ekf import WrenchEKF

VEHICLE = load_vehicle("ardrone2")
YAWED = {"quaternion": (0.5, 0.0, 0.0, 0.75**0.5), "angular_velocity": (0.0, 0.0, 3.0)}


def run_filter(make, vehicle, tuning, runs, steps, claimed=None):
    """Return NEES and NIS (runs, steps) of a filter that claims ``claimed`` on truth drawn from
    ``tuning``.
    """
    estimator = make(vehicle, tuning if claimed is None else claimed)
    speeds = np.full((steps, 4), vehicle.hover_rate)
    out = np.empty((2, runs, steps))
    for r in range(runs):
        run = simulate_model(vehicle, tuning, speeds, seed=r, **YAWED)
        estimator.reset(
            run.initial_position,
            run.initial_quaternion,
            run.initial_covariance,
            run.initial_velocity,
            run.initial_angular_velocity,
        )
        for k in range(steps):
            e = estimator.step(
                run.rotor_speeds[k], run.measured_position[k], run.measured_quaternion[k]
            )
            out[0, r, k], out[1, r, k] = nees(e, *run.truth(k)), e.nis
    return out


def test_the_unscented_filter_is_consistent():
    """Truth drawn from the filter's own model, 100 runs of 5 s, yawed by 120 degrees and turning at
    3 rad/s.
    """
    report = check_consistency(*run_filter(WrenchUKF, VEHICLE, UKFTuning(), 100, 1000))
    assert report.nis_band[0] <= report.mean_nis <= report.nis_band[1]
    # the far narrower band of all 100000 innovations holds too
    assert report.mean_nis_band[0] <= report.mean_nis <= report.mean_nis_band[1]
    assert report.nees_fraction >= 0.9
    assert report.nis_fraction >= 0.9
    assert report.consistent


@pytest.mark.parametrize("make", [WrenchUKF, WrenchEKF])
def test_consistent_with_effects_and_anisotropic_noise(make):
    vehicle = VEHICLE.with_effects(
        EffectSetting("com_offset", {"cx": 0.01, "cz": -0.02}),
        EffectSetting("rotor_drag", {"kdx": 1e-4, "kdy": 1e-4}),
    )
    tuning = UKFTuning(
        motor_torque_noise=(0.02, 0.03, 0.04),
        thrust_noise=(0.2, 0.3, 0.4),
        position_noise=(0.001, 0.002, 0.003),
        attitude_noise=(0.003, 0.005, 0.008),
    )
    assert check_consistency(*run_filter(make, vehicle, tuning, 40, 300)).consistent


def test_a_filter_that_claims_too_much_is_caught():
    report = check_consistency(
        *run_filter(WrenchUKF, VEHICLE, UKFTuning(), 20, 200, UKFTuning(attitude_noise=0.003))
    )
    assert not report.consistent
    assert report.mean_nis > report.nis_band[1]


def test_nees_of_a_known_error():
    state = np.zeros(20)
    true = Rotation.from_rotvec([0.3, -0.2, 2.0])
    turn = Rotation.from_rotvec([0.02, 0.0, 0.0])  # in the world frame
    state[3:7] = (turn.inv() * true).as_quat(scalar_first=True)
    covariance = np.eye(18)
    covariance[0, 0] = 0.005**2
    estimate = WrenchEstimate(np.concatenate([state, covariance.ravel()]))
    zero = np.zeros(3)
    truth = zero, -true.as_quat(scalar_first=True), [1.0, 0, 0], zero, zero, [0, 0, 2.0]
    assert np.allclose(state_error(estimate, *truth)[:3], [0.005, 0, 0], rtol=1e-4, atol=1e-12)
    assert nees(estimate, *truth) == pytest.approx(1.0 + 1.0 + 4.0, rel=1e-4)


def test_band_holds_the_mean_as_often_as_it_says():
    low, high = chi2_band(6, 100)
    assert (low, high) == pytest.approx((5.341, 6.697), abs=2e-3)
    means = np.random.default_rng(0).chisquare(6, (4000, 100)).mean(axis=1)
    assert np.mean((means > low) & (means < high)) == pytest.approx(0.95, abs=0.015)
    for bad in ((0, 1), (6, 0), (6, 1, 1.0)):
        with pytest.raises(InputError, match="chi2_band"):
            chi2_band(*bad)


def test_report_and_picture(tmp_path):
    rng = np.random.default_rng(0)
    report = check_consistency(rng.chisquare(18, (50, 200)), rng.chisquare(6, (50, 200)))
    assert report.consistent
    assert "50 runs x 200 steps" in str(report)
    figure = plot(report, 0.005, tmp_path / "consistency.png")
    assert len(figure.axes) == 2
    assert (tmp_path / "consistency.png").stat().st_size > 10_000
    with pytest.raises(InputError, match="one shape"):
        check_consistency(np.ones((2, 3)), np.ones((3, 2)))
    with pytest.raises(InputError, match="finite"):
        check_consistency(np.ones((2, 3)), np.full((2, 3), np.nan))


def test_model_runs_repeat_and_have_the_stated_noise():
    tuning, speeds = UKFTuning(), np.full((3000, 4), VEHICLE.hover_rate)
    run, again = (simulate_model(VEHICLE, tuning, speeds, seed=7, **YAWED) for _ in range(2))
    assert np.array_equal(run.position, again.position)
    assert not np.array_equal(
        run.position, simulate_model(VEHICLE, tuning, speeds, seed=8, **YAWED).position
    )
    error = run.measured_position - run.position
    assert np.allclose(error.std(axis=0), 0.001, rtol=0.06)
    turn = (
        Rotation.from_quat(run.measured_quaternion, scalar_first=True)
        * Rotation.from_quat(run.quaternion, scalar_first=True).inv()
    ).as_rotvec()
    assert np.allclose(turn.std(axis=0), 0.005, rtol=0.06)
    assert np.allclose(np.diff(run.force, axis=0).std(axis=0), 3.26e-3, rtol=0.06)
    assert np.allclose(np.diff(run.torque, axis=0).std(axis=0), 3.26e-4, rtol=0.06)
    # x' = x + T v + T^2/2 a and v' = v + T a share one acceleration
    assert np.allclose(
        np.diff(run.position, axis=0), 0.0025 * (run.velocity[1:] + run.velocity[:-1]), atol=1e-12
    )
    # thrust noise, read from the accelerations in the body frame of the step's start
    rotation = Rotation.from_quat(run.quaternion[:-1], scalar_first=True)
    force = (
        VEHICLE.mass * (np.diff(run.velocity, axis=0) / 0.005 + [0, 0, VEHICLE.gravity])
        - run.force[:-1]
    )
    noise = rotation.inv().apply(force) - np.outer(
        VEHICLE.rotor_wrench(run.rotor_speeds[1:])[:, 0], [0, 0, 1]
    )
    assert np.allclose(noise.std(axis=0), 0.3, rtol=0.06)
    for bad in (np.ones(4), np.ones((0, 4)), np.full((3, 4), np.nan)):
        with pytest.raises(InputError, match="rotor_speeds"):
            simulate_model(VEHICLE, tuning, bad)
