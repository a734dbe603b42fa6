"""What another search proposes is named only where it explains the residual better."""

import pytest

from tests.support.searches import DRAG, VEHICLE, settings
from windwrench.identification.inference.regression import Flights
from windwrench.identification.inference.search import Search
from windwrench.identification.inference.stepwise_search import find_effects, with_proposal
from windwrench.studies.trials.practice_flights import fly_practice


@pytest.fixture(scope="module")
def flights():
    flown = fly_practice(VEHICLE, settings({"rotor_drag": DRAG}), "excite", 20.0, seed=5)
    return Flights([flown], VEHICLE)


def searched(flights, found_in, library):
    """Return a search of a library whose fit comes from a part of it."""
    search = Search(flights, found_in)
    fit, _ = find_effects(search)
    search.library = library
    return search, fit


def test_a_better_set_is_named_in_place_of_what_was_found(flights):
    search, fit = searched(flights, ("body_drag",), ("body_drag", "rotor_drag"))
    assert fit.effects == ["body_drag"]
    near = {name: 0.9 * value for name, value in DRAG.items()}
    found = with_proposal(search, fit, {"rotor_drag": near})
    assert found.effects == ["rotor_drag"]
    assert found.setting["rotor_drag"]["kdx"] == pytest.approx(DRAG["kdx"], rel=0.05)


def test_a_worse_set_and_one_outside_the_library_are_not(flights):
    search, fit = searched(flights, ("rotor_drag",), ("rotor_drag", "body_drag"))
    assert with_proposal(search, fit, {"body_drag": {"dx": 0.1, "dy": 0.1}}) is fit
    assert with_proposal(search, fit, {"mass": {"dm": 0.03}}) is fit
    assert with_proposal(search, fit, {"rotor_drag": {"kdx": 0.0, "kdy": 0.0}}) is fit
