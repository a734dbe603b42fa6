"""Tuning from a log: noise that is known is found back, and bad logs are taken or refused."""

from dataclasses import replace
from functools import cache
from math import inf, nan, pi

import numpy as np
import pytest
from numpy.linalg import norm, slogdet
from numpy.random import default_rng
from numpy.testing import assert_array_equal

from tests.support.model_flights import WITH_EFFECTS, simulate_model
from tests.support.outcomes import refused
from tests.support.sizes import rms
from tests.support.vehicles import HOVER, POSE, VEHICLE
from windwrench.estimator import UKFTuning, WrenchUKF
from windwrench.estimator.consistency import chi2_band
from windwrench.estimator.innovations import innovations, pieces_of
from windwrench.estimator.noise_fit import NoiseFitSettings, consistency_of, fit_noise
from windwrench.estimator.rise_time import rise_times

PERIOD = 0.005
# white noise as large as the default, walks faster, and no two axes and sensors in proportion
TRUE = UKFTuning(
    force_walk=(0.02, 0.02, 0.008),
    torque_walk=(6e-4, 6e-4, 2e-4),
    thrust_noise=0.3,
    motor_torque_noise=0.03,
    position_noise=0.002,
    attitude_noise=0.003,
)
WALKS = ("force_walk", "torque_walk")
NOISES = ("thrust_noise", "motor_torque_noise", "position_noise", "attitude_noise")


@cache
def run_of(tuning=TRUE, seconds=14.0, seed=0, vehicle=VEHICLE):
    """Return a flight drawn from the filter's own model.

    Its rotor speeds hold over a step where the fit takes the mean of two rows; with a rate loop of
    5 / s the difference is about 1 % of one step's motor torque noise.
    """
    speeds = np.full((round(seconds / PERIOD), 4), vehicle.hover_rate)
    return simulate_model(vehicle, tuning, speeds, PERIOD, seed, rate_gain=5.0)


def flight(*drawn, **named):
    """Return t, rotor speeds, position and quaternion of such a flight."""
    return run_of(*drawn, **named).log()


def logarithms(tuning):
    """The eight fitted numbers of a tuning, in the order of ``NoiseFit.deviation``."""
    walks = [np.broadcast_to(getattr(tuning, name), 3)[i] for name in WALKS for i in (0, 2)]
    noises = [np.broadcast_to(getattr(tuning, name), 3)[0] for name in NOISES]
    return np.log(walks + noises)


@pytest.fixture(scope="module")
def fits():
    return [fit_noise(VEHICLE, *flight(seed=seed)) for seed in range(2)]


def test_known_noise_is_found_back_within_its_uncertainty(fits):
    """Over two flights the eight errors in their own deviations are like 16 normal numbers."""
    errors = np.array([(logarithms(fit.tuning) - logarithms(TRUE)) / fit.deviation for fit in fits])
    assert (np.abs(errors) < 3.5).all()
    assert 0.5 < rms(errors) < 1.5
    # and that is not little said: pose noise is known to 2 %, walks to 40 %
    for fit in fits:
        assert (fit.deviation[6:] < 0.02).all()
        assert (fit.deviation[:4] < 0.4).all()


def test_gusts_are_found_back_and_a_walk_stays_one():
    """A wrong thrust, steady, is no gust: along z the force walks."""
    true = replace(TRUE, force_time=(0.2, 0.2, inf), torque_time=0.3)
    fit = fit_noise(VEHICLE, *flight(true), settings=NoiseFitSettings(gusts=True))
    times = np.array([*np.asarray(fit.tuning.force_time)[[0, 2]], fit.tuning.torque_time[0]])
    assert abs(np.log(times[0] / 0.2)) < 3.5 * fit.deviation[8]
    assert times[1] > 1.0
    assert abs(np.log(times[2] / 0.3)) < 3.5 * fit.deviation[10]
    assert "Correlation time of the force: " in str(fit)
    assert fit.as_dict()["force_time"][0] == times[0]
    walk = flight(seconds=5.0)
    alike = (fit_noise(VEHICLE, *walk, settings=NoiseFitSettings(gusts=x)).tuning for x in (1, 0))
    assert_array_equal(*(tuning.force_walk for tuning in alike))


