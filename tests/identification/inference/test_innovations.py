"""What a flight loop answers to gusts seems to be a law; from the past alone it does not."""

import numpy as np
import pytest

from tests.support.searches import VEHICLE, settings
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.inference.disturbance_filter import innovations
from windwrench.identification.inference.innovations import Innovations
from windwrench.identification.inference.regression import Flights
from windwrench.studies.trials.practice_flights import fly_practice

PERIOD = 0.005
TRUTHS = {
    "inertia": {"jx": 0.1, "jy": 0.1, "jz": 0.0},
    "attitude_gain": {"g": 0.05},
    "latency": {"d": 0.012},
    "constant_force": {"fx": 0.2, "fy": 0.0, "fz": 0.0},
    "motor_lag": {"tau": 0.02},
    "clock_offset": {"dt": -0.012},
}


@pytest.fixture(scope="module")
def gusty():
    """Thirty seconds of nothing but gusts, four times the usual."""
    return fly_practice(VEHICLE, trajectory="circle", seconds=30.0, seed=0, turbulence=4.0)


def gusts(strength, time, steps, rng):
    """Pose, drive and gusts of one axis; noise of the pose is one."""
    g = np.zeros(steps)
    decay = np.exp(-PERIOD / time)
    for k in range(1, steps):
        g[k] = decay * g[k - 1] + np.sqrt(strength * (1.0 - decay**2)) * rng.standard_normal()
    drive = np.sqrt(strength) * np.sin(2.0 * np.pi * np.arange(steps) * PERIOD)
    speed = np.cumsum(g + drive) * PERIOD
    pose = np.cumsum(speed) * PERIOD + rng.standard_normal(steps)
    return pose, drive


@pytest.mark.parametrize("strength", [1e4, 1e6])
def test_innovations_are_white_and_small_with_the_gusts_that_are(strength):
    pose, drive = gusts(strength, 0.25, 40_000, np.random.default_rng(1))
    e = {}
    for factor in (1.0, 0.01, 100.0):
        found = innovations(pose[:, None], drive[:, None], factor * strength, 0.25, PERIOD)
        e[factor] = found[1000:, 0]
    white = np.array([np.corrcoef(e[1.0][k:], e[1.0][:-k])[0, 1] for k in range(1, 20)])
    assert np.abs(white).max() < 0.025
    assert e[1.0].var() < min(e[0.01].var(), e[100.0].var())


def test_gusts_are_measured(gusty):
    """Turbulence of 0.06 N and 0.0012 Nm for a quarter of a second, of which the wrench in the log
    is told nothing.
    """
    found = Innovations(Flights([gusty], VEHICLE), {}).disturbances()
    true = [*gusty.force.std(axis=0), *gusty.torque.std(axis=0)]
    for channel, (gust, rms) in enumerate(zip(found, true, strict=True)):
        assert gust[0] == pytest.approx(rms, rel=0.25), channel
        assert 0.1 < gust[1] < 0.6, channel


def test_gusts_alone_are_neither_named_nor_a_law(gusty):
    found = diagnose([gusty], VEHICLE)
    assert not found.effects
    assert not found.structure


@pytest.mark.parametrize("effect", TRUTHS)
def test_the_truth_is_confirmed_in_gusts_and_twice_it_is_not(effect):
    truth = {effect: TRUTHS[effect]}
    log = fly_practice(VEHICLE, settings(truth), "excite", 30.0, seed=1, turbulence=4.0)
    flights = Flights([log], VEHICLE)
    twice = {name: {k: 2.0 * v for k, v in values.items()} for name, values in truth.items()}
    assert Innovations(flights, {}).confirm(truth)
    assert not Innovations(flights, truth).confirm(twice)
    assert not Innovations(flights, truth).confirm({**truth, "mass": {"dm": 0.02}})
