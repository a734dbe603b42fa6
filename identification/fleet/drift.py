"""How an effect's coefficient drifted from flight to flight, and whether the effect came or went.

The trend is a meta-regression: each flight's coefficient has its own standard deviation, and
flights differ by more than that, by a variance between flights that is estimated (Paule and Mandel
1982; for a regression: DerSimonian and Kacker 2007). The interval is that of Knapp and Hartung
(2003). The pooled value's is not narrower than the flights' own deviations allow; a trend's may be,
since what is wrong in all flights alike cancels in it. Flights of a session that was named count
as one, their pooled value: what a session is off by, all of them are. A coefficient is only seen
where its effect was named; whether flights name it earlier or later than others do is a second
test, of ranks (Mann and Whitney 1947). All tests of a fleet together are held to one false
discovery rate (Benjamini and Hochberg 1995).
"""

import math
from collections import Counter, defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.stats import false_discovery_control, mannwhitneyu, t

from ...runtime.arrays import Array

FALSE_DISCOVERIES = 0.05  # expected share of false ones among the drifts that are told
# flights that a trend needs: with 4, its interval held the truth 91 times of 100 where flights
# differ as much as their deviations, with 5 or more 93 to 96
LEAST_FLIGHTS = 5
LEAST_EACH = 3  # flights with and without an effect, to say that it came or went


class Coefficient(NamedTuple):
    """A coefficient of an effect of one individual."""

    id: str
    effect: str
    coefficient: str
    unit: str


@dataclass(kw_only=True)
class _Tested:
    """A test of no change from flight to flight."""

    p: float | None = None  # None: too few flights for a test
    adjusted_p: float | None = None

    @property
    def told(self) -> bool:
        """Whether chance does not explain the change, as the fleet's tests together say."""
        return self.adjusted_p is not None and self.adjusted_p < FALSE_DISCOVERIES


@dataclass
class Trend(_Tested):
    """A coefficient over the flights of an individual that name its effect."""

    of: Coefficient
    # (n, 4) number of the flight, value, its standard deviation, and 1 where the flight is sure:
    # neither tentative nor indistinguishable from another effect
    points: Array
    among: int  # flights of the individual that were diagnosed
    mean: float  # pooled over flights
    mean_ci95: tuple[float, float]
    between_std: float | None  # by which flights differ beyond their own deviations
    per_flight: float | None = None
    per_flight_ci95: tuple[float, float] | None = None
    tentative: bool = False  # too few flights that are sure of the name
    # fitted at the first and the last flight that names the effect
    ends: tuple[float, float] | None = None

    @property
    def sure_in(self) -> int:
        """Count of the flights that are sure."""
        return int(self.points[:, 3].sum())


@dataclass
class Appearance(_Tested):
    """Whether an effect is named rather in later or in earlier flights of an individual."""

    id: str
    effect: str
    named: tuple[int, ...]  # numbers of flights
    among: int
    later: bool


@dataclass(frozen=True)
class Fleet:
    """What the flights say together; the changes that are told come first."""

    trends: Sequence[Trend]
    appearances: Sequence[Appearance]
    individuals: Mapping[str, Mapping[str, int]]  # flights: diagnosed, refused
    refused: Mapping[str, int]  # by kind
    verdicts: Mapping[str, int]


def meta_regression(
    design: Array, values: Array, stds: Array, at_least_stds: bool
) -> tuple[list[float], list[float], float]:
    """Fit values with known standard deviations, between which there is a further variance.

    Args:
        design: (n, k) regressors, k < n.
        values: (n,).
        stds: (n,) standard deviation of each value, positive.
        at_least_stds: whether values that agree better than ``stds`` says leave the deviations as
            ``stds`` has them.

    Returns:
        coefficients (k,), their standard deviations (k,), and that between values.
    """
    freedom = len(values) - design.shape[1]
    # numbers of any unit: the search below is for a ratio
    scale = float(np.sqrt(np.mean(np.square(stds))))
    y, s = values / scale, stds / scale

    def fit(variance: float) -> tuple[Array, Array, float]:
        weight = 1.0 / (np.square(s) + variance)
        information = design.T @ (weight[:, None] * design)
        covariance: Array = np.asarray(np.linalg.inv(information), dtype=float)
        coefficients: Array = covariance @ (design.T @ (weight * y))
        return coefficients, covariance, float(weight @ np.square(y - design @ coefficients))

    variance = most = 0.0
    while fit(most)[2] > freedom:
        most = 4.0 * most or 1.0
    if most > 0.0:
        variance = float(brentq(lambda v: fit(v)[2] - freedom, 0.0, most, xtol=1e-9 * most))
    coefficients, covariance, deviance = fit(variance)
    inflation = max(deviance / freedom, float(at_least_stds))
    errors: Array = scale * np.sqrt(inflation * np.diagonal(covariance))
    return (scale * coefficients).tolist(), errors.tolist(), scale * math.sqrt(variance)


