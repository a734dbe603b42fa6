"""The moves of the search for what a model lacks: whole effects are added, removed, and swapped for
others.

Each is judged on blocks of the fit that are left out in turn; nothing here looks at the held-out
rows.
"""

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...dynamics.effects import get
from .gram_matrix import Gram
from .innovations import Innovations, confirms_addition
from .search import (
    SEARCH,
    FittedEffects,
    Gain,
    Regression,
    Search,
    coefficient_count,
    is_possible,
    with_changes,
)


@dataclass(frozen=True)
class StepwiseSettings:
    """What a move of the search must pay.

    Deviances are on left-out blocks.
    """

    most_effects: int = 4
    rounds: int = 2  # of adding and pruning; what changes further stands for an unlisted effect
    # times the least reduction; an effect that explains so much may have half the least size
    large_reduction_ratio: float = 4.0
    # typical sizes, the least size of an effect that scales a measurement: it is wrong by the share
    # of noise in what is measured
    least_size_of_scale: float = 0.25
    swap_reduction: float = 12.0  # deviance by which one effect in place of another must be better
    most_moves: int = 3  # of one pruning; a move takes seconds where four effects stand for one
    most_replacements: int = 2  # single effects tried in place of others, the best first
    most_candidates: int = 8  # tried for one place, the best first, if innovations reject them
    # effects; up to so many, replacements are tried with columns linearised without the effects
    most_relinearised: int = 2
    # share of what effects explain, which a refit may gain beyond the linear prediction
    most_refit_gain: float = 0.2


STEPWISE = StepwiseSettings()


def find_effects(search: Search) -> tuple[FittedEffects, list[Gain]]:
    """Return the effects that are needed, and what each effect of the library explained alone at
    first.
    """
    needed = FittedEffects({})
    first: list[Gain] = []
    asked: list[set[str]] = []
    for _ in range(STEPWISE.rounds):
        fit, gains = _forward(search, needed)
        first = first or gains
        if asked and fit.effects == needed.effects:
            break
        search.report("asking whether every effect is needed")
        # with the noise as estimated by now
        needed = _prune(search, search.refit(fit))
        if needed.effects == fit.effects or set(needed.effects) in asked:
            break
        # one effect in place of two leaves room for more, and an effect that was small beside a
        # wrong one may be large beside the right one
        asked.append(set(needed.effects))
    return _confirmed_effects(search, needed), first


def with_proposal(
    search: Search, fit: FittedEffects, proposed: Mapping[str, Mapping[str, float]]
) -> FittedEffects:
    """Return a fit, or that of the effects that another search proposes, with its coefficients, if
    they explain the residual better.
    """
    if set(proposed) == set(fit.effects) or not set(proposed) <= set(search.library):
        return fit
    other = fit.without(*fit.effects)
    other.setting |= {k: dict(v) for k, v in proposed.items()}
    error, cost = search.error(fit), SEARCH.deviance_per_coefficient
    saved = sum(map(coefficient_count, fit.effects)) - sum(map(coefficient_count, proposed))
    swap = Swap(tuple(proposed), other, error + cost * saved - STEPWISE.swap_reduction)
    better = _first_better(search, [swap], fit, fit.effects)
    return _confirmed_effects(search, _prune(search, better[0])) if better else fit


def are_told_apart(search: Search, fit: FittedEffects) -> bool:
    """Return whether no effect of a fit is explained by the others. In a hover mass and thrust are,
    and rounding gives each a size of its own.
    """
    g = search.gram_at(fit)
    total = g.blocks.sum(axis=0)
    return not any(
        search.not_identifiable(g, total, g.columns, g.value, effect) for effect in fit.effects
    )


