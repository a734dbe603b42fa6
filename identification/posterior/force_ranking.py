"""Which effects act on flights whose pose is no measurement as it was made: the posterior over
sets, from rows of forces and, where rotors are measured, of torques.

Such are flights whose rotors are known by commands, whose pose was filtered before it was logged,
and whose motion is read from an IMU.

The likeliest set is fitted without linearisation, and so is each set that comes out likeliest after
it, until none does that was not fitted.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..findings import Ranking
from ..inference.regression import START_PREFIX, Column, Flights, coefficient
from ..inference.sensor_bias import PREFIX
from .evidence import marginal, set_evidence
from .force_likelihood import ForceLikelihood
from .likelihood import NUISANCE
from .priors import Base, Setting, declared
from .ranking import starts_of
from .sets import Posterior, is_possible

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ForceRankingSettings:
    """Which starts are fitted, and what counts as hidden."""

    most_starts: int = 2  # of an effect with nonlinear coefficients, the likeliest, that are fitted
    # deviance by which an effect of typical size is sure: of one of some thirty effects, before
    # which one is expected, 20 to 1 afterwards
    shown: float = 13.0


FORCE_RANKING = ForceRankingSettings()


@dataclass(frozen=True, eq=False)
class ForceRanking:
    """The posterior, and the likeliest set's fit."""

    ranking: Ranking
    likelihood: ForceLikelihood
    setting: Setting  # of the likeliest set
    strangest: tuple[Column, float]  # beside it, of the dictionary, and the deviance it explains
    beside_unknown: Mapping[str, float]  # probability of each effect, where that acts as well
    _base: Base  # about the likeliest set
    _alone: Base  # about what every set has

    def left(self) -> float:
        """Return the deviance that the likeliest set leaves."""
        return self.likelihood.deviance(self.setting)

    def gain(self, effect: str) -> float:
        """Return the deviance by which an effect of the likeliest set is better than all that the
        others and the nuisances do without it.
        """
        base, flights = self._base, self.likelihood.flights
        every = self.likelihood.columns_of(self.setting)
        own = np.array([base.columns[c] for c in every if c[0] == effect], dtype=np.intp)
        others = [base.columns[c] for c in every if c[0] != effect]
        total = self.likelihood.power * base.blocks.sum(axis=0)
        beside = np.array([*base.plain, *others], dtype=np.intp)
        m = marginal(total[:-1, :-1], total[:-1, -1], 0.0, own, beside, np.ones(len(beside)))
        names = list(base.columns)
        z = np.array(
            [
                (self.setting[effect][names[i][1]] - declared(names[i], flights)) / base.size[i]
                for i in own
            ]
        )
        return float(z @ m.normal @ z)

    def hidden_by_bias(self) -> frozenset[str]:
        """Return the effects of which a typical size would be sure if the accelerometer had no
        bias, and is not beside the one that it may have.
        """
        base, flights = self._base, self.likelihood.flights
        if not flights.inertial:
            return frozenset()
        total = self.likelihood.power * base.blocks.sum(axis=0)
        names = list(base.columns)
        own = [base.columns[c] for c in self.likelihood.columns_of(self.setting)]
        every = np.array([*base.plain, *own], dtype=np.intp)
        unbiased = np.array(
            [i for i in every if names[i][0] or NUISANCE + PREFIX not in names[i][1]], dtype=np.intp
        )

        def shown(at: Array, size: Array, beside: Array) -> bool:
            m = marginal(total[:-1, :-1], total[:-1, -1], 0.0, at, beside, np.ones(len(beside)))
            return bool(size @ m.normal @ size >= FORCE_RANKING.shown)

        out = set()
        for effect in self.likelihood.library:
            asked = {c: i for c, i in base.columns.items() if c[0] == effect}
            if effect in self.setting or any(c[1].startswith(START_PREFIX) for c in asked):
                continue
            at = np.array(list(asked.values()), dtype=np.intp)
            signs = np.sign([coefficient(c).typical[0] for c in asked])
            size = signs * base.typical[at]
            if shown(at, size, unbiased) and not shown(at, size, every):
                out.add(effect)
        return frozenset(out)

    def alone_shares(self) -> dict[str, float]:
        """Return the share of the deviance that each effect of the library explains alone, beside
        what every set has.
        """
        base, given = self._alone, self._alone.effects
        total = self.likelihood.power * base.blocks.sum(axis=0)
        beside = [*base.plain, *(i for (e, _), i in base.columns.items() if e in given)]
        asked = np.array([i for (e, _), i in base.columns.items() if e and e not in given])
        others = np.array(beside, dtype=np.intp)
        inner = total[np.ix_(others, others)] + np.eye(len(others))
        known = float(total[others, -1] @ np.linalg.solve(inner, total[others, -1]))
        whole = float(total[-1, -1]) - known
        m = marginal(total[:-1, :-1], total[:-1, -1], 0.0, asked, others, np.ones(len(others)))
        names = list(base.columns)
        ways: dict[tuple[str, str], list[int]] = {}
        for k, i in enumerate(asked):
            effect, name = names[i]
            ways.setdefault((effect, name if name.startswith(START_PREFIX) else ""), []).append(k)
        out: dict[str, float] = {}
        for (effect, _), index in ways.items():
            at = np.array(index)
            z = set_evidence(m, index, base.low[asked], base.high[asked]).mode
            gained = float(2.0 * m.right[at] @ z - z @ m.normal[np.ix_(at, at)] @ z)
            out[effect] = max(out.get(effect, -math.inf), gained / whole)
        return out