def _by_session(
    x: Array, y: Array, s: Array, sessions: Mapping[float, str]
) -> tuple[Array, Array, Array]:
    """Return number, value and standard deviation of the flights, those of one session pooled."""
    names = np.array([sessions.get(number) or f"flight {number}" for number in x])
    pooled = []
    for name in dict.fromkeys(names.tolist()):
        (of,) = np.nonzero(names == name)
        (value,), (deviation,), _ = (
            meta_regression(np.ones((len(of), 1)), y[of], s[of], True)
            if len(of) > 1
            else (y[of], s[of], None)
        )
        pooled.append((x[of].mean(), value, deviation))
    number, value, deviation = np.array(pooled).reshape(-1, 3).T
    return number, value, deviation


def trend_of(
    of: Coefficient, points: Array, among: int, sessions: Mapping[float, str] | None = None
) -> Trend:
    """Return the pooled coefficient and, with enough flights, its trend per flight.

    Flights that are sure of the effect's name count alone where there are enough of them; those of
    one session, of which ``sessions`` has the name by the flight's number, count as one.
    """
    x, y, s, sure = points.T
    few_sure = bool(sure.sum() < LEAST_FLIGHTS)
    good = np.isfinite(y) & np.isfinite(s) & (s > 0.0) & (few_sure | (sure > 0.0))
    x, y, s = x[good], y[good], s[good]
    if sessions:
        x, y, s = _by_session(x, y, s, sessions)
    if len(y) < 2:
        mean, between = float(np.median(points[:, 1])), None
        half = 1.96 * float(s[0]) if len(y) else math.nan
    else:
        (mean,), (error,), between = meta_regression(np.ones((len(y), 1)), y, s, True)
        half = float(t.ppf(0.975, len(y) - 1)) * error
    trend = Trend(of, points, among, mean, (mean - half, mean + half), between)
    trend.tentative = not sure.all()
    if len(y) >= LEAST_FLIGHTS:
        middle = float(np.mean(x))
        design = np.column_stack([np.ones(len(y)), x - middle])
        (level, slope), (_, error), _ = meta_regression(design, y, s, False)
        half = float(t.ppf(0.975, len(y) - 2)) * error
        trend.per_flight, trend.per_flight_ci95 = slope, (slope - half, slope + half)
        trend.p = float(2.0 * t.sf(abs(slope) / error, len(y) - 2)) if error > 0.0 else 1.0
        trend.tentative = few_sure
        first, last = (level + slope * (points[[0, -1], 0] - middle)).tolist()
        trend.ends = first, last
    return trend


def appearance_of(
    name: str, effect: str, named: Sequence[int], diagnosed: Collection[float]
) -> Appearance | None:
    """Return whether flights that name an effect are later than those that do not; None where
    there are too few of either.
    """
    without = set(diagnosed) - set(named)
    if min(len(named), len(without)) < LEAST_EACH:
        return None
    test = mannwhitneyu(named, sorted(without))
    later = bool(test.statistic > 0.5 * len(named) * len(without))
    return Appearance(name, effect, tuple(named), len(diagnosed), later, p=float(test.pvalue))


def fleet_of(rows: Sequence[Mapping[str, Any]]) -> Fleet:
    """Return what all flights say together.

    Args:
        rows: as ``running.rows`` returns them.
    """
    individuals = {row["id"]: {"diagnosed": 0, "refused": 0} for row in rows}
    for row in rows:
        individuals[row["id"]][row["status"]] += 1
    refused = Counter(row["kind"] for row in rows if row["status"] == "refused")
    flown = [row for row in rows if row["status"] == "diagnosed"]
    # sessions by flights
    diagnosed: dict[str, dict[float, str]] = {who: {} for who in individuals}
    points: defaultdict[Coefficient, list[tuple[float, ...]]] = defaultdict(list)
    named: defaultdict[tuple[str, str], list[int]] = defaultdict(list)
    for row in flown:
        who, flight, effects = row["id"], row["flight"], row["effects"]
        diagnosed[who][flight] = row.get("session", "")
        for effect in effects:
            sure = not (effect["tentative"] or effect["indistinguishable_from"])
            for coefficient, value in effect["coefficients"].items():
                unit, std = (effect[key].get(coefficient) for key in ("units", "std"))
                known = (math.nan if x is None else x for x in (value, std))
                of = Coefficient(who, effect["name"], coefficient, unit or "")
                points[of].append((flight, *known, sure))
        possible = ((effect["name"], *effect["indistinguishable_from"]) for effect in effects)
        for name in dict.fromkeys(chain.from_iterable(possible)):
            named[who, name].append(flight)
    trends = [
        trend_of(of, np.array(p, float), len(diagnosed[of.id]), diagnosed[of.id])
        for of, p in points.items()
    ]
    told = {(of.id, of.effect) for of in points}
    appearances = [
        found
        for (who, name), flights in named.items()
        if (who, name) in told and (found := appearance_of(who, name, flights, diagnosed[who]))
    ]
    tests = [one for one in (*trends, *appearances) if one.p is not None]
    adjusted = false_discovery_control([one.p for one in tests]) if tests else ()
    for one, p in zip(tests, adjusted, strict=True):
        one.adjusted_p = float(p)
    trends.sort(key=lambda one: not one.told)
    appearances.sort(key=lambda one: not one.told)
    verdicts = Counter(row["verdict"] for row in flown)
    return Fleet(trends, appearances, individuals, refused, verdicts)
