"""Which effects act: the posterior over sets of up to four, and what they leave unexplained.

Every effect of the library is as likely as every other before the flight, and one is expected to be
missing. A set's evidence is that of the likelier noise of two: that beside no effect, and that
beside the best set, because what is not explained counts as a disturbance.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...dynamics.effects import get
from ...dynamics.effects.declaration import Role
from ..findings import RankedSet, Ranking
from ..inference.gram_matrix import GRAM
from ..inference.regression import (
    CENTRAL,
    START_PREFIX,
    Column,
    Flights,
    coefficient,
    moves_time,
    typical_size,
    unit_of_change,
)
from ..inference.starting_points import starting_points
from ..inference.time_offsets import timing_of
from .discrepancy import DISCREPANCY
from .evidence import (
    Index,
    Marginal,
    SetEvidence,
    evidence_of_one_more,
    log_sum,
    marginal,
    set_evidence,
    tempering,
)
from .likelihood import BETWEEN, GAIN, LIKELIHOOD, UNKNOWN, WHOLE_PREFIX, Likelihood, Sums

Array = NDArray[np.float64]
Setting = dict[str, dict[str, float]]


@dataclass(frozen=True)
class RankingSettings:
    """Priors, and how much of the sets is looked at."""

    expected: float = 1.0  # effects that a vehicle lacks, before its flight is seen
    # typical sizes: every effect acts a little, and one that is no larger is not worth a name. It
    # is the standard deviation of what any coefficient may have without the effect being named
    negligible: float = 0.03
    prior_size: float = 1.0  # typical sizes, the standard deviation of a coefficient
    any_size: float = 3.0  # the same of effects that may be of any size
    # typical sizes at which a lag or a delay is tried as a whole: their columns change with them
    time_starts: tuple[float, ...] = (0.3, 0.6, 1.2)
    # times such a start, between which its column stands for it
    near_start: tuple[float, float] = (0.5, 1.5)
    most_effects: int = 5
    kept_sets: int = 8  # of each size, to which a further effect is added
    kept_asked: int = 24  # sets, the best, that are asked for beside the noise of no effect too
    rounds: int = 4  # of fitting the noise beside the best set
    least_probability: float = 1e-6  # of a set that is kept


RANKING = RankingSettings()
# one way in which an effect may act: all coefficients, or one of those starting points
Variant = tuple[str, tuple[Column, ...]]


@dataclass(frozen=True, eq=False)
class _Base:
    """The likelihood near one setting, in prior standard deviations."""

    columns: dict[Column, int]
    size: Array  # (c,) prior standard deviations
    low: Array
    high: Array
    blocks: Array
    penalty: float
    effects: frozenset[str]  # of the setting
    plain: Index  # columns that any flight may have
    typical: Array  # (c,) typical sizes in prior standard deviations
    dictionary: Index  # columns of the discrepancy
    starts: Mapping[Column, Mapping[str, float]]


def rank(
    flights: Flights,
    library: Sequence[str],
    proposed: Setting | None = None,
    report: Callable[[str], None] = lambda text: None,
) -> Ranking:
    """Return the posterior over sets of effects of a library, of those that flights can show.

    Args:
        flights: whose poses are explained.
        library: names of effects that may act.
        proposed: effects with coefficients that another search has found: its columns are asked
            beside those of the sets that the posterior comes upon by itself.
        report: called with a line of progress.
    """
    library = [e for e in library if e not in flights.not_identifiable]
    near = Likelihood(flights, {})
    starts = _starts(flights, library, {})
    sums = near.sums(_wanted(library, {}, starts), starts, unknown=False)
    loud = _in_prior_units(flights, sums, {}, starts)
    explained = _whole_library(loud)
    now = _in_prior_units(flights, near.quieter(explained), {}, starts)
    tried: dict[frozenset[str], Setting] = {frozenset(): {}}
    beside: _Beside | None = None
    others: tuple[_Base, ...] = ()
    if proposed and proposed.keys() <= set(library):
        tried[frozenset(proposed)] = proposed
        beside = _Beside(flights, library, proposed, near)
        others = (beside.base(),)
    found = _Posterior(flights, library, (loud, *others, now))
    # the best effect first, alone: another set's columns are those of the model that has it
    setting = found.best_setting(1)
    last: _Beside | None = None
    for _ in range(RANKING.rounds):
        # the columns of the same set change with its coefficients, where these have moved far
        if not found.is_elsewhere(setting, tried):
            setting = found.best_setting()
            if not found.is_elsewhere(setting, tried):
                break
        tried[frozenset(setting)] = setting
        if beside and beside.setting.keys() == setting.keys():
            beside, others = None, ()
        report(f"trying {', '.join(setting)}")
        last = _Beside(flights, library, setting, last.likelihood if last else near)
        found = _Posterior(flights, library, (loud, *others, last.base()))
        setting = found.best_setting()
    # once more, with the dictionary's columns, that are dear, beside the likeliest set
    if beside and found.best_base() == 1:
        others, last = ((last.base(),) if last else (now,)), beside
    if last:
        now = last.base(unknown=True)
    else:
        near.sums(_wanted(library, {}, starts), starts)
        now = _in_prior_units(flights, near.quieter(explained), {}, starts)
    return _Posterior(flights, library, (loud, *others, now), found.tempering()).ranking()


class _Beside:
    """The likelihood beside a set of effects, and the starts of all others there."""

    def __init__(
        self, flights: Flights, library: Sequence[str], setting: Setting, near: Likelihood
    ) -> None:
        self.flights, self.library, self.setting = flights, library, setting
        self.likelihood = Likelihood(flights, setting, near)
        self.starts = _starts(flights, library, setting)

    def base(self, unknown: bool = False) -> _Base:
        """Return its sums; ``unknown``: with the dictionary's columns."""
        wanted = _wanted(self.library, self.setting, self.starts)
        sums = self.likelihood.sums(wanted, self.starts, unknown)
        return _in_prior_units(self.flights, sums, self.setting, self.starts)