def test_nis_is_in_its_band_after_the_fit_and_not_before(fits):
    for fit in fits:
        for nis, count in (
            (fit.after.nis, fit.after.poses),
            (fit.after.nis_over_second, fit.after.seconds),
        ):
            low, high = chi2_band(6, count)
            assert low <= nis <= high
        assert fit.before.nis > chi2_band(6, fit.before.poses)[1]
        assert fit.log_likelihood_after > fit.log_likelihood_before
        assert "fitted to this flight" in str(fit)
        assert "(before: 1 s)" in str(fit)
        assert fit.outliers == 0


def test_the_likelihood_is_that_of_the_filters_own_steps():
    """Against the filter stepped from Python: NIS and log det S of every pose."""
    t, speeds, position, quaternion = flight(seconds=1.0)
    pieces = pieces_of(VEHICLE, t, speeds, position, quaternion, None, 0.5, 0.2)
    found = innovations(VEHICLE, TRUE, PERIOD, pieces, 1e-12, 1.0)
    (piece,) = pieces
    ukf = WrenchUKF(VEHICLE, TRUE, PERIOD)
    ukf.reset(
        piece.position,
        piece.quaternion,
        velocity=piece.velocity,
        angular_velocity=piece.angular_velocity,
    )
    noise = np.diag(np.r_[np.full(3, (0.003 / 4) ** 2), np.full(3, 0.002**2)])
    seen = [0, 1, 2, 6, 7, 8]
    expected = []
    for k in range(1, len(t)):
        before = ukf.predict(0.5 * (speeds[k - 1] + speeds[k])).covariance
        nis = ukf.correct(position[k], quaternion[k]).nis
        S = before[np.ix_(seen, seen)] + noise
        expected.append(-0.5 * (nis + slogdet(2.0 * pi * S)[1]))
    late = t[1:] > t[0] + 0.2
    assert np.allclose(found.log_likelihood, np.array(expected)[late], rtol=0, atol=1e-6)


def test_bounds_hold_where_there_is_no_noise_to_find():
    quiet = UKFTuning(**dict.fromkeys((*WALKS, *NOISES), 1e-9))
    use = NoiseFitSettings()
    truth = run_of(quiet, seconds=4.0)
    fit = fit_noise(VEHICLE, *truth.log())
    assert (np.asarray(fit.tuning.position_noise) >= use.position[0] * (1 - 1e-9)).all()
    assert (np.asarray(fit.tuning.attitude_noise) >= use.attitude[0] * (1 - 1e-9)).all()
    assert (np.asarray(fit.tuning.thrust_noise) >= use.white[0] * VEHICLE.weight * (1 - 1e-9)).all()
    assert np.isnan(fit.deviation[6:]).all()
    estimate = truth.fly(WrenchUKF(VEHICLE, fit.tuning, PERIOD))[-1]
    assert np.isfinite(estimate.covariance).all()
    assert norm(estimate.force - truth.force[-1]) < 0.05


