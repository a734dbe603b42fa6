"""Structure is what a model lacks, and a model that lacks nothing leaves none."""

import numpy as np
import pytest

from tests.identification.inference.test_search import flown
from tests.support.searches import DRAG, searched
from windwrench.identification.inference.residual_structure import (
    REGRESSOR,
    VARYING,
    find_structure,
    varying_coefficients,
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


@pytest.mark.parametrize("share", [1.0, 0.0])
def test_a_coefficient_that_comes_and_goes_is_not_constant(share):
    """Half of the blocks have the effect and half do not; or all have it."""
    search, fit = searched(flown(rotor_drag=DRAG), ["rotor_drag"], rotor_drag=DRAG)
    flights, whole = search.flights, search.flights.residual(fit.setting)
    part = flights.residual(fit.without("rotor_drag").setting) - whole
    gone = share * 0.5 * np.where(flights.block % 2, 1.0, -1.0)[:, None] * part
    regression = search.gram_at(fit)
    design = regression.design.copy()
    design[..., -1] += search.whiten(gone)[flights.fit_rows]
    regression = type(regression)(
        **{**vars(regression), "design": design, "blocks": regression.blocks}
    )
    signs = list(varying_coefficients(search, {"rotor_drag": part}, regression))
    assert [sign.kind for sign in signs] == ([VARYING] if share else [])
