"""What the probabilities of recorded flights are worth: calibration, log score, and the coverage of
coefficients' intervals.

Flights are halved by their numbers, ten by ten, so that either half has all kinds. Each is scored
with weights that were fitted to the other: no flight is scored with weights that know it.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from windwrench.identification.diagnosis import DIAGNOSIS
from windwrench.identification.findings import Alternative, Probabilities
from windwrench.identification.posterior.deviations import without_other_estimate
from windwrench.identification.posterior.pooling import POOLING, SIGNS
from windwrench.studies.page_tables import area_under_curve, share, table
from windwrench.studies.probabilities.doubts import table_of_doubts
from windwrench.studies.probabilities.fitting import (
    acts_unknown,
    fit,
    frequencies,
    is_right,
    pool,
    stands_for,
)

EDGES = (0.05, 0.2, 0.5, 0.8, 0.95, 1.0001)  # of the reliability diagram; below, nothing is said
_CERTAIN = 1e-3  # no probability counts as less than this in the log score
_RESAMPLED = 2000
_MUCH = 3.0  # nats, a dictionary's
Claim = tuple[float, bool]
WAYS = ("pooled", "search alone", "posterior alone")


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


def scored(records: Sequence[Mapping[str, Any]]) -> dict[str, list[Scored]]:
    """Return the flights with the probabilities of each way, none by weights that know it.

    Args:
        records: ``{"task": [simulator, kind, number], "result": ...}`` each.
    """
    shares = [frequencies(half) for half in reversed(_halves(records))]
    out: dict[str, list[Scored]] = {way: [] for way in WAYS}
    out[WAYS[0]] = cross_fitted(records)
    for record in records:
        own, flight = record["task"][0] == "own", record["result"]
        out[WAYS[1]].append(Scored(own, flight, _by_frequency(flight, shares[half_of(record)])))
        out[WAYS[2]].append(Scored(own, flight, _by_posterior(flight)))
    return out


def _by_frequency(flight: Mapping[str, Any], right: Mapping[bool, float]) -> Probabilities:
    names = {e["name"]: right[e["tentative"]] for e in flight["named"]}
    return Probabilities(names, (), float(flight["remainder"] == "structured"))


def _by_posterior(flight: Mapping[str, Any]) -> Probabilities:
    names: dict[str, float] = {}
    for effects, p in flight["sets"]:
        for e in effects:
            names[e] = names.get(e, 0.0) + p
    sets = tuple(Alternative(tuple(e), p) for e, p in flight["sets"])
    odds = 1.0 / (1.0 + math.exp(-max(min(flight["structure"], 30.0), -30.0)))
    return Probabilities(names, sets, odds)


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


def reliability(flights: Sequence[Scored]) -> list[list[str]]:
    """Return rows of the reliability diagram: probability, its mean, and how often it is right."""
    rows = []
    claims = claims_of(flights)
    for low, high in itertools.pairwise((0.0, *EDGES)):
        inside = [x for x in claims if low <= x[0] < high]
        if inside:
            mean = float(np.mean([p for p, _ in inside]))
            right = share(sum(right for _, right in inside), len(inside))
            rows.append([f"{low:g} to {min(high, 1.0):g}", f"{mean:.3f}", right])
    return rows


def area(flights: Sequence[Scored]) -> str:
    """Return the area under the curve of ``unknown``, with the counts of flights."""
    strange = [x.found.unknown for x in flights if acts_unknown(x.flight)]
    known = [x.found.unknown for x in flights if not acts_unknown(x.flight)]
    return area_under_curve(strange, known)


def _coverage(flights: Sequence[Scored], both: bool) -> list[float]:
    """Return errors of coefficients in stated standard deviations, of right names whose truth is
    known; ``both``: of the two estimates, else of the search alone.
    """
    out = []
    for x in flights:
        for e in x.flight["named"]:
            for name, value in x.flight["truth"].get(e["name"], {}).items():
                std = e["std"].get(name) or 0.0
                if std > 0.0 and not acts_unknown(x.flight):
                    own = e["coefficients"][name]
                    other = x.flight["fitted"].get(e["name"], {}).get(name, own)
                    if not both:
                        std = without_other_estimate(std, own, other)
                    out.append(abs(own - value) / std)
    return out


def _comparison(every: Mapping[str, Sequence[Scored]]) -> str:
    rows = []
    for way, flights in every.items():
        claims = claims_of(flights)
        low, high = calibration_interval(flights)
        rows.append(
            [
                way,
                f"{expected_calibration_error(claims):.3f} ({low:.3f} to {high:.3f})",
                f"{error_of_perfect_calibration(claims):.3f}",
                mean_and_interval([x.log_score() for x in flights]),
                area(flights),
                str(len(claims)),
            ]
        )
    return table(
        [
            "probabilities",
            "expected calibration error of names (95 %)",
            "of a perfect forecaster of as many",
            "log score a flight (95 %)",
            "area under the curve of `unknown`",
            "names",
        ],
        rows,
    )


def _counts(flights: Sequence[Scored]) -> str:
    known = [x for x in flights if not acts_unknown(x.flight)]
    nothing = [x for x in known if not x.flight["truth"]]
    strange = [x for x in flights if acts_unknown(x.flight)]
    sure = [(e, x) for x in flights for e in x.flight["named"] if not e["tentative"]]
    stated = [
        (e, x)
        for e, x in sure
        if min(x.found.names[n["name"]] for n in x.flight["named"])
        >= DIAGNOSIS.least_sure_probability
    ]

    def above(some: Sequence[Scored], least: float) -> str:
        return share(sum(any(p >= least for p in x.found.names.values()) for x in some), len(some))

    rows = [
        ["flights", str(len(flights))],
        [
            "names that are sure, and right",
            share(sum(is_right(x.flight, e["name"]) for e, x in stated), len(stated)),
        ],
        [
            "... by the checks of the search alone",
            share(sum(is_right(x.flight, e["name"]) for e, x in sure), len(sure)),
        ],
        [
            f"dictionary worth more than {_MUCH:g} nats, nothing unknown",
            share(sum(x.flight["structure"] > _MUCH for x in known), len(known)),
        ],
        [
            "... outsiders and left-out effects",
            share(sum(x.flight["structure"] > _MUCH for x in strange), len(strange)),
        ],
        ["nothing missing, yet a name of 0.5 and more", above(nothing, 0.5)],
        ["outsiders and left-out effects, yet a name of 0.5 and more", above(strange, 0.5)],
        ["... of 0.95 and more", above(strange, 0.95)],
    ]
    for both, words in ((True, ""), (False, ", by the search alone")):
        errors = _coverage(flights, both)
        for level, most in ((68, 0.9945), (95, 1.96)) if errors else ():
            count = share(sum(e < most for e in errors), len(errors))
            rows.append([f"coverage of {level} % intervals of coefficients{words}", count])
    low, middle, high = np.quantile([x.flight["cpu_s"] for x in flights], [0.05, 0.5, 0.95])
    rows.append(
        ["CPU time, median (5 to 95 % of flights)", f"{middle:.1f} s ({low:.1f} to {high:.1f})"]
    )
    return table(["", "value (95 % interval)"], rows)


def _weights(records: Sequence[Mapping[str, Any]]) -> str:
    w = fit([r["result"] for r in records])
    names = ("evidence", "sure", "tentative", "other", *SIGNS)
    rows = [[f"`{x}`", f"{getattr(w, x):.2f}", f"{getattr(POOLING, x):.2f}"] for x in names]
    return table(["weight, nats", "fitted to all these flights", "in use"], rows)


def tables_of_later_flights(records: Sequence[Mapping[str, Any]]) -> str:
    """Return the scores of flights that were flown after the weights in use were fitted."""
    flights = [Scored(r["task"][0] == "own", r["result"], pool(r["result"])) for r in records]
    parts = [_comparison({"weights in use": flights}), _counts(flights)]
    parts += [table(["probability", "mean", "right"], reliability(flights))]
    return "\n\n".join(parts)


def tables(records: Sequence[Mapping[str, Any]]) -> str:
    """Return the scores of recorded flights as Markdown tables."""
    every = scored(records)
    parts = ["**Three ways to a probability, all flights**", _comparison(every)]
    both = zip(every[WAYS[0]], every[WAYS[1]], strict=True)
    gained = mean_and_interval([a.log_score() - b.log_score() for a, b in both])
    parts += [f"Log score that pooling gains over the search alone, a flight: {gained}."]
    best = every[WAYS[0]]
    parts += ["**Pooled: names by their probability, all flights**"]
    parts += [table(["probability", "mean", "right"], reliability(best))]
    for own, title in ((True, "Own flights"), (False, "The other simulator")):
        some = [x for x in best if x.own == own]
        if some:
            parts += [f"**{title}**", _counts(some)]
            parts += [table(["probability", "mean", "right"], reliability(some))]
    parts += ["**Checks that make names tentative**"]
    parts += [table_of_doubts([r["result"] for r in records])]
    return "\n\n".join([*parts, "**Weights of the pool**", _weights(records)])
