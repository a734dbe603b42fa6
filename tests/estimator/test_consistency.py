"""Filters are as good as they say, on truth drawn from their own model, and stated deviations hold
where vehicles are drawn from their stated uncertainty.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from tests.support.model_flights import (
    ANISOTROPIC,
    GUSTS,
    WITH_EFFECTS,
    YAWED,
    simulate_model,
)
from tests.support.vehicles import POSE, VEHICLE
from windwrench.dynamics import load_vehicle
from windwrench.dynamics.vehicle import Uncertainty
from windwrench.envs.recording import record_flight
from windwrench.envs.scenarios import draw_vehicle
from windwrench.estimator import ConstantGainFilter, UKFTuning, WrenchUKF
from windwrench.estimator.consistency import chi2_band, nees
from windwrench.estimator.model_uncertainty import factors_alone, factors_of
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.wrench_series import estimate_log, tune_to_log


def share_within(values, band):
    return np.mean((values >= band[0]) & (values <= band[1]))


@pytest.mark.parametrize(
    ("vehicle", "tuning"),
    [(WITH_EFFECTS, ANISOTROPIC), (VEHICLE, GUSTS)],
    ids=["with effects", "gusts"],
)
def test_a_filter_is_consistent(vehicle, tuning):
    """Truth drawn from the filter's own model, yawed by 120 degrees and turning at 3 rad/s."""
    runs = 20
    steps = 300
    estimator = WrenchUKF(vehicle, tuning)
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


def test_band_holds_the_mean_as_often_as_it_says():
    low, high = chi2_band(6, 100)
    assert (low, high) == pytest.approx((5.341, 6.697), abs=2e-3)
    means = default_rng(0).chisquare(6, (4000, 100)).mean(axis=1)
    assert np.mean((means > low) & (means < high)) == pytest.approx(0.95, abs=0.015)


@pytest.mark.parametrize("source", [pytest.param("measured", marks=pytest.mark.slow), "commanded"])
def test_intervals_hold_what_they_say(source):
    """95 % of 80 flights of drawn vehicles, three axes each, yawing and with changing thrust."""
    vehicle = replace(VEHICLE, omega_source=source)
    runs = 80
    steps = 240
    tuning = UKFTuning()
    error = np.empty((3, runs, 6))
    for r in range(runs):
        rng = default_rng(r)
        true = draw_vehicle(vehicle, rng)
        sway = 1.0 + rng.uniform(0.0, 0.3) * np.sin(0.015 * np.arange(steps) + rng.uniform(0, 6))
        speeds = np.tile(true.hover_rate * np.sqrt(sway)[:, None], 4)
        run = simulate_model(true, tuning, speeds, seed=r, **YAWED)
        e = run.fly(WrenchUKF(vehicle, tuning))[-1]
        error[0, r] = np.concatenate([e.torque - run.torque[-1], e.force - run.force[-1]])
        error[1, r] = np.concatenate([e.std_torque, e.std_force])
        error[2, r] = e.std[12:]
    inside = abs(error[0]) < 1.96 * error[1]
    torque = inside[:, :3].mean()
    force = inside[:, 3:].mean()
    assert 0.92 < torque < 0.98  # of 240: 0.028 is the deviation of a share of 0.95, twice
    assert 0.9 < force < 0.99  # the axes of a force share one error of thrust
    assert np.mean(abs(error[0]) < 1.96 * error[2]) < 0.8  # of noise alone


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ardrone2", "crazyflie"])
def test_intervals_hold_on_flights_of_another_model(name):
    """60 flights of 20 s in MuJoCo in turbulence, estimated as ``windwrench estimate`` does. Hover
    falls short along x and y: turbulence changes within 0.2 s, the walk that is fitted in 1 s.
    """
    vehicle = load_vehicle(name)
    inside = {"hover": [], "circle": [], "fast": [], "excite": []}
    for seed, trajectory in enumerate(15 * list(inside)):
        true = draw_vehicle(vehicle, default_rng((7, seed)))
        flown = record_flight(true, trajectory=trajectory, seconds=20.0, seed=7000 + seed)
        log = FlightLog(**flown, name="flight", source="flight")
        series = estimate_log(log, vehicle, tuning=tune_to_log(log, vehicle).tuning)
        rows = np.arange(800, len(log.t), 200)
        off = abs(series.force - flown["force"])[rows]
        std = series.std_force[rows]
        inside[trajectory].append(np.mean(off < 1.96 * std))
    shares = {trajectory: np.mean(of) for trajectory, of in inside.items()}
    flights = np.concatenate(list(inside.values()))
    half = 1.96 * flights.std(ddof=1) / np.sqrt(len(flights))
    print(f"{name}: {flights.mean():.3f} +- {half:.3f}, in hover {shares['hover']:.2f}")
    assert all(share > (0.78 if t == "hover" else 0.9) for t, share in shares.items()), shares


@pytest.mark.parametrize("make", [WrenchUKF, ConstantGainFilter])
def test_the_filter_stays_as_it_is_and_says_in_hover_what_follows_by_hand(make):
    known = VEHICLE.uncertainty
    exact = make(replace(VEHICLE, uncertainty=Uncertainty()))
    stated = make(VEHICLE)
    for ukf in (exact, stated):
        ukf.reset(*POSE)
    for _ in range(1000):
        a, b = (u.step([VEHICLE.hover_rate] * 4, *POSE) for u in (exact, stated))
    assert_array_equal(a.state, b.state)
    assert_array_equal(a.covariance, b.covariance)
    assert_array_equal(a.std_force, a.std[15:])
    turn = VEHICLE.weight * VEHICLE.arm_l * known.rotor / 2.0
    lift = VEHICLE.weight * np.sqrt(known.mass**2 + known.thrust**2 + known.rotor**2 / 4.0)
    assert_allclose(b.model_std, [turn, turn, 0, 0, 0, lift], rtol=1e-4, atol=1e-9)
    assert_array_equal(b.std_force, np.hypot(b.std[15:], b.model_std[3:]))


def test_the_parts_of_what_a_model_does_not_know_add_up():
    commanded = replace(VEHICLE, omega_source="commanded")
    assert_allclose(sum(factors_alone(commanded).values()), factors_of(commanded))
