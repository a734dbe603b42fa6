"""What search and posterior say together, on made-up findings."""

from dataclasses import dataclass, replace

import pytest

from windwrench.identification.posterior.pooling import (
    POOLING,
    Signs,
    pooled,
)


@dataclass(frozen=True)
class Name:
    name: str
    tentative: bool = False
    indistinguishable_from: tuple[str, ...] = ()


BOTH = [(("mass",), 0.9), (("mass", "inertia"), 0.1)]
LOUD = Signs(1, 1, 3.0, 15.0)


def test_probabilities_of_all_explanations_make_one():
    found = pooled([Name("mass")], BOTH, LOUD, replace(POOLING, least=0.0))
    assert sum(x.probability for x in found.alternatives) + found.unknown == pytest.approx(1.0)
    of_mass = [x.probability for x in found.alternatives if "mass" in x.effects]
    assert found.names["mass"] == pytest.approx(sum(of_mass))
    order = [x.probability for x in found.alternatives]
    assert order == sorted(order, reverse=True)