def rank_by_force(
    flights: Flights,
    library: Sequence[str],
    first: Setting,
    fixed: Setting,
    report: Callable[[str], None] = lambda text: None,
) -> ForceRanking:
    """Return the posterior over sets of effects of a library.

    Args:
        flights: of the vehicle.
        library: effects that may act, those of ``first`` among them.
        first: effects that any set has, with coefficients about which a fit begins; none where
            rotors are measured.
        fixed: effects that are known from elsewhere, with their coefficients.
        report: called with a line of progress.
    """
    likelihood = ForceLikelihood(flights, library, first, fixed)
    library = likelihood.library
    first = {e: x for e, x in first.items() if e in library}
    given = frozenset(first)
    first = likelihood.fitted(first)
    starts = starts_of(flights, library, first)
    alone = likelihood.base(first, starts)
    fitted: dict[frozenset[str], Setting] = {given: first}
    bases: dict[frozenset[str], Base] = {given: alone}
    lags: dict[Column, dict[str, float]] = {
        c: dict(x) for c, x in starts.items() if not flights.is_nonlinear(c[0])
    }

    idle: set[frozenset[str]] = set()

    def add(setting: Setting) -> None:
        key = frozenset(setting)
        fitted[key] = likelihood.fitted(setting)
        found = set(fitted[key]) - given
        if found & likelihood.idle(fitted[key]) or not all(
            is_possible(flights, fitted[key], {}, e, plausible=True) for e in found
        ):
            idle.add(key)
            return
        others = {c: x for c, x in lags.items() if c[0] not in setting}
        bases[key] = likelihood.base(fitted[key], others)

    for effect in library:
        if not flights.is_nonlinear(effect) or effect in given:
            continue
        report(f"trying {effect}")
        own = [{**first, effect: dict(x)} for c, x in starts.items() if c[0] == effect]
        near = sorted(own, key=likelihood.objective)[: FORCE_RANKING.most_starts]
        if near:
            add(min(map(likelihood.fitted, near), key=likelihood.objective))

    def likeliest() -> Setting:
        """Return the likeliest set's fit, once no set is likelier that was not fitted."""
        while True:
            found = Posterior(flights, library, list(bases.values()), likelihood.power, given, idle)
            setting = found.best_setting(len(library))
            if (key := frozenset(setting)) in bases:
                return fitted[key]
            report(f"trying {', '.join(e for e in setting if e not in given) or 'no effect'}")
            add(setting)

    def confirmed() -> Setting:
        """Return the likeliest set's fit, once no set that lacks one of its effects is likelier
        where it is fitted as well.
        """
        while True:
            best = likeliest()
            less = [{e: x for e, x in best.items() if e != out} for out in best if out not in given]
            new = [x for x in less if frozenset(x) not in fitted]
            if flights.commanded or not new:
                return best
            for setting in new:
                add(setting)

    likelihood.power = likelihood.tempered(confirmed())
    best = confirmed()
    key = frozenset(best)
    others = {c: x for c, x in lags.items() if c[0] not in key}
    bases.pop(key)
    bases[key] = likelihood.base(best, others, unknown=True)
    found = Posterior(flights, library, list(bases.values()), likelihood.power, given, idle)
    return ForceRanking(
        found.ranking(),
        likelihood,
        best,
        found.strangest(),
        found.beside_unknown(),
        bases[key],
        alone,
    )
