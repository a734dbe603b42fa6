"""The posterior over sets of effects, and the residual beside them.

Before the flight every effect of the library is equally likely, and one is expected to be missing.
With poses and rotors as measured, a set has the evidence of the likelier noise of two: beside no
effect, and beside the best set. The reason: an unexplained force counts as a disturbance.

Other flights have rotors known by commands, a filtered pose, or a motion read from an IMU. There
rows of forces and, with measured rotors, of torques are explained, with one noise for all sets. The
likeliest set is fitted without linearisation, and so is each next likeliest, until the likeliest is
a fitted one.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain

import numpy as np

from ...dynamics.effects import get
from ..findings import LEAST_RIVAL, Disturbance, Ranking
from ..logs.table import Names, Pair, Values
from .climbing import Height, linearised, mode
from .column import Column, Part
from .likelihood import Likelihood
from .priors import Base, Setting, Starts, prior_size
from .regression import (
    Effects,
    RegressedFlights,
    moves_time,
    typical_size,
    without,
)
from .row_likelihood import RowLikelihood
from .sets import Posterior, is_possible
from .starting_points import starting_points

Report = Callable[[str], None]  # takes a line of progress
# typical sizes of the trials of a lag or a delay as a whole: their columns change with them
TIME_STARTS = (0.3, 0.6, 1.2)
ROUNDS = 6  # of fitting the noise beside the best set
# standard deviations of its prior: largest step of a coefficient in the last of these rounds
CLOSE = 0.1
MOST_STARTS = 2  # likeliest starts of an effect with nonlinear coefficients, fitted by rows


@dataclass(frozen=True, eq=False)
class FittedPosterior:
    """The posterior of flights, and the fit of the likeliest set."""

    posterior: Posterior
    ranking: Ranking
    needed: Setting  # coefficients of the likeliest set's needed effects
    gains: Mapping[str, Pair]  # as of ``Posterior.leave_out_needless``
    # of each channel, for a likelihood with a noise of the motion; none for a force balance
    gusts: tuple[Disturbance, ...]
    # biases and time offsets of the sensors, with their standard deviations
    sensors: Mapping[str, Pair]
    # for each effect of the set: effects hidden in these logs that do as well in its place
    behind: Mapping[str, Names]


def rank(
    flights: RegressedFlights,
    library: Sequence[str],
    report: Report,
) -> FittedPosterior:
    """Return the posterior over sets of effects of a library.

    Args:
        flights: flights with poses to explain.
        library: names of effects that these flights can show.
        report: called with a line of progress.
    """

    def height(x: Setting, near: Likelihood) -> Height:
        here = near if x is near.setting else Likelihood(flights, x, near, same_noise=True)
        return linearised(flights, here.base(x, {}), x)

    def fitted(setting: Setting, near: Likelihood) -> Likelihood:
        report(f"trying {', '.join(setting)}")
        tried[frozenset(setting)] = setting
        steady = settled(setting, near)
        if not any(get(e).sets_wind for e in setting):
            return steady
        return max(steady, settled(steady.setting, steady, gusty=True), key=alone)

    def settled(setting: Setting, near: Likelihood, gusty: bool = False) -> Likelihood:
        # a slow disturbance does much of what a steady effect does: each is fitted beside the other
        for _ in range(ROUNDS):
            try:
                near = Likelihood(flights, setting, near, gusty=gusty)
            except np.linalg.LinAlgError:  # the filter diverges: halfway to the declared vehicle
                setting = {e: {n: 0.5 * x for n, x in own.items()} for e, own in setting.items()}
                continue
            begun = setting
            setting = mode(begun, partial(height, near=near))
            moved = (
                abs(x - begun[e].get(n, 0.0)) / prior_size(Column(e, n), flights)
                for e, own in setting.items()
                for n, x in own.items()
            )
            if max(moved) < CLOSE:
                break
        return Likelihood(flights, setting, near, same_noise=True)

    def starts(setting: Setting) -> Starts:
        return _starts_of(flights, library, setting, *([{}] if setting else []))

    def around(best: Likelihood) -> Posterior:
        return Posterior(flights, library, (loud, best.base(library, starts(best.setting))))

    def alone(best: Likelihood) -> float:
        bases = [best.base(best.setting, {})] * 2
        scores = Posterior(flights, [*best.setting], bases).scores
        return scores.get(frozenset(best.setting), -math.inf)

    # made anew at the end if no set is likeliest: its columns of ten minutes take 0.5 GB
    best = Likelihood(flights, {})
    begun = starts({})
    loud = best.base(library, begun)
    everything = loud.mode(np.append(loud.plain, loud.at(loud.asked)))
    beside = {c: x for c, (x, _) in everything.items()}
    posterior = Posterior(flights, library, (loud, best.quieter(beside, begun)))
    # settings as asked for: beside the end of a fit, a little of other effects moves the request
    tried: dict[Effects, Setting] = {frozenset(): {}}
    # the best effect first, alone: another set's columns are of the model with that effect
    if setting := posterior.best_setting(1):
        best = fitted(setting, best)
        posterior = around(best)
        # a similar effect counts as a disturbance beside it: each is judged beside its own noise
        # one after the other: each holds a tenth of a diagnosis' memory
        each = (fitted(rival, best) for rival in posterior.rivals(setting))
        best = max(chain([best], each), key=alone)
        if best.setting.keys() != setting.keys():
            posterior = around(best)
    for _ in range(ROUNDS):
        # the columns of the same set change with its coefficients, if these have moved far
        setting = posterior.best_setting()
        if not posterior.is_elsewhere(setting, tried):
            break
        best = fitted(setting, best)
        posterior = around(best)
    # once more, with the dictionary's costly columns, beside the likeliest set
    setting = posterior.best_setting()
    if setting.keys() != best.setting.keys():
        near = best if setting else None
        best = Likelihood(flights, setting, near, gusty=near is not None and near.gusty)
    begun = starts(best.setting)
    whole = best.base(library, begun, unknown=True)
    posterior = Posterior(flights, library, (loud, whole), posterior.tempering())
    column, size, gained = posterior.strangest()
    # among so many columns one explains as much by chance, and no noise beside it is likelier
    by_chance = 2.0 * math.log(len(whole.dictionary))
    quieter = best.quieter({column: size}, begun) if gained > by_chance else None
    ranking = posterior.ranking(quieter)
    setting, gains = posterior.leave_out_needless(ranking.probability)
    late = {c.coefficient: x for c, x in posterior.nuisances().items() if c in flights.offsets}
    return FittedPosterior(posterior, ranking, setting, gains, best.gusts(), late, {})


def rank_by_rows(
    flights: RegressedFlights,
    library: Sequence[str],
    first: Setting,
    fixed: Setting,
    report: Report,
) -> FittedPosterior:
    """Return the posterior over sets of effects of a library.

    Args:
        flights: the vehicle's flights.
        library: names of effects, with ``first``.
        first: effects of every set, with coefficients for the start of a fit; none with measured
            rotors.
        fixed: effects known from elsewhere, with their coefficients.
        report: called with a line of progress.
    """
    likelihood = RowLikelihood(flights, library, first, fixed)
    library = likelihood.library
    first = {e: x for e, x in first.items() if e in library}
    given = frozenset(first)
    first = likelihood.fitted(first)
    starts = _starts_of(flights, library, first)
    fitted = {given: first}
    bases = {given: likelihood.base(first, starts)}
    idle = set()

    def base(setting: Setting, unknown: bool = False) -> Base:
        lags = {
            c: x
            for c, x in starts.items()
            if not flights.is_nonlinear(c.effect) and c.effect not in setting
        }
        return likelihood.base(setting, lags, unknown=unknown)

    def add(setting: Setting) -> None:
        key = frozenset(setting)
        if any(map(flights.is_nonlinear, setting)):  # a linearisation elsewhere says little
            near = fitted[max(fitted, key=lambda other: len(other & key))]
            begun = {e: near.get(e, x) for e, x in setting.items()}
            setting = min(setting, begun, key=likelihood.objective)
        fitted[key] = best = likelihood.fitted(setting)
        own = key - given
        if likelihood.idle(best, own) or not all(
            is_possible(flights, best, {}, e, plausible=True) for e in own
        ):
            idle.add(key)
        else:
            bases[key] = base(best)

    for effect in library:
        if not flights.is_nonlinear(effect) or effect in given:
            continue
        report(f"trying {effect}")
        each = ({**first, effect: dict(x)} for c, x in starts.items() if c.effect == effect)
        if own := sorted(each, key=likelihood.objective):
            near = map(likelihood.fitted, own[:MOST_STARTS])
            add(min(near, key=likelihood.objective))

    def posterior() -> Posterior:
        return Posterior(flights, library, [*bases.values()], likelihood.power, given, idle)

    def likeliest() -> Setting:
        """Return the likeliest set's fit, once no unfitted set is likelier. With measured rotors
        the sets with one effect less are fitted as well.
        """
        while True:
            setting = posterior().best_setting()
            new = [setting]
            if (key := frozenset(setting)) in bases:
                best = fitted[key]
                less = [without(best, out) for out in best if out not in given]
                new = [x for x in less if not flights.commanded and frozenset(x) not in fitted]
            if not new:
                return best
            for some in new:
                report(f"trying {', '.join(e for e in some if e not in given) or 'no effect'}")
                add(some)

    likeliest()
    likelihood.power = posterior().tempering()
    best = likeliest()
    bases.pop(frozenset(best))  # the last base has the dictionary
    bases[frozenset(best)] = base(best, unknown=True)
    last = posterior()
    ranking = last.ranking(None)
    setting, gains = last.leave_out_needless(ranking.probability)
    setting = best if setting.keys() == best.keys() else likelihood.fitted(setting)
    return FittedPosterior(
        last,
        ranking,
        setting,
        gains,
        (),
        likelihood.sensors(setting),
        _behind(likelihood, setting),
    )


def _behind(likelihood: RowLikelihood, best: Setting) -> dict[str, Names]:
    """Return, for each effect of a set, possible effects hidden in the logs with as much explained
    in its place.
    """
    flights = likelihood.flights
    unseen = sorted(flights.needs_pose - flights.without_trace - set(best))
    hidden = [e for e in unseen if not flights.is_nonlinear(e)]
    if not hidden or not best:
        return {}
    base = likelihood.base(best, {}, [*best, *hidden])
    m = base.marginal(base.asked, base.plain, likelihood.power)

    def explained(effects: set[str]) -> float:
        return m.gain([c for c in m.place if c.effect in effects])

    # up to the deviance of a rival's likelihood
    whole = explained(set(best)) + 2.0 * math.log(LEAST_RIVAL)
    return {e: tuple(h for h in hidden if explained({*best, h} - {e}) > whole) for e in best}


def _starts_of(
    flights: RegressedFlights, library: Sequence[str], setting: Setting, *others: Setting
) -> Starts:
    """Return columns of whole effects outside a setting, with the coefficients of each: lags and
    delays, and effects whose coefficients do nothing one by one. The latter start from the residual
    of the setting, and of ``others``: an effect may act in the place of another.
    """
    out: dict[Column, Values] = {}
    beside = [*setting, *(e.name for e in flights.vehicle.effects)]
    for effect in (e for e in library if e not in setting):
        own = []
        if moves_time(effect) and get(effect).kind == "rotor input":
            name = get(effect).coefficients[0].name
            typical = typical_size(Column(effect, name), flights.vehicle)
            own = [{name: share * typical} for share in TIME_STARTS]
        elif flights.is_nonlinear(effect):
            stated = flights.stated(effect)
            for x in (setting, *others):
                starts = starting_points(effect, flights, flights.residual(x), stated, beside)
                own += [{**start, **stated} for start in starts]
        out |= {Column(effect, "", Part.START, i): start for i, start in enumerate(own)}
    return out
