"""A diagnosis claims no more than its least sure part: logs of commands alone, filtered poses, and
what comes now and then, which is no gust of a steady strength however little it is over a flight.
"""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.outcomes import noted
from tests.support.vehicles import VEHICLE
from windwrench.dynamics import EffectSetting
from windwrench.dynamics.effects import Need, needing
from windwrench.evidence.trials.logged_poses import FILTERS
from windwrench.evidence.trials.practice_flights import fly_practice, practise
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.diagnosis.commanded_rotors import UNSTATED_THRUST_STD
from windwrench.identification.diagnosis.regression import RegressedFlights
from windwrench.identification.diagnosis.residuals import transient_disturbances
from windwrench.identification.report.headline import headline
from windwrench.identification.report.words import remainder_sentence


def fly(name, trajectory="excite", seconds=20.0, seed=1, **coefficients):
    return fly_practice(VEHICLE, (EffectSetting(name, coefficients),), trajectory, seconds, seed)


def test_a_factor_on_thrust_from_commands_alone_is_never_sure():
    found = diagnose([replace(fly("mass", dm=0.05), commanded=True)], VEHICLE)
    factors = [e for e in found.effects if e.name in ("thrust_scale", "mass")]
    assert factors
    for effect in factors:
        (other,) = {"thrust_scale", "mass"} - {effect.name}
        assert effect.tentative
        assert other in effect.indistinguishable_from
        size = UNSTATED_THRUST_STD * (VEHICLE.mass if effect.name == "mass" else 1.0)
        assert all(std >= size for std in effect.std.values())
        assert found.probabilities.names[effect.name] < 0.5  # of 5 beside 30 %
        assert noted(found, f"{effect.name}: the log holds motor commands")
    assert found.verdict == "partly explained"
    assert headline(found).startswith("The model perhaps lacks ")


@pytest.mark.parametrize(
    ("name", "filtered", "coefficients"),
    [
        ("rotor_drag", "causal 5 Hz", {"kdx": 2e-4, "kdy": 1.5e-4}),
        pytest.param("com_offset", "extended Kalman filter", {"cx": 0.01}, marks=pytest.mark.slow),
    ],
)
def test_names_behind_a_filter_are_the_same_but_tentative(name, filtered, coefficients):
    found = diagnose([FILTERS[filtered](fly(name, **coefficients), VEHICLE)], VEHICLE)
    assert found.floor_is_bound
    assert name in {e.name for e in found.effects}
    assert all(e.tentative for e in found.effects)
    assert not needing(Need.FAST_MOTION) & {e.name for e in found.effects}
    assert found.verdict == "partly explained"
    assert "perhaps" in headline(found)
    assert found.advice[0].startswith("Log the pose as it was measured")
    assert noted(found, "position and attitude were filtered")
    assert noted(found, "the filter of the pose delays it")
    (effect,) = (e for e in found.effects if e.name == name)
    for key, value in coefficients.items():
        assert abs(effect.coefficients[key] - value) < max(4.0 * effect.std[key], 0.15 * abs(value))


@pytest.mark.slow
def test_a_filters_delay_is_no_late_motor():
    found = diagnose(
        [FILTERS["causal 10 Hz"](fly_practice(VEHICLE, (), "excite", 20.0, 4), VEHICLE)], VEHICLE
    )
    assert not [e for e in found.effects if not e.tentative]
    assert not needing(Need.FAST_MOTION) & {e.name for e in found.effects}
    assert noted(found, "later than they are logged, or the filter of the pose delays it")


def test_a_wash_that_passes_now_and_then_is_found_where_it_was():
    """A third of it, 0.05 weights for half a second, in twice the noise: as steady gusts it is next
    to nothing.
    """
    flown = practise(VEHICLE, "outsider", ("passing_wash",), "small", None, 3628941416)
    found = diagnose([flown.log], flown.vehicle)
    assert (found.verdict, found.remainder, found.effects) == ("unexplained", "random", ())
    (down,) = (push for push in found.pushes if push.channel == "Fz")
    near = abs(flown.log.t - down.t) < 0.3
    truth = flown.log.force[:, 2]
    assert truth[near].min() == pytest.approx(truth.min(), rel=0.1)
    assert down.peak == pytest.approx(truth.min(), rel=0.3)
    sentence = remainder_sentence(found)
    assert "transient disturbances" in sentence
    assert f"in {found.pushes[0].channel} at" in sentence
    assert f"of {flown.log.name}" in remainder_sentence(replace(found, test_logs=("another",)))


@pytest.mark.parametrize("turbulence", [0.0, 4.0])
def test_gusts_of_a_steady_strength_are_no_pushes(turbulence):
    log = fly_practice(VEHICLE, seconds=40.0, seed=5, turbulence=turbulence)
    assert transient_disturbances(RegressedFlights([log], VEHICLE), {}) == []


def test_it_is_said_in_which_log_the_push_was():
    calm = fly_practice(VEHICLE, seconds=20.0, seed=6)
    force = np.where((calm.t > 12.0) & (calm.t < 12.5), 0.1 * VEHICLE.weight, 0.0)
    # what moves it in the log alone: an acceleration that no rotor has made
    moved = np.cumsum(np.cumsum(force / VEHICLE.mass)) * calm.period**2
    pushed = replace(calm, name="pushed", position=calm.position + np.outer(moved, [1.0, 0.0, 0.0]))
    (push,) = transient_disturbances(RegressedFlights([calm, pushed], VEHICLE), {})
    assert (push.log, push.channel) == ("pushed", "Fx")
    assert push.t == pytest.approx(12.25, abs=0.1)
    assert push.peak == pytest.approx(0.1 * VEHICLE.weight, rel=0.3)
