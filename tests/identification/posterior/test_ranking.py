"""A short flight's missing effect is the likeliest, and its coefficient within its deviation."""

import pytest

from tests.support.searches import DRAG, VEHICLE, settings
from windwrench.identification.inference.regression import Flights
from windwrench.identification.posterior.ranking import rank
from windwrench.studies.trials.practice_flights import fly_practice

LIBRARY = ("rotor_drag", "mass", "inertia", "constant_force", "motor_lag")


def flown(**effects):
    log = fly_practice(VEHICLE, settings(effects), "excite", 20.0, seed=5)
    return Flights([log], VEHICLE)


def test_a_missing_mass_is_found():
    flights = flown(mass={"dm": 0.03})
    found = rank(flights, LIBRARY)
    best = found.sets[0]
    assert best.effects == ("mass",)
    assert found.probability["mass"] > 0.9
    off = best.coefficients["mass"]["dm"] - 0.03
    assert abs(off) < 3.0 * best.std["mass"]["dm"]
    assert found.structure < 3.0


def test_nothing_is_found_in_turbulence_alone():
    found = rank(flown(), LIBRARY)
    assert found.sets[0].effects == ()
    assert max(found.probability.values()) < 0.5


def test_a_law_that_the_library_lacks_shows_as_structure():
    assert rank(flown(rotor_drag=DRAG), ("mass", "inertia")).structure > 10.0


def test_what_another_search_proposes_is_asked_too():
    truth = {"wind": {"wx": 2.0, "wy": 1.0}, "rotor_drag": DRAG}
    flights = flown(**truth)
    near = {k: {x: 0.9 * y for x, y in v.items()} for k, v in truth.items()}
    best = rank(flights, ("wind", *LIBRARY), near).sets[0]
    assert best.effects == ("rotor_drag", "wind")
    assert best.coefficients["wind"]["wx"] == pytest.approx(2.0, rel=0.1)
    # what lies outside the library is no proposal
    assert rank(flights, ("mass",), truth).sets == rank(flights, ("mass",)).sets