def _wanted(
    library: Sequence[str], setting: Setting, starts: Mapping[Column, Mapping[str, float]]
) -> dict[Column, None]:
    """Return the columns of all effects, in order."""
    return dict.fromkeys(c for e in library for v in _variants(e, setting, starts) for c in v[1])


def _whole_library(base: _Base) -> dict[Column, float]:
    """Return the coefficients of all columns of effects together, at the mode."""
    chosen = np.concatenate([base.plain, [i for c, i in base.columns.items() if c[0]]]).astype(int)
    total = base.blocks.sum(axis=0)
    mode = np.linalg.solve(total[np.ix_(chosen, chosen)] + np.eye(len(chosen)), total[chosen, -1])
    names = list(base.columns)
    return {names[i]: float(x * base.size[i]) for i, x in zip(chosen, mode, strict=True)}


def _starts(
    flights: Flights, library: Sequence[str], setting: Setting
) -> dict[Column, Mapping[str, float]]:
    out: dict[Column, Mapping[str, float]] = {}
    residual: Array | None = None
    for effect in library:
        if effect in setting:
            continue
        if moves_time(effect) and get(effect).kind == "rotor input":
            name = get(effect).coefficients[0].name
            typical = typical_size((effect, name), flights.vehicle)
            for i, share in enumerate(RANKING.time_starts):
                out[effect, f"{START_PREFIX}{i}"] = {name: share * typical}
            continue
        if get(effect).starting_points is None:
            continue
        if residual is None:
            residual = flights.residual({k: v for k, v in setting.items() if k})
        for i, start in enumerate(starting_points(effect, flights, residual, {})):
            out[effect, f"{START_PREFIX}{i}"] = start
    return out


