"""The measurement of recoveries: its flights are what they claim to be, its limits are felt."""

import numpy as np
import pytest
from numpy.linalg import norm
from numpy.random import default_rng
from scipy.spatial.transform import Rotation

from tests.support.sizes import rms
from windwrench.evidence.recovery import (
    EVENTS,
    FILTERS,
    FLOWN,
    GATES,
    NOISES,
    TAILS,
    Verdict,
    befall,
    estimated,
    exact_flight,
    fly_combination,
    fly_wrong_attitudes,
    measured,
    missed,
    named,
    poisson_band,
    quiet_flights,
    turned,
)

AXES = (FILTERS, FLOWN, NOISES, EVENTS, GATES)
SIZES = {"x1": 1.0, "x3": 3.0, "student": 1.0, "quantised": np.sqrt(1.0 + 4.0**2 / 12.0)}


@pytest.mark.parametrize("flown", ["crazyflie@50", *FLOWN, "hummingbird@1000"])
def test_rotors_fly_the_path_under_the_wrench(flown):
    """A filter that sees each pose without noise finds the wrench to a percent."""
    flight = exact_flight(flown, 8.0)
    quaternion = flight.attitude.as_quat(scalar_first=True)
    said = estimated("ukf", flight, flight.position.copy(), quaternion)
    z, error = missed(flight, said)
    settled = slice(flight.row(6.0), None)
    assert error[settled].max() < 0.01
    assert z[settled].max() < 1.0
    torque = abs(said.torque - flight.wrench[:3])[settled]
    assert torque.max() < 0.01 * flight.vehicle.weight * flight.vehicle.arm_l
    assert np.ptp(flight.position, axis=0).max() > 0.3


@pytest.mark.parametrize("noise", SIZES)
def test_poses_are_as_noisy_as_said(noise):
    flight = exact_flight("ardrone2@200", 20.0)
    rng = default_rng(0)
    position, attitude = measured(flight, (NOISES | TAILS)[noise], rng)
    turns = (attitude * flight.attitude.inv()).as_rotvec() / flight.vehicle.mocap.sigma_att_rad
    off = (position - flight.position) / flight.vehicle.mocap.sigma_pos_m
    for values in (turns, off):
        assert rms(values) == pytest.approx(SIZES[noise], rel=0.1)


def test_what_happens_to_poses_happens_to_them_alone():
    flight = exact_flight("crazyflie@100", 3.0)
    rng = default_rng(0)
    during = slice(100, 200)
    for event in EVENTS:
        position, quaternion = befall(event, 100, 200, flight.position, flight.attitude, rng)
        away = norm(position - flight.position, axis=1)
        turns = Rotation.from_quat(np.nan_to_num(quaternion, nan=1.0), scalar_first=True)
        tilt = (turns * flight.attitude.inv()).magnitude()
        others = np.r_[0:100, 200:300]
        assert (np.isnan(away[during]) == (event == "gap")).all()
        assert np.nanmax(away[during], initial=0.0) == pytest.approx(0.5 * (event == "jump"))
        assert away[others].max() == pytest.approx(0.5 * (event == "jump"))
        assert tilt[others].max() < 1e-6
        if event != "gap":
            assert np.degrees(tilt[during]).max() == pytest.approx(
                45.0 * (event == "tilt"), abs=1e-5
            )


def test_there_are_384_and_each_word_chooses():
    assert len(named(AXES, "")) == 384
    assert len(named(AXES, "gap ukf")) == 48
    assert named(AXES, "ukf ardrone2@200 x2 tilt no-gate") == [
        ("ukf", "ardrone2@200", "x2", "tilt", "no-gate")
    ]


def test_each_limit_is_felt():
    assert Verdict(2, 0.05, 1.0, 0.02).failures == []
    assert Verdict(3, 0.051, 0.0, 0.021).failures == ["restarts", "force", "z"]
    assert Verdict(0, float("nan"), 0.0, 0.0).failures == ["force"]


@pytest.mark.parametrize("kind", FILTERS)
@pytest.mark.parametrize("event", EVENTS)
def test_poses_as_noisy_as_declared_are_within_the_limits(kind, event):
    words = (kind, "crazyflie@100", "x1", event, "gate=.9999")
    verdict = fly_combination(words)
    assert verdict.failures == []
    assert verdict.restarts == 0 or event != "nothing"
    assert verdict.error > 0.0
    assert fly_combination(words) == verdict
    assert fly_combination(words, seed=1) != verdict


def test_wrong_attitudes_are_as_wrong_as_said():
    attitude = exact_flight("crazyflie@100", 1.0).attitude
    seen = set()
    for seed in range(30):
        words, wrong = turned(default_rng(seed), attitude)
        off = np.degrees((wrong * attitude.inv()).magnitude())
        kind, *angle = words.split()[:2]
        sizes = {0.0, 180.0} if kind == "flicker" else {float(*angle or [180.0])}
        assert set(np.round(off, 6)) == sizes
        seen.add(kind)
    assert seen == {"swap", "flip", "flicker"}
    assert fly_wrong_attitudes(0) == fly_wrong_attitudes(0) != fly_wrong_attitudes(1)


def test_a_rate_lies_within_its_interval():
    assert poisson_band(0, 2.0) == (0.0, pytest.approx(3.689 / 2.0, rel=1e-3))
    low, high = poisson_band(10, 2.0)
    assert (low, high) == (pytest.approx(2.398, rel=1e-3), pytest.approx(9.195, rel=1e-3))


def test_quiet_flights_are_counted():
    assert quiet_flights("ukf crazyflie@50 x1", 1) == {"x1": (0, pytest.approx(0.05))}
