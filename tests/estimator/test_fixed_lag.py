"""The fixed-lag smoother is the fixed-interval smoother of the data up to now."""

import numpy as np
import pytest

from tests.support.flights import PERIOD, yawing_flight
from windwrench.dynamics import EffectSetting, InputError, load_vehicle
from windwrench.estimator import UKFTuning, WrenchEKF, WrenchUKF
from windwrench.estimator.fixed_lag import FixedLagSmoother
from windwrench.estimator.smoother import RecordingUKF

VEHICLE = load_vehicle("ardrone2")


def samples(flight, steps):
    """Yield the arguments of each step: poses are missing in part or whole now and then."""
    for k in range(1, steps):
        x = None if 40 <= k < 55 else flight["position"][k]
        q = None if 50 <= k < 60 else flight["quaternion"][k]
        yield flight["rotors"][k], x, q


@pytest.mark.parametrize(
    "effects", [(), (EffectSetting("rotor_drag", {"kdx": 1e-4, "kdy": 1e-4}),)]
)
def test_equals_the_fixed_interval_smoother_of_all_up_to_now(effects):
    vehicle, steps, lag = VEHICLE.with_effects(*effects), 120, 25
    flight = yawing_flight(VEHICLE, steps, seed=2)
    online = FixedLagSmoother(WrenchUKF(vehicle, UKFTuning(), PERIOD), lag * PERIOD)
    offline = RecordingUKF(vehicle, UKFTuning(), PERIOD)
    start = flight["position"][0], flight["quaternion"][0], None, flight["velocity"][0]
    assert online.lag == pytest.approx(lag * PERIOD)
    for estimator in (online, offline):
        estimator.reset(*start)
    for k, sample in enumerate(samples(flight, steps), start=1):
        e = online.step(*sample)
        filtered = offline.step(*sample)
        assert np.array_equal(online.ukf.estimate.state, filtered.state, equal_nan=True)
        assert online.delay == pytest.approx(min(k, lag) * PERIOD)
        if k % 7 == 0 or k < 3:
            expected = offline.smooth([max(0, k - lag)], covariance=True).estimate(0)
            assert np.allclose(e.state, expected.state, rtol=0, atol=1e-9, equal_nan=True)
            size = np.sqrt(np.diag(expected.covariance))
            assert np.allclose(
                e.covariance / np.outer(size, size),
                expected.covariance / np.outer(size, size),
                atol=1e-7,
            )


def test_a_reset_forgets_and_repeats():
    flight = yawing_flight(VEHICLE, 60, seed=2)
    smoother = FixedLagSmoother(WrenchUKF(VEHICLE, UKFTuning(), PERIOD), 0.1)
    runs = []
    for _ in range(2):
        smoother.reset(flight["position"][0], flight["quaternion"][0])
        assert smoother.delay == 0.0
        runs.append([smoother.step(*sample).state for sample in samples(flight, 60)])
    assert np.array_equal(*runs, equal_nan=True)


def test_a_step_in_force_shows_sooner_than_the_filter_rises():
    """Half the rise time of lag: the smoothed estimate, at its own time, is the closer one."""
    steps, lag = 1200, 60
    flight = yawing_flight(VEHICLE, steps, seed=4, force=np.zeros(3))
    smoother = FixedLagSmoother(WrenchUKF(VEHICLE, UKFTuning(), PERIOD), lag * PERIOD)
    smoother.reset(
        flight["position"][0],
        flight["quaternion"][0],
        None,
        flight["velocity"][0],
        flight["omega"][0],
    )
    errors = []
    for k in range(1, steps):
        e = smoother.step(flight["rotors"][k], flight["position"][k], flight["quaternion"][k])
        errors.append([e.force, smoother.ukf.estimate.force])
    settled = np.sqrt(np.mean(np.square(errors[400:]), axis=(0, 2)))
    assert settled[0] < 0.9 * settled[1]


def test_bad_input_is_refused_and_changes_nothing():
    ukf = WrenchUKF(VEHICLE, UKFTuning(), PERIOD)
    for bad in (0.0, -1.0, np.nan, 1e9, "0.3"):
        with pytest.raises(InputError, match="lag must lie"):
            FixedLagSmoother(ukf, bad)
    with pytest.raises(InputError, match="WrenchEKF"):
        FixedLagSmoother(WrenchEKF(VEHICLE), 0.3)
    smoother = FixedLagSmoother(ukf, 0.05)
    smoother.reset((0, 0, 1), (1, 0, 0, 0))
    hover = np.full(4, VEHICLE.hover_rate)
    before = smoother.step(hover, (0, 0, 1), (1, 0, 0, 0))
    state = ukf.estimate.state.copy()
    with pytest.raises(InputError, match="length 1"):
        smoother.step(hover, (0, 0, 1), (2, 0, 0, 0))
    assert np.array_equal(ukf.estimate.state, state)
    assert smoother.delay == pytest.approx(PERIOD)
    assert np.isfinite(before.state[:19]).all()
