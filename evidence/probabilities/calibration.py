"""What the probabilities of recorded flights are worth: calibration, log score, and the coverage of
coefficients' intervals.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from windwrench.evidence.kept_results import kept
from windwrench.evidence.probabilities.fitting import (
    acts_unknown,
    is_right,
    right_set,
    stands_for,
)
from windwrench.evidence.scoring import area_under_curve, share

RESULTS = {  # kept flights, below docs/
    "first": "probabilities/results.json.gz",
    "later": "probabilities/later.json.gz",
    "other logs": "probabilities/other-logs.json.gz",
    "latest": "probabilities/latest.json.gz",
}
TITLES = {
    "no pose": "an IMU alone",
    "position at 10 Hz": "an IMU, and ten positions a second",
    "filtered": "a pose filtered before it was written",
}
EDGES = (0.05, 0.2, 0.5, 0.8, 0.95, 1.0001)  # of the reliability diagram; below, nothing is said
_CERTAIN = 1e-3  # no probability counts as less than this in the log score
_RESAMPLED = 2000
Claim = tuple[float, bool]


Flight = dict[str, Any]


def claims_of_one(flight: Flight) -> list[Claim]:
    """Return the probability of each name, and whether it is right."""
    return [(e["probability"], is_right(flight, e["name"])) for e in flight["named"]]


def log_score(flight: Flight) -> float:
    """Return the sum of logarithms of the probabilities of what is true, over names and effects
    that act and that are not named.
    """
    claimed = {x for e in flight["named"] for x in stands_for(flight, e["name"])}
    missed = set(flight["truth"]) - set(flight["left_out"]) - claimed
    total = len(missed) * math.log(_CERTAIN)
    for p, right in claims_of_one(flight):
        q = min(max(p, _CERTAIN), 1.0 - _CERTAIN)
        total += math.log(q if right else 1.0 - q)
    return total


def flights_of(records: Sequence[Mapping[str, Any]], **task: Any) -> list[Flight]:
    """Return the flights of records that were not refused; of one simulator, or one way to log."""
    return [
        r["result"]
        for r in records
        if "refused" not in r["result"]
        and task.get("simulator", r["task"][0]) == r["task"][0]
        and task.get("way", r["task"][-1]) == r["task"][-1]
    ]


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


def error_of_perfect_calibration(claims: Sequence[Claim]) -> float:
    """Return the expected calibration error that these probabilities would have in the mean if each
    were right as often as it says.
    """
    rng = np.random.default_rng(1)
    p = np.array([x for x, _ in claims])
    return float(
        np.mean(
            [
                expected_calibration_error(
                    list(zip(p.tolist(), (rng.random(len(p)) < p).tolist(), strict=True))
                )
                for _ in range(_RESAMPLED)
            ]
        )
    )


def mean_and_interval(values: Sequence[float]) -> str:
    """Return a mean and its 95 % interval, over values drawn anew."""
    x = np.array(values)
    rng = np.random.default_rng(2)
    drawn = x[rng.integers(len(x), size=(_RESAMPLED, len(x)))].mean(axis=1)
    low, high = np.quantile(drawn, [0.025, 0.975])
    return f"{x.mean():.2f} ({low:.2f} to {high:.2f})"


def reliability(flights: Sequence[Flight]) -> list[dict[str, Any]]:
    """Return rows of the reliability diagram: probability, its mean, and how often it is right."""
    rows: list[dict[str, Any]] = []
    claims = claims_of(flights)
    for low, high in itertools.pairwise((0.0, *EDGES)):
        inside = [x for x in claims if low <= x[0] < high]
        right = share(sum(right for _, right in inside), len(inside)) if inside else "–"
        rows.append({"from": low, "to": min(high, 1.0), "right": right})
    return rows


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


def summary(title: str, flights: Sequence[Flight]) -> dict[str, Any]:
    """Return what names and probabilities of flights are worth, as a row of a table."""
    claims = claims_of(flights)
    known = [x for x in flights if not acts_unknown(x)]
    return {
        "title": title,
        "flights": len(flights),
        "unknown": len(flights) - len(known),
        "right": share(sum(map(right_set, known)), len(known)),
        "sure": _sure(flights),
        "error": expected_calibration_error(claims),
        "error_ci95": calibration_interval(flights),
        "error_of_perfect": error_of_perfect_calibration(claims),
        "log_score": mean_and_interval([log_score(x) for x in flights]),
        "area": area(flights),
    }


def _sure(flights: Sequence[Flight]) -> str:
    sure = [(e, x) for x in flights for e in x["named"] if not e["tentative"]]
    return share(sum(is_right(x, e["name"]) for e, x in sure), len(sure))


def counts(flights: Sequence[Flight]) -> dict[str, str]:
    """Return counts with their intervals: names that are sure, names where nothing is missing or
    something unknown acts, and the coverage of coefficients' intervals.
    """
    known = [x for x in flights if not acts_unknown(x)]
    nothing = [x for x in known if not x["truth"]]
    strange = [x for x in flights if acts_unknown(x)]

    def sure(some: Sequence[Flight]) -> str:
        return share(sum(any(not e["tentative"] for e in x["named"]) for x in some), len(some))

    out = {
        "names that are sure, and right": _sure(flights),
        "nothing missing, yet a sure name": sure(nothing),
        "outsiders and left-out effects, yet a sure name": sure(strange),
    }
    errors = errors_of_coefficients(flights)
    for level, most in ((68, 0.9945), (95, 1.96)):
        count = share(sum(e < most for e in errors), len(errors))
        out[f"coverage of {level} % intervals of coefficients"] = count
    return out


def shown() -> dict[str, Any]:
    """Return what the page shows of the kept results."""
    records, later = kept(RESULTS["first"]), kept(RESULTS["later"])
    others, latest = kept(RESULTS["other logs"]), flights_of(kept(RESULTS["latest"]))
    earlier, after = flights_of(records), flights_of(later)
    rows = [
        summary("this project's plant", flights_of(records, simulator="own")),
        summary("the other simulator", flights_of(records, simulator="other")),
        summary("both, later", after),
        summary("both, latest", latest),
        *(summary(title, flights_of(others, way=way)) for way, title in TITLES.items()),
    ]
    return {
        "rows": rows,
        "counts": {"earlier": counts(earlier), "later": counts(after), "latest": counts(latest)},
        "reliability": {
            "earlier": reliability(earlier),
            "later": reliability(after),
            "latest": reliability(latest),
        },
    }
