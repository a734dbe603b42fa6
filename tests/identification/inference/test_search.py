"""Fits of effects to flights, and what each other effect would explain."""

import pytest

from tests.support.searches import DRAG, VEHICLE, recorded, searched
from windwrench.envs.recording import background
from windwrench.identification.inference.search import FittedEffects
from windwrench.identification.inference.stepwise_search import are_told_apart

LIBRARY = ["rotor_drag", "body_drag", "mass", "com_offset", "constant_force", "latency"]


def flown(trajectory="excite", **effects):
    return recorded(trajectory, background=background(VEHICLE, 1.0), **effects)


@pytest.fixture(scope="module")
def search():
    return searched(flown(rotor_drag=DRAG), LIBRARY)[0]


def gains_at(search, fit):
    regression = search.linearise(fit)
    return search.gains(fit, regression, search.gram(fit, regression))


def test_what_acts_explains_most_and_nothing_is_left_beside_it(search):
    first = gains_at(search, FittedEffects({}))
    assert first[0].effect == "rotor_drag"
    assert first[0].deviance_reduction > 100.0
    fit = search.refit(first[0].fit)
    for name, value in DRAG.items():
        assert fit.setting["rotor_drag"][name] == pytest.approx(value, rel=0.05)
        assert 0.0 < fit.std["rotor_drag", name] < 0.05 * value
    beside = gains_at(search, fit)
    assert "rotor_drag" not in {x.effect for x in beside}
    assert max(x.deviance_reduction for x in beside) < 40.0


def test_in_a_hover_a_force_and_a_thrust_are_not_told_apart():
    up = {"fx": 0.0, "fy": 0.0, "fz": 0.1}
    hover, _ = searched(flown("hover", constant_force=up), ["constant_force", "thrust_scale"])
    fit = hover.refit(FittedEffects({"constant_force": up}))
    assert "thrust_scale" not in {x.effect for x in gains_at(hover, fit)}


def test_effects_of_a_fit_are_told_apart_or_it_is_none(search):
    """A refit may run along what flights do not show: a hover's mass and thrust, to -80 %."""
    both = FittedEffects({"rotor_drag": dict(DRAG), "mass": {"dm": 0.01}})
    assert are_told_apart(search, search.refit(both))
    hover, _ = searched(flown("hover"), ["mass", "thrust_scale"])
    far = FittedEffects({"mass": {"dm": -0.5 * VEHICLE.mass}, "thrust_scale": {"s": -0.5}})
    assert not are_told_apart(hover, far)
    assert are_told_apart(hover, far.without("mass"))
