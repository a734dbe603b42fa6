"""What effects declare: the words that there are, what a role promises, and laws that need starting
points.
"""

from dataclasses import replace

import pytest

from tests.support.own_effects import HOSE, joined
from windwrench.dynamics import InputError, load_vehicle
from windwrench.dynamics.effects import (
    Family,
    Need,
    Role,
    get,
    names,
    needing,
    of_family,
    playing,
)
from windwrench.dynamics.effects.declaration import Found
from windwrench.dynamics.effects.vanishing import does_nothing_alone


def test_effects_are_looked_up_by_what_they_declare():
    assert replace(get("mass"), role="mass").role == Role.MASS
    assert playing(Role.LAG, Role.MASS) == (*playing(Role.LAG), *playing(Role.MASS))
    assert playing(Role.MASS, among=["wind"]) == ()
    for family in Family:
        assert all(get(name).family == family for name in of_family(family))
    assert sum(len(of_family(family)) for family in Family) == len(names())
    assert needing(Need.FAST_MOTION) < needing(Need.FINE_ROTOR_SPEEDS)
    assert needing(Need.FAST_MOTION, Need.MOMENTS) == needing(Need.FAST_MOTION) | needing(
        Need.MOMENTS
    )


@pytest.mark.parametrize("name", names())
def test_an_effect_does_something_one_by_one_or_says_where_to_start(name):
    assert not does_nothing_alone(get(name)) or get(name).starting_points is not None


def test_a_law_that_does_nothing_one_by_one_must_say_where_to_start(tmp_path):
    (tmp_path / "hose.py").write_text(HOSE)
    starts = "starting_points=lambda flights: [{'a': 0.2, 'w': 3.0}]"
    started = HOSE.replace("# more", starts).replace('"hose"', '"told_hose"')
    (tmp_path / "told_hose.py").write_text(started)
    with joined(tmp_path):
        with pytest.raises(InputError, match=r"hose\.py: effect hose: .*add starting_points="):
            get("hose")
        assert get("told_hose").starting_points is not None


def test_joint_bounds_are_those_of_physics():
    vehicle, load = load_vehicle("ardrone2"), get("slung_payload")
    assert load.possible({"m": 0.03, "l": 0.3, "damping": 1.0}, vehicle)
    assert not load.possible({"m": 0.03, "l": 0.3, "damping": 5.0}, vehicle)

    def asked(name, beside=(), **found):
        typical = {c.name: c.typical[0] for c in get(name).coefficients}
        return get(name).implausible(Found(found, {}, typical, 1.0, frozenset(beside)))

    assert "hardly any drag" in asked("wind", wx=6.0, cd=1e-3)
    assert not asked("wind", [Family.DRAG], wx=6.0, cd=1e-3)
    assert "z alone" in asked("rate_damping", dx=0.0, dy=0.0, dz=1e-3)
    assert not asked("rate_damping", dx=1e-3, dy=1e-3, dz=1e-3)
    assert "some axes" in asked("body_drag", dx=0.0, dy=0.05, dz=0.1)
    assert not asked("body_drag", dx=0.05, dy=0.05, dz=0.1)
