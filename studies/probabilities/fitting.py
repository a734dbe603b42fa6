"""The weights of the pool, fitted to flights of which the truth is known."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from windwrench.identification.findings import Disturbance, Probabilities
from windwrench.identification.posterior.pooling import (
    POOLING,
    SIGNS,
    PoolingSettings,
    Signs,
    explanations,
    features,
    pooled,
)
from windwrench.identification.search_verdict import SMALL, beyond_calm
from windwrench.studies.scoring import EQUIVALENTS

Array = NDArray[np.float64]

_DECIMALS = 2  # of a weight
# what is known of the weights before the flights: mean and standard deviation
_BEFORE = ((0.5, 2.0, 0.0, -1.0), 1.0)
_SIGN_STD = 3.0
_STRUCTURE_STD = 0.2  # a nat
_LEAST = 1e-4  # no probability counts as less


@dataclass(frozen=True)
class Name:
    """A name of the search, from a record."""

    name: str
    tentative: bool
    indistinguishable_from: Sequence[str]


def names_of(flight: dict[str, Any]) -> list[Name]:
    """Return what the search named on a recorded flight."""
    return [Name(e["name"], e["tentative"], e["indistinguishable_from"]) for e in flight["named"]]


def acts_unknown(flight: Mapping[str, Any]) -> bool:
    """Return whether something acts which no effect of the library is that such a log can show."""
    return bool(flight["outsider"]) or _to_be_named(flight) != set(flight["truth"])


def _to_be_named(flight: Mapping[str, Any]) -> set[str]:
    """Return the effects that act, are in the library, and show in such a log."""
    return set(flight["truth"]) - {*flight["left_out"], *flight.get("hidden", ())}


def stands_for(flight: dict[str, Any], name: str) -> set[str]:
    """Return the effects that a name stands for: itself, what the flight cannot tell from it, and
    exact equivalents.
    """
    own: set[str] = {name}
    for e in flight["named"]:
        if e["name"] == name:
            own |= set(e["indistinguishable_from"])
    return own | {x for e in own for x in EQUIVALENTS.get(e, ())}


def is_right(flight: dict[str, Any], name: str) -> bool:
    """Return whether a name is right: its effect acts, and was there to be named."""
    return bool(stands_for(flight, name) & _to_be_named(flight))


def signs_of(flight: dict[str, Any]) -> Signs:
    """Return what speaks for something unknown on a recorded flight."""
    gusts = [Disturbance("", rms, time) for rms, time in flight["gusts"]]
    tests, doubts = set(flight["signs"]), set(flight["doubts"]) - {SMALL}
    beyond = beyond_calm(gusts, *flight["weight"])
    return Signs(len(tests), len(doubts), beyond, flight["structure"])


def pool(flight: dict[str, Any], weights: PoolingSettings = POOLING) -> Probabilities:
    """Return the probabilities of a recorded flight."""
    return pooled(names_of(flight), flight["sets"], signs_of(flight), weights)


def _right_sets(flight: dict[str, Any], keys: Sequence[frozenset[str]]) -> NDArray[np.bool_]:
    truth = set(flight["truth"])
    return np.array(
        [
            len(key) == len(truth)
            and all(any(t in stands_for(flight, e) for e in key) for t in truth)
            for key in keys
        ]
    )


def without_posterior(flight: Mapping[str, Any]) -> dict[str, Any]:
    """Return a recorded flight as if it had no posterior."""
    return {**flight, "sets": [], "structure": 0.0}


def fit(flights: Sequence[dict[str, Any]]) -> PoolingSettings:
    """Return the weights at maximum posterior: of sets by the flights on which nothing unknown
    acts, of the signs of something unknown by all.
    """
    known = []
    for flight in flights:
        if not acts_unknown(flight):
            found = explanations(names_of(flight), flight["sets"])
            known.append((features(names_of(flight), found), _right_sets(flight, list(found))))
    mean, std = np.array(_BEFORE[0]), _BEFORE[1]

    def loss_of_sets(w: Array) -> float:
        total = 0.5 * float(np.sum(np.square((w - mean) / std)))
        for x, right in known:
            score = x @ w
            share = np.exp(score - score.max())
            total -= float(np.log(max(share[right].sum() / share.sum(), _LEAST)))
        return total

    by_sets = minimize(
        loss_of_sets, mean, method="Nelder-Mead", options={"xatol": 1e-4, "fatol": 1e-6}
    ).x
    x = np.array([signs_of(f).numbers(names_of(f)) for f in flights])
    y = np.array([acts_unknown(f) for f in flights])
    scale = np.array([1e3, *[_SIGN_STD] * (len(SIGNS) - 2), _STRUCTURE_STD])

    def loss_of_signs(w: Array) -> float:
        odds = x @ w
        return float(
            np.sum(np.logaddexp(0.0, odds) - y * odds) + 0.5 * np.sum(np.square(w / scale))
        )

    by_signs = minimize(loss_of_signs, np.zeros(len(SIGNS))).x
    a, b = by_sets.round(_DECIMALS).tolist(), by_signs.round(_DECIMALS).tolist()
    return replace(
        POOLING,
        evidence=a[0],
        sure=a[1],
        tentative=a[2],
        other=a[3],
        **dict(zip(SIGNS, b, strict=True)),
    )
