"""What kept flights say of names, and the weights of signs that something unknown acts."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from windwrench.evidence.scoring import EQUIVALENTS
from windwrench.identification.diagnosis.unknown import clipped

Array = NDArray[np.float64]

_DECIMALS = 2  # of a weight
# of each fitted weight, before the flights
_WEIGHT_STD = (1e3, 3.0)


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


def right_set(flight: dict[str, Any]) -> bool:
    """Return whether the names are the effects that act, and no others."""
    names, truth = [e["name"] for e in flight["named"]], _to_be_named(flight)
    return len(names) == len(truth) and all(
        any(t in stands_for(flight, name) for name in names) for t in truth
    )


def _misled(flight: dict[str, Any]) -> bool:
    """Return whether a name that explains as much as is left is wrong: something is missing."""
    return any(e["worth"] >= 1.0 and not is_right(flight, e["name"]) for e in flight["named"])


def fit(flights: Sequence[dict[str, Any]]) -> list[float]:
    """Return the weights of no sign and of a push at maximum posterior; the Bayes factor counts as
    one.
    """
    kept = [flight["signs"] for flight in flights]
    x = np.array([(1.0, sign["push"]) for sign in kept])
    given = np.array([clipped(sign["structure"]) for sign in kept])
    y = np.array([acts_unknown(f) or _misled(f) for f in flights])
    scale = np.array(_WEIGHT_STD)

    def loss(w: Array) -> float:
        odds = given + x @ w
        return float(
            np.sum(np.logaddexp(0.0, odds) - y * odds) + 0.5 * np.sum(np.square(w / scale))
        )

    weights: list[float] = minimize(loss, np.zeros(len(scale))).x.round(_DECIMALS).tolist()
    return weights
