"""What search and posterior say together, on made-up findings."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from windwrench.identification.posterior.pooling import POOLING, explanations, pooled, signs


@dataclass(frozen=True)
class Name:
    name: str
    tentative: bool = False
    indistinguishable_from: tuple[str, ...] = ()


BOTH = [(("mass",), 0.9), (("mass", "inertia"), 0.1)]


def test_what_both_say_is_likelier_than_what_one_says():
    agreed = pooled([Name("mass")], "none", BOTH, -1.0, 0.0)
    doubted = pooled([Name("mass", tentative=True)], "none", BOTH, -1.0, 0.0)
    contradicted = pooled([Name("mass")], "none", [(("latency",), 1.0)], -1.0, 0.0)
    assert agreed.names["mass"] > 0.9
    assert agreed.names["mass"] > doubted.names["mass"] > contradicted.names["mass"]
    assert contradicted.names["latency"] < 0.9


def test_probabilities_of_all_explanations_make_one():
    found = pooled([Name("mass")], "structured", BOTH, 4.0, 0.0, replace(POOLING, least=0.0))
    assert sum(x.probability for x in found.alternatives) + found.unknown == pytest.approx(1.0)
    of_mass = [x.probability for x in found.alternatives if "mass" in x.effects]
    assert found.names["mass"] == pytest.approx(sum(of_mass))
    order = [x.probability for x in found.alternatives]
    assert order == sorted(order, reverse=True)


def test_what_flights_cannot_tell_apart_shares_its_probability():
    alone = [(("latency",), 0.5), (("clock_offset",), 0.5)]
    found = explanations([Name("latency", indistinguishable_from=("clock_offset",))], alone)
    assert found[frozenset(["latency"])] == 0.0
    assert frozenset(["clock_offset"]) not in found


def test_two_names_of_one_class_stay_two():
    names = [Name("mass", indistinguishable_from=("inertia",)), Name("inertia")]
    found = explanations(names, [(("mass", "inertia"), 1.0)])
    assert found[frozenset(["mass", "inertia"])] == 0.0


def test_what_the_posterior_never_tried_is_as_bad_as_can_be():
    found = explanations([Name("wind"), Name("rotor_drag")], [(("rotor_drag",), 1.0)])
    assert found[frozenset(["wind", "rotor_drag"])] == pytest.approx(-POOLING.most_worse)
    assert found[frozenset()] == pytest.approx(-POOLING.most_worse)


def test_structure_makes_something_unknown_likelier():
    quiet, loud = (
        pooled([Name("mass")], r, BOTH, s, 0.0) for r, s in (("none", 0.0), ("structured", 20.0))
    )
    assert quiet.unknown < 0.2 < 0.5 < loud.unknown
    assert loud.names["mass"] < quiet.names["mass"]
    np.testing.assert_allclose(
        signs([Name("mass")], "random", 99.0, -99.0), [1, 0, 1, 0, 0, *POOLING.nats_range[::-1]]
    )


def test_nothing_found_is_an_explanation_too():
    found = pooled([], "none", [((), 1.0)], -2.0, 0.0)
    assert found.alternatives[0].effects == ()
    assert found.names == {}
    assert found.unknown + found.alternatives[0].probability == pytest.approx(1.0)