def _variants(
    effect: str, setting: Setting, starts: Mapping[Column, Mapping[str, float]]
) -> list[Variant]:
    """Return the ways in which an effect may act."""
    names = [c.name for c in get(effect).coefficients]
    if moves_time(effect) and effect not in setting:
        derivative: Variant = (effect, tuple((effect, name) for name in names))
        return [derivative, *((effect, (c,)) for c in starts if c[0] == effect)]
    if get(effect).starting_points is not None:
        if effect in setting:
            return [(effect, tuple((effect, name) for name in names))]
        return [(effect, (c,)) for c in starts if c[0] == effect]
    if CENTRAL not in names:
        return [(effect, tuple((effect, name) for name in names))]
    names.remove(CENTRAL)
    plain: Variant = (effect, tuple((effect, name) for name in names))
    if effect in setting:
        return [(effect, (*plain[1], (effect, CENTRAL)))]
    return [plain, (effect, tuple((effect, WHOLE_PREFIX + name) for name in names))]


def _prior_size(column: Column, flights: Flights) -> float:
    effect, name = column
    if (timing := timing_of(column)) is not None:
        return timing.size
    if not effect:
        if name == BETWEEN:
            return LIKELIHOOD.between_samples
        if name.startswith(GAIN):
            return LIKELIHOOD.gains[int(name[-1])]
        return LIKELIHOOD.model_error if not name.startswith(UNKNOWN) else 1.0
    if name.startswith(START_PREFIX) or name == CENTRAL:
        return 1.0
    factor = RANKING.any_size if get(effect).any_size else RANKING.prior_size
    return factor * typical_size((effect, name.removeprefix(WHOLE_PREFIX)), flights.vehicle)


def _typical(column: Column, flights: Flights) -> float:
    effect, name = column
    if not effect or name.startswith(START_PREFIX) or name == CENTRAL:
        return 1.0
    return typical_size((effect, name.removeprefix(WHOLE_PREFIX)), flights.vehicle)


def _bounds(column: Column, flights: Flights) -> tuple[float, float]:
    effect, name = column
    if not effect:
        return -math.inf, math.inf
    if name.startswith(START_PREFIX):
        return RANKING.near_start if moves_time(effect) else (0.0, math.inf)
    c = coefficient((effect, name.removeprefix(WHOLE_PREFIX)))
    low, high = c.minimum, min(c.maximum, c.plausible)
    if get(effect).role == Role.MASS:
        low = max(low, -GRAM.most_missing_mass * unit_of_change(column, flights.vehicle))
    return min(low, 0.0), max(high, 0.0)


def _in_prior_units(
    flights: Flights,
    sums: Sums,
    setting: Setting,
    starts: Mapping[Column, Mapping[str, float]],
) -> _Base:
    size = np.array([_prior_size(c, flights) for c in sums.columns])
    bounds = np.array([_bounds(c, flights) for c in sums.columns])
    scale = np.append(size, 1.0)
    blocks = sums.blocks * scale[:, None] * scale
    # about zero, not about the setting: the residual with all its effects taken away
    back = np.append(sums.value / size, 1.0)
    whole = blocks @ back
    blocks[:, :, -1] = whole
    blocks[:, -1, :] = whole
    blocks[:, -1, -1] = np.einsum("c,bc->b", back, whole)
    columns = {c: i for i, c in enumerate(sums.columns)}
    plain = [i for c, i in columns.items() if not c[0] and not c[1].startswith(UNKNOWN)]
    dictionary = [i for c, i in columns.items() if not c[0] and c[1].startswith(UNKNOWN)]
    return _Base(
        columns,
        size,
        bounds[:, 0] / size,
        bounds[:, 1] / size,
        blocks,
        sums.penalty,
        frozenset(k for k in setting if k),
        np.array(plain, dtype=np.intp),
        np.array([_typical(c, flights) for c in sums.columns]) / size,
        np.array(dictionary, dtype=np.intp),
        starts,
    )


@dataclass(frozen=True, eq=False)
class _Candidate:
    base: int
    variants: tuple[Variant, ...]
    evidence: SetEvidence