def test_lost_held_and_wild_poses_change_little(fits):
    clean = fits[0]
    t, speeds, position, quaternion = flight(seed=0)
    rng = default_rng(1)
    wild = rng.choice(len(t), len(t) // 100, replace=False)
    position[wild] += rng.uniform(-0.3, 0.3, (len(wild), 3))
    for pose in (position, quaternion):
        pose[700:760] = nan  # lost for 0.3 s
        pose[1500:1700] = nan  # for 1 s: the filter starts anew
        pose[2500:2560] = pose[2499]  # held
    spoiled = fit_noise(VEHICLE, t, speeds, position, quaternion)
    assert 17 <= spoiled.outliers <= 42
    apart = (logarithms(spoiled.tuning) - logarithms(clean.tuning)) / clean.deviation
    assert (np.abs(apart) < 2.0).all()
    low, high = chi2_band(6, spoiled.after.poses)
    assert low <= spoiled.after.nis <= high


def test_short_logs_work_or_are_refused_in_one_line():
    log = t, speeds, position, quaternion = flight(seconds=3.0)
    fit = fit_noise(VEHICLE, *log)
    assert 300 < fit.after.poses <= 400
    assert 0.5 < fit.after.nis / 6.0 < 2.0
    for use in (fit_noise, consistency_of):
        with refused("expected at least 100") as caught:
            use(VEHICLE, *(x[:250] for x in log))
        assert "\n" not in str(caught.value)
    for spoil in (np.full_like(position, nan), np.tile(position[:1], (len(t), 1))):
        held = np.tile(quaternion[:1], (len(t), 1))
        with refused("0 of 600 rows"):
            fit_noise(VEHICLE, t, speeds, spoil, held)


def test_a_long_log_is_thinned_and_a_slow_one_is_scaled():
    log = flight()
    fit = fit_noise(VEHICLE, *log, settings=NoiseFitSettings(rows=1400))
    assert fit.after.poses == len(log[0]) - 200  # figures are those of the whole log
    assert (abs(logarithms(fit.tuning) - logarithms(TRUE)) < 4.0 * fit.deviation).all()


def test_declared_effects_are_part_of_the_model():
    fit = fit_noise(WITH_EFFECTS, *flight(seconds=5.0, vehicle=WITH_EFFECTS))
    low, high = chi2_band(6, fit.after.poses)
    assert low <= fit.after.nis <= high


@pytest.mark.parametrize("time", [inf, 0.3])
def test_rise_times_are_those_of_the_filter(time):
    assert np.allclose(rise_times(VEHICLE, UKFTuning(), PERIOD), 1.0, rtol=0.02)
    quick = replace(TRUE, thrust_noise=0.003, motor_torque_noise=3e-4, force_time=time)
    force, _ = rise_times(VEHICLE, quick, PERIOD)
    assert force[0] < force[2]
    assert force[0] > 2.0 * (2.2 * PERIOD * 0.003 / 0.02)  # the pose's noise is what slows it down
    ukf = WrenchUKF(VEHICLE, quick, PERIOD)
    ukf.reset(*POSE)
    push = 0.2
    position = 1.0
    velocity = 0.0
    seen = []
    for k in range(800):
        a = push / VEHICLE.mass if k >= 400 else 0.0
        position = position + PERIOD * (velocity + 0.5 * PERIOD * a)
        velocity = velocity + PERIOD * a
        seen.append(ukf.step(HOVER, (0.0, 0.0, position), (1.0, 0.0, 0.0, 0.0)).force[2])
    seen = np.array(seen[400:])
    shown = push if time == inf else seen[-1]  # gusts decay: a steady push is not shown whole
    assert shown <= push
    measured = PERIOD * (np.argmax(seen > 0.9 * shown) - np.argmax(seen > 0.1 * shown))
    assert measured == pytest.approx(force[2], abs=2 * PERIOD)


def test_a_walk_that_is_too_slow_shows_over_a_second_and_not_in_nis():
    """Walks a quarter of the true ones, position noise a little too large: NIS looks consistent."""
    hidden = {"position_noise": 0.00205, "attitude_noise": 0.00305}
    logs = [flight(seed=seed, seconds=20.0) for seed in range(3)]
    slow = replace(TRUE, **{n: np.asarray(getattr(TRUE, n)) / 4.0 for n in WALKS}, **hidden)
    found = [consistency_of(VEHICLE, *log, tuning=slow) for log in logs]
    assert np.mean([each.nis for each in found]) == pytest.approx(6.0, abs=0.1)
    assert all(each.too_slow for each in found)
    assert not any(consistency_of(VEHICLE, *log, tuning=TRUE).too_slow for log in logs)
