"""What the flight loop's answer to noise bends in the residual's least squares, innovations measure
as it is.
"""

import pytest

from tests.support.searches import VEHICLE, searched, settings
from windwrench.dynamics.effects import names
from windwrench.identification.inference.likelihood_refit import (
    delay_alternatives,
    delay_doubts,
    delay_kind,
    refitted_by_likelihood,
    with_lag,
)
from windwrench.identification.inference.time_offsets import (
    ROTOR_TIME_OFFSET,
)
from windwrench.studies.trials.practice_flights import fly_practice


def fitted(truth, guess, seconds=40.0, **flight):
    """Return the search, and the least-squares fit of the effects of ``guess``, on a flight with
    those of ``truth``.
    """
    log = fly_practice(VEHICLE, settings(truth), seconds=seconds, **flight)
    return searched(log, names(), **guess)


def test_a_lag_is_no_delay_of_the_turn_rates():
    truth = {"motor_lag": {"tau": 0.0134}}
    search, fit = fitted(truth, truth, seed=2, sensor=0.5, turbulence=0.0)
    found = refitted_by_likelihood(search, fit)
    by_residual, by_innovations = (
        abs(x.setting["motor_lag"]["tau"] - 0.0134) for x in (fit, found)
    )
    assert by_residual > 0.002, "if least squares is right, nothing needs measuring anew"
    assert by_innovations < 0.5 * by_residual
    assert abs(found.setting[ROTOR_TIME_OFFSET[0]][ROTOR_TIME_OFFSET[1]]) < 0.5 * abs(
        fit.setting[ROTOR_TIME_OFFSET[0]][ROTOR_TIME_OFFSET[1]]
    )
    assert all(found.std[column] >= fit.std[column] for column in fit.std)


@pytest.mark.parametrize("guess", [{"motor_lag": {"tau": 0.01}}, {"latency": {"d": 0.01}}])
@pytest.mark.parametrize("truth", [{"motor_lag": {"tau": 0.012}}, {"latency": {"d": 0.012}}])
def test_lag_and_delay_are_told_apart(truth, guess):
    """To the residual they are the same, at a third of their typical size."""
    search, fit = fitted(truth, guess, seed=4, turbulence=1.0)
    follow = delay_kind(search, fit)
    assert follow == ("lag" if "motor_lag" in truth else "delay")
    assert bool(delay_doubts(search, fit, follow)) == (truth.keys() != guess.keys())
    assert not delay_alternatives(search, fit, follow)
    if "motor_lag" in truth:
        named = with_lag(search, fit)
        assert named.effects == ["motor_lag"]
        assert refitted_by_likelihood(search, named).setting["motor_lag"]["tau"] == pytest.approx(
            0.012, rel=0.2
        )


def test_a_gain_of_the_attitude_has_no_share_of_its_noise():
    """On a gentle flight in twice the noise."""
    truth = {"attitude_gain": {"g": 0.05}}
    search, fit = fitted(truth, truth, trajectory="gentle", seed=0, sensor=2.0, turbulence=1.0)
    by_residual, by_innovations = (
        x.setting["attitude_gain"]["g"] - 0.05 for x in (fit, refitted_by_likelihood(search, fit))
    )
    assert by_residual > 0.02
    assert abs(by_innovations) < 0.3 * by_residual


def test_a_clock_beside_a_gain_of_the_attitude_is_measured_as_late_turn_rates():
    truth = {"attitude_gain": {"g": 0.05}, "clock_offset": {"dt": -0.026}}
    search, fit = fitted(truth, truth, trajectory="fast", seed=5, turbulence=1.0)
    found = refitted_by_likelihood(search, fit)
    assert found.effects == fit.effects
    assert found.std.keys() == fit.std.keys()
    assert found.setting["clock_offset"]["dt"] == pytest.approx(-0.026, rel=0.1)
    assert found.setting["attitude_gain"]["g"] == pytest.approx(0.05, rel=0.1)
