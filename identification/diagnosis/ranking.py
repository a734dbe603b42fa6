"""Which effects act: the posterior over sets, and what they leave unexplained.

Every effect of the library is as likely as every other before the flight, and one is expected to be
missing. Where poses and rotors were measured as they were, a set's evidence is that of the likelier
noise of two: that beside no effect, and that beside the best set, because what is not explained
counts as a disturbance.

Of other flights (rotors known by commands, a pose that was filtered, a motion read from an IMU)
rows of forces and, where rotors are measured, of torques are explained, with one noise for all
sets. The likeliest set is fitted without linearisation, and so is each that comes out likeliest
after it, until none does that was not fitted.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...dynamics.effects import get
from ..findings import Disturbance, Ranking
from .climbing import Height, linearised, mode
from .evidence import set_evidence
from .likelihood import Likelihood
from .priors import Base, Setting, Starts, prior_size
from .regression import START_PREFIX, Column, Flights, moves_time, typical_size, without
from .row_likelihood import RowLikelihood
from .sets import Posterior, is_possible
from .starting_points import starting_points

Array = NDArray[np.float64]


# typical sizes at which a lag or a delay is tried as a whole: their columns change with them
TIME_STARTS = (0.3, 0.6, 1.2)
# share of the likeliest set's probability from which another effect in a place of it is one that
# the flights do not tell from it: a likelihood of 20 to 1
LEAST_RIVAL = 0.05
ROUNDS = 6  # of fitting the noise beside the best set
# standard deviations of its prior, by which a coefficient moves in the last of these rounds at most
CLOSE = 0.1
MOST_STARTS = 2  # of an effect with nonlinear coefficients, the likeliest, that are fitted by rows


@dataclass(frozen=True, eq=False)
class Found:
    """The posterior of flights, and what the likeliest set is a fit of."""

    posterior: Posterior
    ranking: Ranking
    setting: Setting  # coefficients of the likeliest set
    # of each channel, where the likelihood has a noise of the motion; none for a force balance
    gusts: tuple[Disturbance, ...] = ()
    # biases and time offsets of the sensors, with their standard deviations
    sensors: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    # of each effect of the set, those that the logs do not show and that do as well in its place
    behind: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


def rank(
    flights: Flights,
    library: Sequence[str],
    report: Callable[[str], None] = lambda text: None,
) -> Found:
    """Return the posterior over sets of effects of a library, of those that flights can show.

    Args:
        flights: whose poses are explained.
        library: names of effects that may act.
        report: called with a line of progress.
    """

    def height(x: Setting, near: Likelihood) -> Height:
        base = Likelihood(flights, x, near, same_noise=True).base(x, {})
        return linearised(flights, base, x)

    def fitted(setting: Setting, near: Likelihood) -> Likelihood:
        report(f"trying {', '.join(setting)}")
        tried[frozenset(setting)] = setting
        # a slow disturbance does much of what a steady effect does: each is fitted beside the other
        for _ in range(ROUNDS):
            near, begun = Likelihood(flights, setting, near), setting
            setting = mode(begun, partial(height, near=near))
            moved = (
                abs(x - begun[e].get(n, 0.0)) / prior_size((e, n), flights)
                for e, own in setting.items()
                for n, x in own.items()
            )
            if max(moved) < CLOSE:
                break
        return Likelihood(flights, setting, near, same_noise=True)

    def around(best: Likelihood) -> tuple[Starts, Posterior]:
        starts = starts_of(flights, library, best.setting, {})
        return starts, Posterior(flights, library, (loud, best.base(library, starts)))

    def alone(best: Likelihood) -> float:
        base = best.base(best.setting, {})
        found = Posterior(flights, [*best.setting], (base, base))
        return found.scores.get(frozenset(best.setting), -math.inf)

    def first() -> tuple[Likelihood, Starts, Base]:
        nothing, starts = Likelihood(flights, {}), starts_of(flights, library, {})
        return nothing, starts, nothing.base(library, starts)

    # made anew at the end where no set is likeliest: its columns of ten minutes take 0.5 GB
    best, starts, loud = first()
    everything = loud.mode(np.append(loud.plain, loud.at(loud.asked)))
    quiet = best.quieter({c: x for c, (x, _) in everything.items()}, starts)
    found = Posterior(flights, library, (loud, quiet))
    # as it was asked for: where a fit ends, a little of other effects beside it moves what is asked
    tried: dict[frozenset[str], Setting] = {frozenset(): {}}
    # the best effect first, alone: another set's columns are those of the model that has it
    if setting := found.best_setting(1):
        best = fitted(setting, best)
        score = alone(best)
        starts, found = around(best)
        # what is alike counts as a disturbance beside it: each is judged beside its own noise
        rivals = [fitted(x, best) for x in found.rivals(setting)]
        scores = [score, *map(alone, rivals)]
        if max(scores) > score:
            best = [best, *rivals][scores.index(max(scores))]
            starts, found = around(best)
        del rivals  # each holds a tenth of what a diagnosis takes
    for _ in range(ROUNDS):
        # the columns of the same set change with its coefficients, where these have moved far
        setting = found.best_setting()
        if not found.is_elsewhere(setting, tried):
            break
        best = fitted(setting, best)
        starts, found = around(best)
    # once more, with the dictionary's columns, that are dear, beside the likeliest set
    setting = found.best_setting()
    if setting.keys() != best.setting.keys():
        best = Likelihood(flights, setting, best) if setting else first()[0]
        starts = starts_of(flights, library, setting, *([{}] if setting else []))
    whole = best.base(library, starts, unknown=True)
    found = Posterior(flights, library, (loud, whole), found.tempering())
    column, size, gained = found.strangest()
    # of so many columns one explains as much by chance, and no noise beside it would be likelier
    by_chance = 2.0 * math.log(len(whole.dictionary))
    ranking = found.ranking(best.quieter({column: size}, starts) if gained > by_chance else None)
    late = {c[1]: x for c, x in found.nuisances().items() if c in flights.offsets}
    return Found(found, ranking, found.best_setting(), best.gusts(), late)


def rank_by_rows(
    flights: Flights,
    library: Sequence[str],
    first: Setting,
    fixed: Setting,
    report: Callable[[str], None] = lambda text: None,
) -> Found:
    """Return the posterior over sets of effects of a library.

    Args:
        flights: of the vehicle.
        library: effects that may act, those of ``first`` among them.
        first: effects that any set has, with coefficients about which a fit begins; none where
            rotors are measured.
        fixed: effects that are known from elsewhere, with their coefficients.
        report: called with a line of progress.
    """
    likelihood = RowLikelihood(flights, library, first, fixed)
    library = likelihood.library
    first = {e: x for e, x in first.items() if e in library}
    given = frozenset(first)
    first = likelihood.fitted(first)
    starts = starts_of(flights, library, first)
    fitted: dict[frozenset[str], Setting] = {given: first}
    bases: dict[frozenset[str], Base] = {given: likelihood.base(first, starts)}
    idle: set[frozenset[str]] = set()

    def base(setting: Setting, unknown: bool = False) -> Base:
        lags = {
            c: x
            for c, x in starts.items()
            if not flights.is_nonlinear(c[0]) and c[0] not in setting
        }
        return likelihood.base(setting, lags, unknown=unknown)

    def add(setting: Setting) -> None:
        key = frozenset(setting)
        if any(map(flights.is_nonlinear, setting)):  # what was linearised elsewhere says little
            near = fitted[max(fitted, key=lambda other: len(other & key))]
            begun = {e: near.get(e, x) for e, x in setting.items()}
            setting = min(setting, begun, key=likelihood.objective)
        fitted[key] = likelihood.fitted(setting)
        found = set(fitted[key]) - given
        if likelihood.idle(fitted[key], found) or not all(
            is_possible(flights, fitted[key], {}, e, plausible=True) for e in found
        ):
            idle.add(key)
            return
        bases[key] = base(fitted[key])

    for effect in library:
        if not flights.is_nonlinear(effect) or effect in given:
            continue
        report(f"trying {effect}")
        own = [{**first, effect: dict(x)} for c, x in starts.items() if c[0] == effect]
        own.sort(key=likelihood.objective)
        if own:
            near = map(likelihood.fitted, own[:MOST_STARTS])
            add(min(near, key=likelihood.objective))

    def posterior() -> Posterior:
        return Posterior(flights, library, [*bases.values()], likelihood.power, given, idle)

    def likeliest() -> Setting:
        """Return the likeliest set's fit, once no set is likelier that was not fitted, nor, where
        rotors are measured, one that lacks one of its effects.
        """
        while True:
            setting = posterior().best_setting(len(library))
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
    bases.pop(frozenset(best))  # the last is the one that has the dictionary
    bases[frozenset(best)] = base(best, unknown=True)
    found = posterior()
    sensors, behind = likelihood.sensors(best), _behind(likelihood, best)
    return Found(found, found.ranking(), best, sensors=sensors, behind=behind)


def _behind(likelihood: RowLikelihood, best: Setting) -> dict[str, tuple[str, ...]]:
    """Return of each effect of a set those which logs do not show and which may act all the same,
    that explain the flights as well in its place.
    """
    flights = likelihood.flights
    unseen = sorted(flights.needs_pose - flights.without_trace - set(best))
    hidden = [e for e in unseen if not flights.is_nonlinear(e)]
    if not hidden or not best:
        return {}
    base = likelihood.base(best, {}, [*best, *hidden])
    at = base.at(base.asked)
    m = base.marginal(at, base.plain, power=likelihood.power)

    def explained(effects: set[str]) -> float:
        index = [i for i, (effect, _) in enumerate(base.asked) if effect in effects]
        return m.explained(index, set_evidence(m, index, base.low[at], base.high[at]).mode)

    # up to the deviance of a rival's likelihood
    whole = explained(set(best)) + 2.0 * math.log(LEAST_RIVAL)
    found = {e: tuple(h for h in hidden if explained({*best, h} - {e}) > whole) for e in best}
    return {e: others for e, others in found.items() if others}


def starts_of(
    flights: Flights, library: Sequence[str], setting: Setting, *others: Setting
) -> Starts:
    """Return columns of whole effects that are not in a setting, with the coefficients of each:
    lags and delays, and effects whose coefficients do nothing one by one. These start from what the
    setting leaves unexplained, and what ``others`` do: an effect may act in the place of another.
    """
    out: dict[Column, Mapping[str, float]] = {}
    residuals: list[Array] = []
    beside = [*setting, *(e.name for e in flights.vehicle.effects)]
    for effect in (e for e in library if e not in setting):
        found: list[Mapping[str, float]] = []
        if moves_time(effect) and get(effect).kind == "rotor input":
            name = get(effect).coefficients[0].name
            typical = typical_size((effect, name), flights.vehicle)
            found = [{name: share * typical} for share in TIME_STARTS]
        elif flights.is_nonlinear(effect):
            residuals = residuals or [flights.residual(x) for x in (setting, *others)]
            stated = flights.stated(effect)
            for y in residuals:
                starts = starting_points(effect, flights, y, stated, beside)
                found += [{**start, **stated} for start in starts]
        out |= {(effect, f"{START_PREFIX}{i}"): start for i, start in enumerate(found)}
    return out
