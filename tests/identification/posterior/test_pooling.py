"""What search and posterior say together, on made-up findings."""

from dataclasses import dataclass, replace

import pytest

from windwrench.identification.posterior.pooling import (
    POOLING,
    SEARCH_ALONE,
    Signs,
    explanations,
    pooled,
)


@dataclass(frozen=True)
class Name:
    name: str
    tentative: bool = False
    indistinguishable_from: tuple[str, ...] = ()


BOTH = [(("mass",), 0.9), (("mass", "inertia"), 0.1)]
CALM, LOUD = Signs(0, 0, -1.0, -1.0), Signs(1, 1, 3.0, 15.0)


def test_what_both_say_is_likelier_than_what_one_says():
    agreed = pooled([Name("mass")], BOTH, CALM)
    doubted = pooled([Name("mass", tentative=True)], BOTH, CALM)
    contradicted = pooled([Name("mass")], [(("latency",), 1.0)], CALM)
    assert agreed.names["mass"] > 0.9
    assert agreed.names["mass"] > max(doubted.names["mass"], contradicted.names["mass"])
    assert contradicted.names["latency"] < 0.9


def test_probabilities_of_all_explanations_make_one():
    found = pooled([Name("mass")], BOTH, LOUD, replace(POOLING, least=0.0))
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


def test_what_the_posterior_never_tried_is_as_bad_as_can_be():
    found = explanations([Name("wind"), Name("rotor_drag")], [(("rotor_drag",), 1.0)])
    assert found[frozenset(["wind", "rotor_drag"])] == pytest.approx(-POOLING.most_worse)
    assert found[frozenset()] == pytest.approx(-POOLING.most_worse)


def test_a_check_that_doubts_makes_something_unknown_likelier():
    signs = [(0, 0), (1, 0), (2, 0), (0, 1)]
    found = [
        pooled([Name("mass", tentative=any(n))], BOTH, Signs(*n, -1.0, -1.0)).unknown for n in signs
    ]
    assert found == sorted(found)
    assert found[0] < 0.05 < 0.2 < found[1] < 0.5 < found[3]


@pytest.mark.parametrize("kind", SEARCH_ALONE)
def test_without_a_posterior_what_is_named_and_its_parts_explain(kind):
    names = [Name("mass"), Name("wind", tentative=True)]
    found = pooled(names, [], CALM, replace(SEARCH_ALONE[kind], least=0.0))
    parts = {x.effects for x in found.alternatives}
    assert parts == {(), ("mass",), ("wind",), ("mass", "wind")}
    assert sum(x.probability for x in found.alternatives) + found.unknown == pytest.approx(1.0)
    assert found.names["mass"] > found.names["wind"]
    doubted = pooled(names, [], LOUD, SEARCH_ALONE[kind])
    assert doubted.unknown > found.unknown
