"""The posterior over sets of effects, from sums of products beside some of the sets."""

import math
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain

import numpy as np
from scipy.special import logsumexp, softmax

from ...dynamics.effects import get
from ...dynamics.effects.declaration import Found
from ..findings import LEAST_RIVAL, RankedSet, Ranking
from ..logs.table import Array, NamedNumbers, Pair, Values
from .coefficients import CENTRAL, Effects, Setting, coefficient, moves_time, typical_sizes
from .column import Column, Part
from .discrepancy import SHARE_OF_EFFECT
from .evidence import Index, Marginal, SetEvidence, evidence_of_one_more, tempering
from .left_out import LeftOut
from .priors import (
    EXPECTED,
    NEGLIGIBLE,
    Base,
    Variant,
    Variants,
    changed,
    variants_of,
)
from .regression import RegressedFlights

MOST_EFFECTS = 5  # in a set, beside the given ones
KEPT_SETS = 8  # of each size, extended by a further effect
KEPT_ASKED = 24  # best sets also judged beside the noise of no effect
MOST_RIVALS = 2  # effects like the likeliest one, tried in its place
LEAST_PROBABILITY = 1e-6  # of a set in the ranking
# shares of the weight, and of the weight at a quarter of the arm: standard deviations of a column
# of the dictionary
UNKNOWN_SIZES = (0.001, 0.003, 0.01, 0.03)
EFFECT_ERROR = 0.01  # error of an effect's model, as a share of the effect's own wrench
# power of the likelihood where rotor speeds hardly leave their rounding steps: there the rounding
# follows the flight and is no noise
ROUNDED = 0.25


@dataclass(frozen=True, eq=False)
class _Candidate:
    base: Base
    variants: Variants
    evidence: SetEvidence

    @property
    def columns(self) -> list[Column]:
        return [c for columns in self.variants for c in columns]

    @property
    def fitted(self) -> Index:
        """The indices of the nuisances and of the set's columns."""
        return np.append(self.base.plain, self.base.at(self.columns))


def is_possible(
    flights: RegressedFlights,
    setting: Setting,
    std: Values,
    effect: str,
    plausible: bool,
) -> bool:
    """Return whether a vehicle can have an effect's coefficients, with their standard deviations,
    at a setting; ``plausible``: and whether they are physics of this effect.

    A fit of an effect in the place of another often ends at a bound: a dry friction, named a drag,
    needs a quadratic part below zero. A true coefficient of zero is at a bound too, but its best
    fit is not far outside.
    """
    words = get(effect)
    vehicle = flights.vehicle
    own = setting[effect]
    if words.possible is not None and not words.possible(own, vehicle):
        return False
    if not plausible or words.implausible is None:
        return True
    beside = {*setting, *(e.name for e in vehicle.effects)} - {"", effect}
    return not words.implausible(
        Found(
            own,
            {name: std.get(name, 0.0) for name in own},
            typical_sizes(effect, vehicle),
            flights.speed,
            frozenset(get(name).family for name in beside),
        )
    )


