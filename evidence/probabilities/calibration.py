"""What the probabilities of recorded flights are worth: calibration, and the coverage of
coefficients' intervals.
"""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from windwrench.evidence.probabilities.fitting import (
    acts_unknown,
    is_right,
    right_set,
)
from windwrench.evidence.scoring import area_under_curve, share

RESULTS = "results/probabilities.json.gz"  # below docs/
EDGES = (0.05, 0.2, 0.5, 0.8, 0.95, 1.0001)  # of the reliability diagram; below, nothing is said
_RESAMPLED = 2000
Claim = tuple[float, bool]


Flight = dict[str, Any]


def claims_of_one(flight: Flight) -> list[Claim]:
    """Return the probability of each name, and whether it is right."""
    return [(e["probability"], is_right(flight, e["name"])) for e in flight["named"]]


def flights_of(records: Sequence[Mapping[str, Any]]) -> list[Flight]:
    """Return the flights of records that were not refused."""
    return [r["result"] for r in records if "refused" not in r["result"]]


def expected_calibration_error(claims: Sequence[Claim]) -> float:
    """Return the mean distance of stated probability and share that is right, over bins."""
    total = 0.0
    for low, high in itertools.pairwise(EDGES):
        inside = [x for x in claims if low <= x[0] < high]
        if inside:
            total += abs(sum(p - right for p, right in inside))
    return total / max(len(claims), 1)


def claims_of(flights: Sequence[Flight]) -> list[Claim]:
    """Return the claims of all flights."""
    return [claim for flight in flights for claim in claims_of_one(flight)]


def calibration_interval(flights: Sequence[Flight]) -> tuple[float, float]:
    """Return the 95 % interval of the expected calibration error, over flights drawn anew."""
    rng = np.random.default_rng(0)
    claims = [claims_of_one(flight) for flight in flights]
    drawn = [
        expected_calibration_error(
            [c for i in rng.integers(len(claims), size=len(claims)) for c in claims[i]]
        )
        for _ in range(_RESAMPLED)
    ]
    low, high = np.quantile(drawn, [0.025, 0.975]).tolist()
    return float(low), float(high)


def area(flights: Sequence[Flight]) -> str:
    """Return the area under the curve of ``unknown``, with the counts of flights."""
    strange = [x["unknown"] for x in flights if acts_unknown(x)]
    known = [x["unknown"] for x in flights if not acts_unknown(x)]
    return area_under_curve(strange, known)


def errors_of_coefficients(flights: Sequence[Flight]) -> list[float]:
    """Return errors of coefficients in stated standard deviations, of right names whose truth is
    known.
    """
    out = []
    for x in flights:
        for e in x["named"]:
            for name, value in x["truth"].get(e["name"], {}).items():
                std = e["std"].get(name) or 0.0
                if std > 0.0 and not acts_unknown(x):
                    out.append(abs(e["coefficients"][name] - value) / std)
    return out


def figures(flights: Sequence[Flight]) -> dict[str, tuple[str, ...]]:
    """Return counts with their intervals, some with what they should be: right and sure names,
    coverage of the intervals of coefficients, calibration, and what ``unknown`` tells apart.
    """
    known = [x for x in flights if not acts_unknown(x)]
    sure = [(e, x) for x in flights for e in x["named"] if not e["tentative"]]
    errors = errors_of_coefficients(flights)
    low, high = calibration_interval(flights)

    def named(some: Sequence[Flight]) -> str:
        return share(sum(any(not e["tentative"] for e in x["named"]) for x in some), len(some))

    def held(most: float) -> str:
        return share(sum(e < most for e in errors), len(errors))

    return {
        "all effects named, no other": (share(sum(map(right_set, known)), len(known)),),
        "sure names right": (
            share(sum(is_right(x, e["name"]) for e, x in sure), len(sure)),
            "95 %",
        ),
        "a sure name, nothing missing": (named([x for x in known if not x["truth"]]),),
        "a sure name, unknown cause": (named([x for x in flights if acts_unknown(x)]),),
        "68 and 95 % intervals of coefficients hold": (f"{held(0.9945)}; {held(1.96)}",),
        "calibration error of names": (
            f"{expected_calibration_error(claims_of(flights)):.3f} ({low:.3f}–{high:.3f})",
            "0",
        ),
        "`unknown` higher at an unknown cause": (area(flights), "chance 0.5"),
    }
