"""Filters are as good as they say, on truth drawn from their own model."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.support.model_flights import ANISOTROPIC, WITH_EFFECTS, YAWED, simulate_model
from windwrench.dynamics import load_vehicle
from windwrench.estimator import UKFTuning, WrenchEKF, WrenchEstimate, WrenchUKF
from windwrench.estimator.consistency import chi2_band, nees, state_error

VEHICLE = load_vehicle("ardrone2")


def share_within(values, band):
    return np.mean((values >= band[0]) & (values <= band[1]))


@pytest.mark.parametrize(
    ("make", "vehicle", "tuning"),
    [
        (WrenchUKF, VEHICLE, UKFTuning()),
        (WrenchUKF, WITH_EFFECTS, ANISOTROPIC),
        (WrenchEKF, WITH_EFFECTS, ANISOTROPIC),
    ],
    ids=["unscented", "unscented with effects", "extended with effects"],
)
def test_a_filter_is_consistent(make, vehicle, tuning):
    """Truth drawn from the filter's own model, yawed by 120 degrees and turning at 3 rad/s."""
    runs, steps, estimator = 40, 400, make(vehicle, tuning)
    found = np.empty((2, runs, steps))
    for r in range(runs):
        speeds = np.full((steps, 4), vehicle.hover_rate)
        run = simulate_model(vehicle, tuning, speeds, seed=r, **YAWED)
        for k, e in enumerate(run.fly(estimator)):
            found[:, r, k] = nees(e, run.state[k]), e.nis
    errors, nis = found.mean(axis=1)
    # the narrow band of all innovations, which are independent
    low, high = chi2_band(6, runs * steps, 0.999)
    assert low <= nis.mean() <= high
    assert share_within(errors, chi2_band(18, runs)) >= 0.88
    assert share_within(nis, chi2_band(6, runs)) >= 0.9


def test_nees_of_a_known_error():
    state = np.zeros(20)
    true = Rotation.from_rotvec([0.3, -0.2, 2.0])
    turn = Rotation.from_rotvec([0.02, 0.0, 0.0])  # in the world frame
    state[3:7] = (turn.inv() * true).as_quat(scalar_first=True)
    covariance = np.eye(18)
    covariance[0, 0] = 0.005**2
    estimate = WrenchEstimate(np.concatenate([state, np.zeros(8), covariance.ravel()]))
    truth = np.zeros(20)
    truth[3:7], truth[7], truth[18] = -true.as_quat(scalar_first=True), 1.0, 2.0
    assert np.allclose(state_error(estimate, truth)[:3], [0.005, 0, 0], rtol=1e-4, atol=1e-12)
    assert nees(estimate, truth) == pytest.approx(1.0 + 1.0 + 4.0, rel=1e-4)


def test_band_holds_the_mean_as_often_as_it_says():
    low, high = chi2_band(6, 100)
    assert (low, high) == pytest.approx((5.341, 6.697), abs=2e-3)
    means = np.random.default_rng(0).chisquare(6, (4000, 100)).mean(axis=1)
    assert np.mean((means > low) & (means < high)) == pytest.approx(0.95, abs=0.015)
