"""Structure is what a model lacks, and a model that lacks nothing leaves none."""

from tests.identification.inference.test_search import flown
from tests.support.searches import DRAG, searched
from windwrench.identification.inference.residual_structure import (
    REGRESSOR,
    find_structure,
)


def test_the_true_model_leaves_none():
    search, fit = searched(flown(rotor_drag=DRAG), ["rotor_drag", "mass"], rotor_drag=DRAG)
    assert find_structure(search, fit) == ([], False)


def test_what_is_lacking_shows_in_what_it_follows():
    search, fit = searched(flown(rotor_drag=DRAG), ["mass"])
    signs, seemed = find_structure(search, fit)
    assert seemed
    assert {sign.kind for sign in signs} == {REGRESSOR}
    assert any("velocity" in sign.where for sign in signs)
    gains = [sign.gain for sign in signs]
    assert gains == sorted(gains, reverse=True)