def _confirmed_effects(search: Search, fit: FittedEffects) -> FittedEffects:
    """Return a fit without the effects that the innovations do not confirm beside the others."""
    if not search.flights.has_innovations:
        return fit
    for effect in fit.effects:
        if not _is_confirmed(search, fit, effect):
            search.report(f"{effect} is a feedback-induced correlation")
            return _confirmed_effects(search, search.refit(fit.without(effect)))
    return fit


def _is_confirmed(search: Search, fit: FittedEffects, effect: str) -> bool:
    return Innovations(search.flights, fit.without(effect).setting).confirm(fit.setting)


def _forward(search: Search, fit: FittedEffects) -> tuple[FittedEffects, list[Gain]]:
    """Return ``fit`` with the effects that are worth adding one after the other, and what each
    explained at first.
    """
    flights, most = search.flights, STEPWISE.most_effects
    first: list[Gain] = []
    for count in range(len(fit.effects), most + 1):
        regression = search.linearise(fit)
        search.set_noise(fit, regression)
        if count == 0:
            fit = search.refit(fit)
        g = search.gram(fit, regression)
        gains = search.gains(fit, regression, g)
        first = first or gains
        least = _least(g.error(g.index(search.model_columns(fit.effects))))
        better = [x for x in gains if _is_worth_naming(x, least)]
        if not better or count == most:
            break
        for gain in better[: STEPWISE.most_candidates]:
            search.report(f"trying {gain.effect}")
            more = search.refit(gain.fit)
            # innovations contradict what cannot be
            if are_told_apart(search, more) and (
                confirms_addition(flights, fit.setting, more.setting)
                if flights.has_innovations
                else is_possible(more, flights.vehicle)
            ):
                break
        else:
            break
        fit = more
    return fit, first


def _prune(search: Search, fit: FittedEffects) -> FittedEffects:
    """Return a fit in which every effect is needed beside the others, and no one or two effects
    have a better replacement.
    """
    error = search.error(fit)
    failed: dict[frozenset[str], float] = {}
    for _ in range(STEPWISE.most_moves):
        better = _best_move(search, fit, error, failed)
        if better is None:
            break
        fit, error = better
    return fit


def _best_move(
    search: Search, fit: FittedEffects, error: float, failed: dict[frozenset[str], float]
) -> tuple[FittedEffects, float] | None:
    """Return a better fit and its error: without one effect, one in place of two or one, or two in
    place of one or many.

    ``failed`` keeps the error that no replacement of these effects could reach, so that it is not
    tried again.
    """
    least = _least(error)
    for effect in fit.effects:
        if search.error_without(fit, effect) < error + least:
            search.report(f"{effect} is not needed")
            less = search.refit(fit.without(effect))
            return less, search.error(less)
    few = len(fit.effects) <= STEPWISE.most_relinearised
    if not few:  # no small step leads from three or four effects to the right two
        less, spared = (
            fit.without(*fit.effects),
            SEARCH.deviance_per_coefficient * sum(map(coefficient_count, fit.effects)),
        )
        regression = search.linearise(less)
        g, bar = search.gram(less, regression), error - STEPWISE.swap_reduction + spared
        couple = _pair_swap(search, less, regression, g, search.library, bar)
        if better := _first_better(search, couple, fit, fit.effects):
            return better
    for size, allowed in ((2, least), (1, -STEPWISE.swap_reduction)):
        for group in itertools.combinations(fit.effects, size):
            less, spared = (
                fit.without(*group),
                SEARCH.deviance_per_coefficient * sum(map(coefficient_count, group)),
            )
            rest, bar = frozenset(less.effects), error + allowed + spared
            if bar <= failed.get(rest, -np.inf):
                continue
            failed[rest] = bar
            regression = search.linearise(less, None if few else fit)
            g = search.gram(less, regression)
            rivals = [x for x in search.gains(less, regression, g) if x.effect not in group]
            if better := _first_better(
                search, _single_swaps(rivals, error, allowed, bar), fit, group
            ):
                return better
            if few and size == 1:
                others = [
                    e for e in search.library if e not in group
                ]  # adding one effect has been tried already
                couple = _pair_swap(search, less, regression, g, others, error - least + spared)
                if better := _first_better(search, couple, fit, group):
                    return better
    return None


