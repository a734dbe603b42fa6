"""How an effect's coefficient drifted from flight to flight, and whether the effect came or went.

The trend is a meta-regression: each flight's coefficient has its own standard deviation, and
flights differ by more than that, by a variance between flights that is estimated (Paule and Mandel
1982; for a regression: DerSimonian and Kacker 2007). The interval is that of Knapp and Hartung
(2003). The pooled value's is not narrower than the flights' own deviations allow; a trend's may be,
since what is wrong in all flights alike cancels in it. A coefficient is only seen where its
effect was named; whether flights name it earlier or later than others do is a second test, of ranks
(Mann and Whitney 1947). All tests of a fleet together are held to one false discovery rate
(Benjamini and Hochberg 1995).
"""

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import false_discovery_control, mannwhitneyu, t

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class DriftSettings:
    """What counts as a drift."""

    false_discoveries: float = 0.05  # expected share of false ones among the drifts that are told
    # flights that a trend needs: with 4, its interval held the truth 91 times of 100 where flights
    # differ as much as their deviations, with 5 or more 93 to 96
    least_flights: int = 5
    least_each: int = 3  # flights with and without an effect, to say that it came or went


DRIFT = DriftSettings()


@dataclass
class Series:
    """What the flights of one individual say about one coefficient of one effect."""

    id: str
    effect: str
    coefficient: str
    unit: str
    flights: list[int] = field(default_factory=list)  # their numbers, in order
    values: list[float] = field(default_factory=list)
    stds: list[float] = field(default_factory=list)
    # neither tentative nor indistinguishable from another effect
    sure: list[bool] = field(default_factory=list)

    def arrays(self) -> tuple[Array, Array, Array, Mask]:
        """Return numbers of flights, values, their standard deviations and which are sure, (n,)
        each.
        """
        x, y, s = (np.asarray(v, dtype=float) for v in (self.flights, self.values, self.stds))
        return x, y, s, np.asarray(self.sure, dtype=bool)


@dataclass(frozen=True)
class Trend:
    """A coefficient over the flights of an individual."""

    series: Series
    among: int  # flights that were diagnosed
    mean: float  # pooled over flights
    mean_ci95: tuple[float, float]
    between_std: float | None  # by which flights differ beyond their own deviations
    per_flight: float | None = None
    per_flight_ci95: tuple[float, float] | None = None
    p: float | None = None  # of no trend
    adjusted_p: float | None = None
    drifts: bool = False
    tentative: bool = False  # too few flights that are sure of the name
    # fitted at the first and the last flight that names the effect
    ends: tuple[float, float] | None = None


@dataclass(frozen=True)
class Appearance:
    """Whether an effect is named rather in later or in earlier flights of an individual."""

    id: str
    effect: str
    named: tuple[int, ...]  # numbers of flights
    among: int
    p: float
    adjusted_p: float | None = None
    later: bool = True
    changed: bool = False


@dataclass(frozen=True)
class Fleet:
    """What the flights say together."""

    trends: tuple[Trend, ...]
    appearances: tuple[Appearance, ...]
    individuals: Mapping[str, Mapping[str, int]]  # flights: diagnosed, refused
    refused: Mapping[str, int]  # by kind
    verdicts: Mapping[str, int]