@dataclass(eq=False)
class Posterior:
    """The evidence of sets, of all bases together.

    Args:
        flights: the explained flights.
        library: names of effects.
        bases: the likelihood beside some sets. The first has the noise of nothing explained.
        power: of the likelihood.
        among: effects in every set. Then all sets share one noise, and the base with most of a
            set's effects judges it; a single base has them all. Without them each base has
            a noise of its own, and a set's likeliest counts.
        idle: sets to leave out: their best fit has an effect that does nothing.
    """

    flights: RegressedFlights
    library: Sequence[str]
    bases: Sequence[Base]
    power: float = 1.0
    among: Effects | None = None
    idle: Collection[Effects] = ()

    def __post_init__(self) -> None:
        self.given = self.among or frozenset()
        self.one_noise = self.among is not None
        inclusion = min(EXPECTED / max(len(self.library) - len(self.given), 1), 0.5)
        self.odds = math.log(inclusion / (1.0 - inclusion))  # before the flight, of an effect
        self.known: dict[Effects, _Candidate] = {}
        self.scores: dict[Effects, float] = {}
        # the likeliest set without needless effects, once asked
        self._needed: _Candidate | None = None
        # beside the noise of nothing explained no effect shows: only sets found elsewhere go there
        for i in range(0 if self.one_noise else 1, len(self.bases)):
            self._search(i)
        if not self.one_noise:
            self._search(0, [self.known[k].variants for k in self._ranked[:KEPT_ASKED]])

    @property
    def _ranked(self) -> list[Effects]:
        """The sets, the likeliest first."""
        return sorted(self.scores, key=self.scores.__getitem__, reverse=True)

    @property
    def _likeliest(self) -> _Candidate:
        return self._needed or self.known[self._ranked[0]]

    def leave_out_needless(self, probability: Values) -> tuple[Setting, dict[str, Pair]]:
        """Put the likeliest set's needed effects in its place, and return their coefficients.

        Return each effect's gain, too, together with the effects already left out: nats, and its
        standard error.

        A gain must exceed the odds against these effects before the flight. The least probable
        effect goes first: another may need its place.

        Args:
            probability: each effect's probability.
        """
        best = self._likeliest
        base = best.base
        columns = best.columns
        left_out = LeftOut(base, columns, self.power)
        m = base.marginal(columns, base.plain, self.power)
        every = {c.effect for c in columns} - self.given
        gains = {}
        while True:
            weak = {}
            for variant in best.variants:
                effect = variant[0].effect
                rest = tuple(x for x in best.variants if x != variant)
                less = [*chain.from_iterable(rest)]
                gained, std = gains[effect] = left_out.gain(less)
                smaller = _Candidate(base, rest, m.evidence(less))
                least = left_out.least * std - self.odds * len(every - {c.effect for c in less})
                if gained < least and self._possible(smaller):
                    weak[probability[effect], gained / (std + 1e-9)] = smaller
            if not weak:
                return self._at_mode(best)[0], gains
            self._needed = best = weak[min(weak)]

    def tempering(self) -> float:
        """Return the power of the likelihood by the scatter beside the likeliest set."""
        best = self._likeliest
        return tempering(best.base.blocks, np.searchsorted(best.base.single, best.fitted))

    def _of_any_flight(self, base: Base) -> tuple[Index, Array]:
        """Return the columns of everything any flight may have, and of a little of every effect,
        with standard deviations.
        """
        at = base.at(base.asked)
        little = NEGLIGIBLE * base.typical[at]
        # a start of another base is no small effect
        if self.one_noise:
            little[[c.part == Part.START for c in base.asked]] = 0.0
        return np.append(base.plain, at), np.append(np.ones(len(base.plain)), little)

    def _variants(self, base: Base) -> dict[str, list[Variant]]:
        """Return the variants of each effect with columns in a base."""
        out = {}
        for effect in self.library:
            every = variants_of(self.flights, effect, base.effects, base.starts)
            seen = (tuple(c for c in v if c in base.columns) for v in every)
            # a balance does not see the point of action
            if own := [v for v in seen if v and (self.one_noise or v in every)]:
                out[effect] = own
        return out

    def _search(self, number: int, asked: Sequence[Variants] = ()) -> None:
        base = self.bases[number]
        others, little = self._of_any_flight(base)
        m = base.marginal(base.asked, others, self.power, little)
        ways = self._variants(base)
        variants = [*chain.from_iterable(ways.values())]
        tried = base.tried.setdefault(self.power, {})

        def score(some: Variants) -> float:
            key = frozenset(v[0].effect for v in some)
            most = max((len(x.effects) for x in self.bases if x.effects <= key), default=0)
            # else another base has more of the columns of this set
            judged = len(base.effects) == most or (number > 0 and not self.one_noise)
            if len(key) < len(some) or key in self.idle or not judged:
                return -math.inf
            if some not in tried:
                tried[some] = None
                with suppress(np.linalg.LinAlgError):
                    new = _Candidate(base, some, m.evidence(chain.from_iterable(some)))
                    if self._possible(new):
                        tried[some] = new.evidence
            if (evidence := tried[some]) is None:
                return -math.inf
            total = evidence.log_evidence + sum(self.odds - math.log(len(ways[e])) for e in key)
            if total > self.scores.get(key, -math.inf):
                self.scores[key] = total
                self.known[key] = _Candidate(base, some, evidence)
            return total

        first = tuple(v for v in variants if self.one_noise and v[0].effect in base.effects)
        score(first)
        for some in asked:
            if all(c in m.place for v in some for c in v):
                score(some)
        level = [(*first, v) for v in variants if v not in first]
        more = 1 if asked else max(MOST_EFFECTS + len(self.given) - len(first), 1)
        for size in range(more):
            level.sort(key=score, reverse=True)
            kept = level[: KEPT_SETS if size else 2 * KEPT_SETS]
            grown: dict[frozenset[Variant], Variants] = {}
            for new in ((*some, v) for some in kept for v in variants):
                grown.setdefault(frozenset(new), new)
            level = list(grown.values())

    def _possible(self, candidate: _Candidate) -> bool:
        """Return whether a vehicle can have the coefficients of a set at its mode."""
        asked = [
            c.effect
            for c, *_ in candidate.variants
            if c.part != Part.START and (get(c.effect).possible or get(c.effect).implausible)
        ]
        setting, std = self._at_mode(candidate) if asked else ({}, {})
        return all(is_possible(self.flights, setting, std[e], e, self.one_noise) for e in asked)

    def structure(self, quieter: Base | None) -> float:
        """Return the logarithm of the Bayes factor of one more column beside the likeliest set.

        Each group of the dictionary is equally likely to have the column, and so is each column of
        a group.

        Args:
            quieter: the last base with the likeliest noise beside the strangest column. The set,
                and the set with one more column, have the likelier noise of both.
        """
        group = np.array([c.group for c in self.bases[-1].dictionary])
        none = []
        more = []
        for base in filter(None, (self.bases[-1], quieter)):
            m = self._dictionary_beside_best(base)
            factors = [
                evidence_of_one_more(m, np.flatnonzero(group == own), UNKNOWN_SIZES)
                for own in np.unique(group)
            ]
            none.append(m.constant)
            more.append(m.constant + float(logsumexp(factors, b=1.0 / len(factors))))
        return max(more) - max(none)

    def strangest(self) -> tuple[Column, float, float]:
        """Return the dictionary's best column beside the likeliest set, its coefficient, and its
        deviance.
        """
        base = self.bases[-1]
        m = self._dictionary_beside_best(base)
        coefficients = m.right / m.own
        gains = m.right * coefficients
        best = int(np.argmax(gains))
        return base.dictionary[best], float(coefficients[best]), float(gains[best])

    def log_bayes_factor(self, effect: str) -> float:
        """Return the log-likelihood ratio of the likeliest set with an effect to the likeliest
        without it, less the prior odds.
        """
        value = {False: -math.inf}
        for key, x in self.scores.items():
            has = effect in key
            value[has] = max(value.get(has, -math.inf), x - self.odds * len(key))
        return value[True] - value[False]

    def factor_in_set(self, effect: str) -> float:
        """Return the logarithm of the Bayes factor of the likeliest set over the same without an
        effect, with nothing in its place.
        """
        best = self._likeliest
        m = best.base.marginal(best.columns, best.base.plain, self.power)
        rest = m.evidence(c for c in best.columns if c.effect != effect)
        return m.evidence(best.columns).log_evidence - rest.log_evidence

    def left(self) -> float:
        """Return the deviance left by the likeliest set, with the nuisances integrated out."""
        best = self._likeliest
        base = best.base
        m = base.marginal(best.columns, base.plain, self.power)
        whole = m.deviance - self.power * base.penalty
        return whole - m.explained(m.place, best.evidence.mode)

    def alone(self) -> NamedNumbers:
        """Return the deviance of each effect of the library alone, beside the given effects, over
        the deviance of all effects together.
        """
        base = next(x for x in self.bases if x.effects == self.given)
        asked = [c for c in base.asked if c.effect not in self.given]
        always = base.at(c for c in base.asked if c.effect in self.given)
        m = base.marginal(asked, np.append(base.plain, always), self.power)
        right = m.right
        normal = m.normal + np.eye(len(asked))
        whole = max(float(right @ np.linalg.solve(normal, right)), 1e-12)
        return {
            e: max(map(m.gain, own)) / whole
            for e, own in self._variants(base).items()
            if e not in self.given
        }

    def nuisances(self) -> dict[Column, Pair]:
        """Return the nuisances of any flight at the mode beside the likeliest set: values and
        standard deviations.
        """
        best = self._likeliest
        modes = best.base.mode(best.fitted, self.power)
        return {c: x for c, x in modes.items() if not c.effect}

    def shown(self, known: Sequence[Column] = ()) -> NamedNumbers:
        """Return the change of the deviance by a typical size of each effect outside the likeliest
        set; ``known``: nuisances taken as fully known.
        """
        best = self._likeliest
        base = best.base
        m = base.marginal(base.asked, np.setdiff1d(best.fitted, base.at(known)), self.power)
        out: NamedNumbers = {}
        for columns in chain.from_iterable(self._variants(base).values()):
            effect = columns[0].effect
            if columns[0].part == Part.START or effect in {c.effect for c in best.columns}:
                continue
            sign = np.sign([coefficient(c).typical[0] for c in columns])
            z = base.typical[base.at(columns)] * sign
            _, normal, _ = m.at(columns)
            out[effect] = max(float(z @ normal @ z), out.get(effect, 0.0))
        return out

    def _dictionary_beside_best(self, base: Base) -> Marginal:
        """Return the likelihood of a base's dictionary beside the base's columns of the likeliest
        set.
        """
        own = base.at(c for c in self._likeliest.columns if c in base.columns)
        # an effect of the set is true to some per cent, whatever makes it change
        changing = base.at(c for c in base.columns if c.part == Part.CHANGING)
        others, little = self._of_any_flight(base)
        wrong = np.repeat([1.0, EFFECT_ERROR / SHARE_OF_EFFECT], [len(own), len(changing)])
        varied = self.flights.commanded or self.flights.rotor_speeds_vary
        return base.marginal(
            base.dictionary,
            np.concatenate([others, own, changing]),
            self.power if varied else ROUNDED * self.power,
            np.append(little, wrong),
        )

    def best_setting(self, most: float = math.inf) -> Setting:
        """Return the coefficients of the likeliest set of at most ``most`` effects."""
        key = next(k for k in self._ranked if len(k) <= most)
        return self._at_mode(self.known[key])[0]

    def rivals(self, setting: Setting) -> list[Setting]:
        """Return the coefficients of the likeliest other effects with, each alone, at least half of
        a setting's gain.
        """
        least = 0.5 * (self.scores.get(frozenset(setting), -math.inf) + self.scores[frozenset()])
        keys = [
            k for k in self._ranked if len(k) == 1 and self.scores[k] > least and k - {*setting}
        ]
        return [self._at_mode(self.known[k])[0] for k in keys[:MOST_RIVALS]]

    def is_elsewhere(self, new: Setting, tried: Mapping[Effects, Setting]) -> bool:
        """Return whether a set is untried, or was tried only with coefficients more than a standard
        deviation away.
        """
        if (old := tried.get(frozenset(new))) is None:
            return True
        std = self._at_mode(self.known[frozenset(new)])[1]
        return any(
            abs(value - old[effect].get(name, 0.0)) > std[effect].get(name, math.inf)
            for effect, values in new.items()
            for name, value in values.items()
        )

    def _at_mode(self, candidate: _Candidate, widened: bool = False) -> tuple[Setting, Setting]:
        """Return the coefficients of a set at the mode, and their standard deviations; ``widened``:
        by the scatter over blocks and flights.
        """
        base = candidate.base
        columns = candidate.columns
        mode, deviations = candidate.evidence.mode, candidate.evidence.std
        if widened:
            deviations = deviations * base.scatter(columns, mode, self.power)
        setting = {e: dict(self.flights.coefficients({}, e)) for e, *_ in columns}
        std: dict[str, NamedNumbers] = {e: {} for e in setting}
        size = base.size[base.at(columns)]
        sized = zip(columns, (mode * size).tolist(), (deviations * size).tolist(), strict=True)
        for c, x, deviation in sized:
            own = setting[c.effect]
            if c.part == Part.START:
                own |= base.starts[c]
                if moves_time(c.effect):
                    own[get(c.effect).coefficients[0].name] *= x
                continue
            own[c.coefficient] = changed(c, x, self.flights)
            std[c.effect][c.coefficient] = deviation
            if c.part == Part.AT_CENTRE:
                own[CENTRAL] = 1.0
        return setting, std

    def ranking(self, quieter: Base | None) -> Ranking:
        """Return probabilities; ``quieter`` as of ``structure``."""
        p = dict(zip(self.scores, softmax([*self.scores.values()]).tolist(), strict=True))
        probability = {e: sum(x for k, x in p.items() if e in k) for e in self.library}
        best = self._ranked
        sets = tuple(
            RankedSet(
                tuple(sorted(key)),
                p[key],
                *self._at_mode(self.known[key], p[key] >= LEAST_RIVAL * p[best[0]]),
            )
            for key in best
            if p[key] >= LEAST_PROBABILITY
        )
        return Ranking(probability, sets, self.structure(quieter), self.power)