@dataclass(frozen=True, eq=False)
class Swap:
    """Effects that may replace others."""

    effects: tuple[str, ...]
    fit: FittedEffects  # with them, before it is refitted
    limit: float  # of its deviance


def _first_better(
    search: Search, swaps: Iterable[Swap], old: FittedEffects, group: Sequence[str]
) -> tuple[FittedEffects, float] | None:
    """Return the first swap for a group of a fit's effects that stays below its limit when
    refitted, and its error.
    """
    for swap in swaps:
        fit = search.refit(swap.fit, swap.limit)
        better = (
            search.deviance(fit.setting) < swap.limit and (error := search.error(fit)) < swap.limit
        )
        if (
            better
            and are_told_apart(search, fit)
            and (len(swap.effects) == 1 or all(_is_confirmed(search, fit, e) for e in swap.effects))
        ):
            search.report(f"{' and '.join(swap.effects)} in place of {' and '.join(group)}")
            return fit, error
    return None


def _single_swaps(
    rivals: Sequence[Gain], error: float, allowed: float, bar: float
) -> Iterator[Swap]:
    """Yield the single effects that may do better than ``bar`` minus the cost of their
    coefficients.
    """
    for rival in rivals[: STEPWISE.most_replacements]:
        # a nonlinear effect may do better than its linearisation, within limits
        near = rival.deviance_left <= error + allowed + STEPWISE.most_refit_gain * (
            rival.deviance_left + rival.deviance_reduction - error
        )
        if near and rival.size > _least_size(rival.effect):
            yield Swap(
                (rival.effect,),
                rival.fit,
                bar - SEARCH.deviance_per_coefficient * coefficient_count(rival.effect),
            )


def _pair_swap(
    search: Search,
    fit: FittedEffects,
    regression: Regression,
    g: Gram,
    library: Sequence[str],
    bar: float,
) -> Iterator[Swap]:
    """Yield the best pair of effects of ``library`` beyond a fit, if it is better than ``bar``
    minus the cost of its coefficients.

    The search does not reach a pair through either effect alone. Two effects together are nearly
    linear.
    """
    total, least, best = g.blocks.sum(axis=0), bar, None
    for both in itertools.combinations(
        [e for e in library if e not in search.nonlinear_effects and e not in fit.effects], 2
    ):
        wanted = search.model_columns(fit.effects, both)
        if not regression.columns.keys() >= set(wanted):
            continue
        cost = SEARCH.deviance_per_coefficient * sum(map(coefficient_count, both))
        if (left := g.error(g.index(wanted)) + cost) >= least:
            continue
        change = g.solve(total, g.index(wanted))
        if not any(
            search.not_identifiable(g, total, wanted, change, e)
            or search.size(wanted, change, e) <= _least_size(e)
            for e in both
        ):
            least, best = (
                left,
                Swap(both, with_changes(search.flights, fit, wanted, change, *both), bar - cost),
            )
    if best:
        yield best


def _least(error: float) -> float:
    """Return the deviance that an effect must explain of flights with such an unexplained
    deviance.
    """
    return max(SEARCH.least_deviance_reduction, SEARCH.least_share_of_deviance * error)


def _least_size(effect: str) -> float:
    """Return the size, in typical ones, above which an effect is worth a name."""
    return STEPWISE.least_size_of_scale if get(effect).scales_noise else SEARCH.least_size


def _is_worth_naming(gain: Gain, least: float) -> bool:
    """Return whether an effect explains enough, and is large enough, to be named."""
    size = _least_size(gain.effect)
    return gain.deviance_reduction > least and gain.size > (
        size if gain.deviance_reduction < STEPWISE.large_reduction_ratio * least else 0.5 * size
    )
