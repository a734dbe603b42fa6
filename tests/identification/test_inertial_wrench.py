"""The wrench from an IMU: against the truth, and its smoother against dense least squares."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.flown import without_pose
from tests.support.imu_flights import imu_flight, pose_removed
from windwrench.dynamics import load_vehicle
from windwrench.dynamics.vehicle import EffectSetting
from windwrench.identification.inertial_wrench import _two_sided
from windwrench.identification.wrench_series import estimate_log, truth_rmse, tune_to_log
from windwrench.runtime.errors import InputError

VEHICLE = load_vehicle("ardrone2")
PUSH = EffectSetting("constant_force", {"fx": 0.0, "fy": 0.0, "fz": -0.4})


@pytest.fixture(scope="module")
def flown():
    """A flight of 15 s under a steady force."""
    return imu_flight(VEHICLE, (PUSH,), seconds=15.0)


def test_an_imu_alone_shows_a_vertical_force(flown):
    """Within its own deviations, which say that horizontal ones are worse known."""
    series = estimate_log(pose_removed(flown), VEHICLE)
    inner = slice(400, -400)
    assert abs(float(series.force[inner, 2].mean()) + 0.4) < 0.1
    z = np.abs(series.force - flown.force)[inner] / series.std[inner, 15:]
    assert (z.mean(axis=0) < 2.0).all()
    assert np.isnan(series.nis).all()
    assert any("no pose" in note for note in series.notes)


def test_an_imu_beside_the_pose_is_smoothed(flown):
    """Nearer to the truth than the filter with the same sensors."""
    smoothed = truth_rmse(estimate_log(flown, VEHICLE, smooth=True), flown)
    filtered = truth_rmse(estimate_log(flown, VEHICLE), flown)
    assert (smoothed[0] < filtered[0]).all()
    assert (smoothed[1] < filtered[1]).all()


def test_gyro_and_accelerometer_of_a_log_sharpen_its_estimate(flown):
    """Sensors at 200 Hz beside a pose at 50 Hz, in a log whose other rows have no pose."""
    log = without_pose(flown, np.arange(len(flown.t)) % 4 > 0)
    force = log.accelerometer - [0.05, -0.1, 0.08]  # less its bias
    force[7::10] = np.nan  # not read
    log = replace(log, accelerometer=force)

    def errors(**less):
        series = estimate_log(replace(log, **less), VEHICLE)
        np.testing.assert_array_equal(np.isfinite(series.nis[1:]), log.valid[1:])
        return [
            np.linalg.norm((x - y)[400:])
            for x, y in ((series.force, log.force), (series.torque, log.torque))
        ]

    force, torque = errors(accelerometer=None, gyro=None)
    assert errors(gyro=None)[0] < 0.7 * force
    assert errors(accelerometer=None)[1] < 0.5 * torque


def test_a_tuning_needs_poses(flown):
    """One line, and no numbers."""
    with pytest.raises(InputError, match="to fit a tuning to"):
        tune_to_log(pose_removed(flown), VEHICLE)


def test_the_force_is_the_posterior_of_a_walk():
    """Far from the ends, where the start is forgotten, a dense solution says the same."""
    rng = np.random.default_rng(0)
    n, walk, variance = 400, 0.01, 1.0
    y = np.cumsum(np.sqrt(walk) * rng.standard_normal(n)) + rng.standard_normal(n)
    found, std = _two_sided(y[:, None], np.zeros((n, 1, 1)), np.eye(1), np.diag([walk]), variance)
    between = np.diff(np.eye(n), axis=0)
    precision = np.eye(n) / variance + between.T @ between / walk
    covariance = np.linalg.inv(precision)
    inner = slice(150, 250)
    np.testing.assert_allclose(found[inner, 0, 0], (covariance @ y / variance)[inner], atol=1e-5)
    assert std[0] == pytest.approx(np.sqrt(covariance[200, 200]), rel=1e-4)
