"""What the probabilities of recorded flights are worth: calibration, log score, and the coverage of
coefficients' intervals.

Flights are halved by their numbers, ten by ten, so that either half has all kinds. Each is scored
with weights that were fitted to the other: no flight is scored with weights that know it.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from windwrench.identification.findings import Probabilities
from windwrench.identification.posterior.pooling import SEARCH_ALONE, PoolingSettings
from windwrench.identification.search_verdict import SEARCH_VERDICT
from windwrench.studies.kept_results import kept
from windwrench.studies.probabilities.fitting import (
    acts_unknown,
    fit,
    is_right,
    pool,
    stands_for,
    without_posterior,
)
from windwrench.studies.scoring import area_under_curve, share

RESULTS = {  # kept flights, below docs/
    "first": "probabilities/results.json.gz",
    "later": "probabilities/later.json.gz",
    "other logs": "probabilities/other-logs.json.gz",
}
TITLES = {
    "pose": "a pose, without its posterior",
    "no pose": "an IMU alone",
    "position at 10 Hz": "an IMU, and ten positions a second",
    "filtered": "a pose filtered before it was written",
}
EDGES = (0.05, 0.2, 0.5, 0.8, 0.95, 1.0001)  # of the reliability diagram; below, nothing is said
_CERTAIN = 1e-3  # no probability counts as less than this in the log score
_RESAMPLED = 2000
Claim = tuple[float, bool]


@dataclass(frozen=True)
class Scored:
    """A recorded flight and its probabilities by one way."""

    own: bool
    flight: dict[str, Any]
    found: Probabilities

    def claims(self) -> list[Claim]:
        """Return the probability of each name, and whether it is right: of what the search names,
        and of each other effect from the least probability that is shown.
        """
        named = {e["name"] for e in self.flight["named"]}
        return [
            (p, is_right(self.flight, e))
            for e, p in self.found.names.items()
            if e in named or p >= EDGES[0]
        ]

    def log_score(self) -> float:
        """Return the sum of logarithms of the probabilities of what is true, over claims and
        effects that act and that nobody claims.
        """
        claims = self.claims()
        shown = [e for e, p in self.found.names.items() if p >= EDGES[0]]
        shown += [e["name"] for e in self.flight["named"]]
        claimed = {x for e in shown for x in stands_for(self.flight, e)}
        missed = set(self.flight["truth"]) - set(self.flight["left_out"]) - claimed
        claims += [
            (sum(self.found.names.get(x, 0.0) for x in stands_for(self.flight, e)), True)
            for e in missed
        ]
        total = 0.0
        for p, right in claims:
            q = min(max(p, _CERTAIN), 1.0 - _CERTAIN)
            total += math.log(q if right else 1.0 - q)
        return total


def half_of(record: Mapping[str, Any]) -> int:
    """Return in which half a record is: ten numbers in a row have all kinds of flights."""
    return int(record["task"][2]) // 10 % 2


def _halves(records: Sequence[Mapping[str, Any]]) -> list[list[dict[str, Any]]]:
    """Return the flights of either half."""
    return [[r["result"] for r in records if half_of(r) == half] for half in (0, 1)]


def cross_fitted(records: Sequence[Mapping[str, Any]]) -> list[Scored]:
    """Return the flights with pooled probabilities, none by weights that know it."""
    weights = [fit(half) for half in reversed(_halves(records))]
    return [
        Scored(r["task"][0] == "own", r["result"], pool(r["result"], weights[half_of(r)]))
        for r in records
    ]


def expected_calibration_error(claims: Sequence[Claim]) -> float:
    """Return the mean distance of stated probability and share that is right, over bins."""
    total = 0.0
    for low, high in itertools.pairwise(EDGES):
        inside = [x for x in claims if low <= x[0] < high]
        if inside:
            total += abs(sum(p - right for p, right in inside))
    return total / max(len(claims), 1)


def claims_of(flights: Sequence[Scored]) -> list[Claim]:
    """Return the claims of all flights."""
    return [claim for flight in flights for claim in flight.claims()]


def calibration_interval(flights: Sequence[Scored]) -> tuple[float, float]:
    """Return the 95 % interval of the expected calibration error, over flights drawn anew."""
    rng = np.random.default_rng(0)
    claims = [flight.claims() for flight in flights]
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


def reliability(flights: Sequence[Scored]) -> list[dict[str, Any]]:
    """Return rows of the reliability diagram: probability, its mean, and how often it is right."""
    rows: list[dict[str, Any]] = []
    claims = claims_of(flights)
    for low, high in itertools.pairwise((0.0, *EDGES)):
        inside = [x for x in claims if low <= x[0] < high]
        if inside:
            row = {
                "from": low,
                "to": min(high, 1.0),
                "mean": float(np.mean([p for p, _ in inside])),
            }
            rows.append(row | {"right": share(sum(right for _, right in inside), len(inside))})
    return rows


def area(flights: Sequence[Scored]) -> str:
    """Return the area under the curve of ``unknown``, with the counts of flights."""
    strange = [x.found.unknown for x in flights if acts_unknown(x.flight)]
    known = [x.found.unknown for x in flights if not acts_unknown(x.flight)]
    return area_under_curve(strange, known)


def errors_of_coefficients(flights: Sequence[Scored]) -> list[float]:
    """Return errors of coefficients in stated standard deviations, of right names whose truth is
    known.
    """
    out = []
    for x in flights:
        for e in x.flight["named"]:
            for name, value in x.flight["truth"].get(e["name"], {}).items():
                std = e["std"].get(name) or 0.0
                if std > 0.0 and not acts_unknown(x.flight):
                    out.append(abs(e["coefficients"][name] - value) / std)
    return out


def summary(title: str, flights: Sequence[Scored]) -> dict[str, Any]:
    """Return what names and probabilities of flights are worth, as a row of a table."""
    claims = claims_of(flights)
    sure = [(e, x) for x in flights for e in x.flight["named"] if not e["tentative"]]
    return {
        "title": title,
        "flights": len(flights),
        "unknown": sum(acts_unknown(x.flight) for x in flights),
        "sure": share(sum(is_right(x.flight, e["name"]) for e, x in sure), len(sure)),
        "error": expected_calibration_error(claims),
        "error_ci95": calibration_interval(flights),
        "error_of_perfect": error_of_perfect_calibration(claims),
        "log_score": mean_and_interval([x.log_score() for x in flights]),
        "area": area(flights),
    }


def counts(flights: Sequence[Scored]) -> dict[str, str]:
    """Return counts with their intervals: names that are sure by their probability, names where
    nothing is missing or something unknown acts, and the coverage of coefficients' intervals.
    """
    known = [x for x in flights if not acts_unknown(x.flight)]
    nothing = [x for x in known if not x.flight["truth"]]
    strange = [x for x in flights if acts_unknown(x.flight)]
    least = SEARCH_VERDICT.least_sure_probability
    sure = [
        (e, x)
        for x in flights
        for e in x.flight["named"]
        if not e["tentative"] and min(x.found.names[n["name"]] for n in x.flight["named"]) >= least
    ]

    def above(some: Sequence[Scored], least: float) -> str:
        return share(sum(any(p >= least for p in x.found.names.values()) for x in some), len(some))

    out = {
        "names that are sure, and right": share(
            sum(is_right(x.flight, e["name"]) for e, x in sure), len(sure)
        ),
        "nothing missing, yet a name of 0.5 and more": above(nothing, 0.5),
        "outsiders and left-out effects, yet a name of 0.5 and more": above(strange, 0.5),
        "outsiders and left-out effects, yet a name of 0.95 and more": above(strange, 0.95),
    }
    errors = errors_of_coefficients(flights)
    for level, most in ((68, 0.9945), (95, 1.96)):
        count = share(sum(e < most for e in errors), len(errors))
        out[f"coverage of {level} % intervals of coefficients"] = count
    return out


def without_posteriors(
    records: Sequence[Mapping[str, Any]], poses: Sequence[Mapping[str, Any]]
) -> dict[str, list[Mapping[str, Any]]]:
    """Return records without a posterior by the keys of ``SEARCH_ALONE``; refused flights are left
    out.

    Args:
        records: of logs of other kinds, whose task ends with the way to log.
        poses: of flights whose pose is logged as measured.
    """
    out: dict[str, list[Mapping[str, Any]]] = {kind: [] for kind in SEARCH_ALONE}
    for record in (*({**r, "task": [*r["task"], "pose"]} for r in poses), *records):
        way = record["task"][3]
        if "refused" not in record["result"]:
            found = {**record, "result": without_posterior(record["result"])}
            out[way if way in SEARCH_ALONE else "imu"].append(found)
    return out


def weights_without_posterior(
    records: Sequence[Mapping[str, Any]], poses: Sequence[Mapping[str, Any]]
) -> dict[str, PoolingSettings]:
    """Return what ``SEARCH_ALONE`` should be by these flights; arguments as of
    ``without_posteriors``.
    """
    found = {
        kind: fit([r["result"] for r in some])
        for kind, some in without_posteriors(records, poses).items()
    }
    return {k: replace(x, evidence=0.0, other=0.0, structure=0.0) for k, x in found.items()}


def shown() -> dict[str, Any]:
    """Return what the page shows of the kept results."""
    records, later = kept(RESULTS["first"]), kept(RESULTS["later"])
    others = kept(RESULTS["other logs"])
    fitted = cross_fitted(records)
    after = [Scored(r["task"][0] == "own", r["result"], pool(r["result"])) for r in later]
    rows = [
        summary("this project's plant", [x for x in fitted if x.own]),
        summary("the other simulator", [x for x in fitted if not x.own]),
        summary("both, later, with the weights in use", after),
    ]
    for some in without_posteriors(others, records).values():
        scored = cross_fitted(some)
        ways = [record["task"][3] for record in some]
        for way in dict.fromkeys(ways):
            mine = [x for x, own in zip(scored, ways, strict=True) if own == way]
            rows.append(summary(TITLES[way], mine))
    return {
        "rows": rows,
        "counts": {"earlier": counts(fitted), "later": counts(after)},
        "reliability": {"earlier": reliability(fitted), "later": reliability(after)},
    }
