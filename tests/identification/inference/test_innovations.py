"""What a flight loop answers to gusts seems to be a law; from the past alone it does not."""

import pytest

from tests.support.searches import VEHICLE, settings
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.inference.innovations import Innovations
from windwrench.identification.inference.regression import Flights
from windwrench.studies.trials.practice_flights import fly_practice

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