def meta_regression(
    design: Array, values: Array, stds: Array, at_least_stds: bool
) -> tuple[Array, Array, float]:
    """Fit values with known standard deviations, between which there is a further variance.

    Args:
        design: (n, k) regressors, k < n.
        values: (n,).
        stds: (n,) standard deviation of each value, positive.
        at_least_stds: whether values that agree better than ``stds`` says leave the covariance as
            ``stds`` has it.

    Returns:
        coefficients (k,), their covariance (k, k), and the standard deviation between values.
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
    inflation = deviance / freedom
    spread: Array = scale**2 * max(inflation, float(at_least_stds)) * covariance
    return scale * coefficients, spread, scale * math.sqrt(variance)


def trend_of(series: Series, among: int) -> Trend:
    """Return the pooled coefficient and, with enough flights, its trend per flight.

    Flights that are sure of the effect's name count alone where there are enough of them.
    """
    x, y, s, sure = series.arrays()
    tentative = int(sure.sum()) < DRIFT.least_flights
    good = np.isfinite(y) & np.isfinite(s) & (s > 0.0)
    if not tentative:
        good &= sure
    x, y, s = x[good], y[good], s[good]
    if len(y) < 2:
        value = float(np.median(series.values))
        spread = 1.96 * float(s[0]) if len(y) else math.nan
        ends = (value - spread, value + spread)
        return Trend(series, among, value, ends, None, tentative=not sure.all())
    mean, covariance, between = meta_regression(np.ones((len(y), 1)), y, s, True)
    half = float(t.ppf(0.975, len(y) - 1) * math.sqrt(covariance[0, 0]))
    pooled = float(mean[0])
    interval = (pooled - half, pooled + half)
    if len(y) < DRIFT.least_flights:
        return Trend(series, among, pooled, interval, between, tentative=not sure.all())
    middle = float(np.mean(x))
    design = np.column_stack([np.ones(len(y)), x - middle])
    line, covariance, _ = meta_regression(design, y, s, False)
    slope, error = float(line[1]), math.sqrt(covariance[1, 1])
    first, last = (float(line[0]) + slope * (series.flights[k] - middle) for k in (0, -1))
    half = float(t.ppf(0.975, len(y) - 2) * error)
    return Trend(
        series,
        among,
        pooled,
        interval,
        between,
        slope,
        (slope - half, slope + half),
        float(2.0 * t.sf(abs(slope) / error, len(y) - 2)) if error > 0.0 else 1.0,
        tentative=tentative,
        ends=(first, last),
    )


def appearance_of(
    name: str, effect: str, named: Sequence[int], diagnosed: Sequence[int]
) -> Appearance | None:
    """Return whether flights that name an effect are later than those that do not; None where
    there are too few of either.
    """
    without = sorted(set(diagnosed) - set(named))
    if min(len(named), len(without)) < DRIFT.least_each:
        return None
    test = mannwhitneyu(named, without)
    later = test.statistic > 0.5 * len(named) * len(without)
    return Appearance(
        name, effect, tuple(named), len(diagnosed), float(test.pvalue), later=bool(later)
    )


def fleet_of(rows: Iterable[Mapping[str, Any]]) -> Fleet:
    """Return what all flights say together; of each only the coefficients are kept.

    Args:
        rows: as ``running.rows`` yields them.
    """
    series: dict[tuple[str, str, str], Series] = {}
    named: defaultdict[tuple[str, str], list[int]] = defaultdict(list)
    diagnosed: defaultdict[str, list[int]] = defaultdict(list)
    individuals: dict[str, dict[str, int]] = {}
    refused: Counter[str] = Counter()
    verdicts: Counter[str] = Counter()
    for row in rows:
        who, flight = row["id"], row["flight"]
        individuals.setdefault(who, {"diagnosed": 0, "refused": 0})[row["status"]] += 1
        if row["status"] == "refused":
            refused[row["kind"]] += 1
            continue
        verdicts[row["verdict"]] += 1
        diagnosed[who].append(flight)
        possible: set[str] = set()
        for effect in row["effects"]:
            name, rivals = effect["name"], effect["indistinguishable_from"]
            possible |= {name, *rivals}
            for coefficient, value in effect["coefficients"].items():
                unit = effect["units"].get(coefficient, "")
                one = series.setdefault(
                    (who, name, coefficient), Series(who, name, coefficient, unit)
                )
                std = effect["std"].get(coefficient)
                one.flights.append(flight)
                one.values.append(math.nan if value is None else value)
                one.stds.append(math.nan if std is None else std)
                one.sure.append(not effect["tentative"] and not rivals)
        for name in possible:
            named[who, name].append(flight)
    trends = [trend_of(one, len(diagnosed[one.id])) for one in series.values()]
    told = {(one.id, one.effect) for one in series.values()}
    appearances = [
        appearance
        for (who, name), flights in named.items()
        if (who, name) in told
        and (appearance := appearance_of(who, name, flights, diagnosed[who])) is not None
    ]
    return Fleet(*_controlled(trends, appearances), individuals, refused, verdicts)


def _controlled(
    trends: Sequence[Trend], appearances: Sequence[Appearance]
) -> tuple[tuple[Trend, ...], tuple[Appearance, ...]]:
    """Return all tests with their p-values adjusted together, and what is told by them; those
    first that are.
    """
    every: list[Trend | Appearance] = [*trends, *appearances]
    tested = [one.p for one in every if one.p is not None]
    adjusted = iter(false_discovery_control(tested) if tested else [])
    changes: list[dict[str, Any]] = []
    for one in every:
        told = "drifts" if isinstance(one, Trend) else "changed"
        p = None if one.p is None else float(next(adjusted))
        changes.append({"adjusted_p": p, told: p is not None and p < DRIFT.false_discoveries})
    controlled = [replace(one, **change) for one, change in zip(trends, changes, strict=False)]
    others = changes[len(trends) :]
    seen = [replace(one, **change) for one, change in zip(appearances, others, strict=True)]
    return (
        tuple(sorted(controlled, key=lambda one: not one.drifts)),
        tuple(sorted(seen, key=lambda one: not one.changed)),
    )