class _Posterior:
    """The evidence of sets, of all bases together."""

    def __init__(
        self,
        flights: Flights,
        library: Sequence[str],
        bases: Sequence[_Base],
        power: float = 1.0,
    ) -> None:
        self.flights, self.library, self.bases, self.power = flights, library, bases, power
        self.inclusion = min(RANKING.expected / max(len(library), 1), 0.5)
        self.known: dict[frozenset[str], _Candidate] = {}
        self.scores: dict[frozenset[str], float] = {}
        # beside the noise of nothing explained no effect shows: what others found is asked there
        for i in range(1, len(bases)):
            self._search(i)
        found = sorted(self.scores, key=self.scores.__getitem__, reverse=True)
        self._search(0, [self.known[k].variants for k in found[: RANKING.kept_asked]])

    def tempering(self) -> float:
        """Return the power of the likelihood that the scatter beside the likeliest set allows."""
        best = self.known[max(self.scores, key=self.scores.__getitem__)]
        base = self.bases[best.base]
        own = [base.columns[c] for v in best.variants for c in v[1]]
        return tempering(base.blocks, np.array(sorted([*base.plain, *own]), dtype=np.intp))

    def _marginal(self, base: _Base) -> tuple[Marginal, Index, dict[Column, int]]:
        total = self.power * base.blocks.sum(axis=0)
        deviance = float(total[-1, -1]) + self.power * base.penalty
        asked = np.array([i for (e, _), i in base.columns.items() if e], dtype=np.intp)
        # what any flight may have, and a little of every effect
        others = np.concatenate([base.plain, asked])
        normal, right = total[:-1, :-1], total[:-1, -1]
        little = np.ones(len(right))
        little[asked] = RANKING.negligible * base.typical[asked]
        at = {c: i for i, c in enumerate(c for c in base.columns if c[0])}
        return marginal(normal, right, deviance, asked, others, little[others]), asked, at

    def _log_prior(self, effects: int) -> float:
        p = self.inclusion
        return effects * math.log(p) + (len(self.library) - effects) * math.log1p(-p)

    def _variants(self, base: _Base) -> list[Variant]:
        out = []
        setting: dict[str, dict[str, float]] = {e: {} for e in base.effects}
        from_start = [c for c in base.columns if c[1].startswith(START_PREFIX)]
        starts: dict[Column, dict[str, float]] = {c: {} for c in from_start}
        for effect in self.library:
            for variant in _variants(effect, setting, starts):
                if all(c in base.columns for c in variant[1]):
                    out.append(variant)
        return out

    def _search(self, number: int, asked_sets: Sequence[tuple[Variant, ...]] | None = None) -> None:
        base = self.bases[number]
        m, asked, at = self._marginal(base)
        low, high = base.low[asked], base.high[asked]
        variants = self._variants(base)
        ways = {e: sum(v[0] == e for v in variants) for e, _ in variants}

        def score(some: tuple[Variant, ...]) -> float:
            index = [at[c] for v in some for c in v[1]]
            try:
                evidence = set_evidence(m, index, low, high)
            except np.linalg.LinAlgError:
                return -math.inf
            value = evidence.log_evidence - sum(math.log(ways[e]) for e, _ in some)
            if not self._possible(base, some, evidence):
                return -math.inf
            key = frozenset(e for e, _ in some)
            if number == 0 and any(x.effects and key >= x.effects for x in self.bases[1:]):
                return -math.inf  # its columns are those of the other base
            total = value + self._log_prior(len(some))
            if total > self.scores.get(key, -math.inf):
                self.scores[key] = total
                self.known[key] = _Candidate(number, some, evidence)
            return total

        score(())
        if asked_sets is not None:
            for some in asked_sets:
                if all(c in at for v in some for c in v[1]):
                    score(some)
        level: list[tuple[float, tuple[Variant, ...]]] = [(score((v,)), (v,)) for v in variants]
        for size in range(2, 1 if asked_sets is not None else RANKING.most_effects + 1):
            level.sort(key=lambda x: x[0], reverse=True)
            seen: set[frozenset[Variant]] = set()
            more = []
            kept = level[: RANKING.kept_sets * (2 if size == 2 else 1)]
            for _, some in kept:
                for v in variants:
                    key = frozenset((*some, v))
                    if v[0] in {e for e, _ in some} or key in seen:
                        continue
                    seen.add(key)
                    more.append((score((*some, v)), (*some, v)))
            level = more

    def _possible(self, base: _Base, some: Sequence[Variant], evidence: SetEvidence) -> bool:
        row = 0
        for effect, columns in some:
            values = evidence.mode[row : row + len(columns)]
            row += len(columns)
            possible = get(effect).possible
            if possible is None or columns[0][1].startswith(START_PREFIX):
                continue
            own = {
                c[1]: float(x * base.size[base.columns[c]])
                for c, x in zip(columns, values, strict=True)
            }
            if not possible(own, self.flights.vehicle):
                return False
        return True

    def best_base(self) -> int:
        """Return the number of the base in which the likeliest set is."""
        return self.known[max(self.scores, key=self.scores.__getitem__)].base

    def structure(self) -> float:
        """Return the logarithm of the Bayes factor of one more column beside the likeliest set."""
        base = self.bases[-1]
        best = max(self.scores, key=self.scores.__getitem__)
        own = [
            base.columns[c] for v in self.known[best].variants for c in v[1] if c in base.columns
        ]
        asked = [i for (e, _), i in base.columns.items() if e]
        little = RANKING.negligible * base.typical[asked]
        chosen = np.array([*base.plain, *asked, *own], dtype=np.intp)
        total = self.power * base.blocks.sum(axis=0)
        return evidence_of_one_more(
            total[:-1, :-1],
            total[:-1, -1],
            chosen,
            np.concatenate([np.ones(len(base.plain)), little, np.ones(len(own))]),
            base.dictionary,
            DISCREPANCY.sizes,
        )

    def best_setting(self, most: int = RANKING.most_effects) -> Setting:
        """Return the coefficients of the likeliest set of at most so many effects."""
        key = max((k for k in self.scores if len(k) <= most), key=self.scores.__getitem__)
        return self._setting(key)[0]

    def is_elsewhere(self, new: Setting, tried: Mapping[frozenset[str], Setting]) -> bool:
        """Return whether a set was not tried yet, or with coefficients that are more than a
        standard deviation away.
        """
        if frozenset(new) not in tried:
            return True
        old = tried[frozenset(new)]
        std = self._setting(frozenset(new))[1]
        return any(
            abs(value - old[effect].get(name, 0.0)) > std[effect].get(name, math.inf)
            for effect, values in new.items()
            for name, value in values.items()
        )

    def _setting(self, key: frozenset[str]) -> tuple[Setting, Setting]:
        found = self.known[key]
        base = self.bases[found.base]
        setting: Setting = {}
        std: Setting = {}
        row = 0
        for effect, columns in found.variants:
            own: dict[str, float] = {}
            off: dict[str, float] = {}
            for c in columns:
                value = float(found.evidence.mode[row] * base.size[base.columns[c]])
                deviation = float(found.evidence.std[row] * base.size[base.columns[c]])
                row += 1
                if c[1].startswith(START_PREFIX):
                    own |= base.starts[c]
                    if moves_time(effect):
                        first = get(effect).coefficients[0].name
                        own[first] *= float(found.evidence.mode[row - 1])
                    continue
                name = c[1].removeprefix(WHOLE_PREFIX)
                limits = coefficient((effect, name))
                own[name] = float(np.clip(value, limits.minimum, limits.maximum))
                off[name] = deviation
                if c[1].startswith(WHOLE_PREFIX):
                    own[CENTRAL] = 1.0
            setting[effect], std[effect] = own, off
        return setting, std

    def ranking(self) -> Ranking:
        """Return probabilities."""
        total = log_sum(list(self.scores.values()))
        p = {k: math.exp(v - total) for k, v in self.scores.items()}
        probability = {e: sum(x for k, x in p.items() if e in k) for e in self.library}
        best = sorted(p, key=p.__getitem__, reverse=True)
        sets = []
        for key in best:
            if p[key] < RANKING.least_probability:
                break
            setting, std = self._setting(key)
            sets.append(RankedSet(tuple(sorted(key)), p[key], setting, std))
        return Ranking(probability, tuple(sets), self.structure(), self.power)
