"""The judgement of flights whose rotors were measured: the search, its checks and the posterior of
the poses, pooled.

The residual wrench is regressed on whole effects of the library (``inference.search``), every named
effect is compared with what else it could be (``inference.equivalence``), and the residual is
searched for further structure (``inference.residual_structure``).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..dynamics.effects import Role, playing
from .findings import CHANNELS, Candidate, Disturbance, NamedEffect, Ranking
from .inference.carrying_channels import carrying_channels, traces_of
from .inference.coefficient_range import implausible_coefficients
from .inference.equivalence import (
    composite_doubts,
    equivalents,
    unidentifiable_rivals,
    unlisted_equivalent_doubts,
)
from .inference.imu_limits import hidden_by_bias, hidden_causes, with_errors_of_fusion
from .inference.innovations import Innovations
from .inference.likelihood_refit import (
    DelayKind,
    delay_alternatives,
    delay_doubts,
    delay_kind,
    refitted_by_likelihood,
    with_lag,
)
from .inference.regression import CENTRAL, Flights, coefficient, typical_size
from .inference.residual_structure import find_structure
from .inference.search import FittedEffects, Gain, Search
from .inference.stepwise_search import find_effects, with_proposal
from .inference.time_offsets import ROTOR_TIME_OFFSET
from .inference.transient_disturbances import transient_disturbances
from .judged import Judged, Report, balance, calm
from .motion.inertial_signals import pose_rate
from .motion.smoothing import CUTOFFS
from .posterior.deviations import with_both_estimates
from .posterior.pooling import POOLING, SEARCH_ALONE, PoolingSettings, Signs, pooled
from .posterior.ranking import rank


@dataclass(frozen=True)
class SearchVerdictSettings:
    """From when on names of the search are sure."""

    # share of the residual's deviance; a name that explains less beside a large residual is
    # tentative
    least_share_of_residual: float = 0.1
    # with which names are sure, where probabilities are known. On 788 simulated flights 443 of 444
    # sure names were right, and 482 of 489 without it
    least_sure_probability: float = 0.95
    least_rotor_time_offset: float = 0.001  # s, worth a note
    most_period_ratio: float = 1.01  # between logs that one filter of the posterior reads


SEARCH_VERDICT = SearchVerdictSettings()
SMALL, IMPROBABLE = "small beside the residual", "improbable"
FILTERED_NAMES = (
    "the pose was filtered before the log was written. Whether the named effects act on the "
    "vehicle, or follow from feedback-induced correlation, shows only in the sensors' "
    "own noise, so all names are tentative. Log the pose as it was measured"
)


def judged_by_search(
    flights: Flights, library: Sequence[str], probabilities: bool, report: Report
) -> Judged:
    """Return what acts, by the search and, where poses were measured as they were, the posterior.

    Args:
        flights: with measured rotors.
        library: effects that may be named.
        probabilities: whether how probable each name is, is worked out as well.
        report: called with a line of progress.
    """
    vehicle = flights.vehicle
    search = Search(flights, library, report)
    fit, first = find_effects(search)
    ranking = _ranking(flights, search, fit, report) if probabilities else None
    if ranking and ranking.sets:
        fit = with_proposal(search, fit, ranking.sets[0].coefficients)
    rotor_delay = delay_kind(search, fit)
    if rotor_delay == "lag":
        fit = with_lag(search, fit)
    report("asking what else it could be")
    classes = {
        e: (*equivalents(search, fit, e), *unidentifiable_rivals(search, fit, e))
        for e in fit.effects
    }
    classes |= {
        e: tuple(dict.fromkeys([*classes[e], *more]))
        for e, more in delay_alternatives(search, fit, rotor_delay).items()
    }
    report("looking for structure in the residual")
    signs, unconfirmed = find_structure(search, fit)
    fit = refitted_by_likelihood(search, fit)
    doubted_by = _name_doubts(search, fit, rotor_delay)
    name_doubts = [sentence for sentences in doubted_by.values() for sentence in sentences]
    found = balance(flights, fit.setting)
    hidden = hidden_by_bias(search, fit)
    fit = with_errors_of_fusion(search, fit)
    gusts = (
        ()
        if flights.filtered
        else tuple(
            Disturbance(channel, *x)
            for channel, x in zip(
                CHANNELS, Innovations(flights, fit.setting).disturbances(), strict=True
            )
        )
    )
    pushes = () if flights.filtered else tuple(transient_disturbances(flights, fit.setting))
    beyond = beyond_calm(gusts, vehicle.weight, vehicle.arm_l)
    disturbed = bool(pushes) or beyond > 0.0
    some = found.noisy or unconfirmed or disturbed
    remainder = "structured" if signs else "random" if some else "none"
    large = found.noisy if flights.filtered else disturbed
    effects = tuple(
        _named(search, fit, effect, classes[effect], bool(signs or name_doubts), large)
        for effect in fit.effects
    )
    if any(e.tentative for e in effects):
        # what one effect explains too much, another one explains too little
        effects = tuple(replace(effect, tentative=True) for effect in effects)
    stated, weights = None, _pooling(flights, ranking) if probabilities else None
    if ranking:
        effects = with_both_estimates(effects, ranking)
    if weights:
        tests = len({sign.kind for sign in signs})
        stated = pooled(
            effects,
            [(x.effects, x.probability) for x in ranking.sets] if ranking else [],
            Signs(tests, len(doubted_by), beyond, ranking.structure if ranking else 0.0),
            weights,
        )
    notes = _inertial_notes(flights, fit.effects)
    if ranking and stated:
        least = SEARCH_VERDICT.least_sure_probability
        low = {e.name: p for e in effects if (p := stated.names[e.name]) < least}
        if low and not any(effect.tentative for effect in effects):
            effects = tuple(replace(effect, tentative=True) for effect in effects)
            words = " and ".join(f"{name} ({p:.0%})" for name, p in low.items())
            doubted_by[IMPROBABLE] = (f"less probable than {least:.0%}, so tentative: {words}",)
            notes += doubted_by[IMPROBABLE]
    notes += name_doubts
    if large and (few := [e.name for e in effects if _is_small(e.evidence["energy_explained"])]):
        doubted_by[SMALL] = tuple(few)
    return Judged(
        fit.setting,
        found,
        effects,
        remainder,
        tuple(signs),
        _candidates(first, fit),
        (*notes, *_late_rotors(flights, fit)),
        doubted_by,
        hidden,
        gusts,
        pushes,
        ranking,
        stated,
    )


def _late_rotors(flights: Flights, fit: FittedEffects) -> list[str]:
    """Return, as a sentence, by how much rotor speeds act later than they are logged."""
    time_offsets = fit.setting.get(ROTOR_TIME_OFFSET[0], {})
    offset = time_offsets.get(ROTOR_TIME_OFFSET[1], 0.0)
    even = {**fit.setting, ROTOR_TIME_OFFSET[0]: {**time_offsets, ROTOR_TIME_OFFSET[1]: 0.0}}
    if abs(offset) <= SEARCH_VERDICT.least_rotor_time_offset:
        return []
    if not Innovations(flights, even).confirm(fit.setting):
        return []
    return [
        f"the rotor speeds act {abs(1000 * offset):.1f} ms "
        f"{'later' if offset > 0 else 'earlier'} than they are logged"
        + (
            ", or the filter of the pose delays it by as much"
            if flights.filtered and offset > 0
            else ""
        )
    ]


def beyond_calm(disturbances: Sequence[Disturbance], weight: float, arm: float) -> float:
    """Return the logarithm of the largest disturbance of the six channels over what counts for
    none; ``-inf`` where none was fitted.

    Args:
        disturbances: one a channel.
        weight: N, of the vehicle.
        arm: m.
    """
    slow = [x.below(CUTOFFS.calm_hz) for x in disturbances]
    return float(np.log(np.max(slow / calm(weight, arm)))) if slow else -np.inf


def _name_doubts(
    search: Search, fit: FittedEffects, rotor_delay: DelayKind | None
) -> dict[str, tuple[str, ...]]:
    """Return for each check, by its name, the sentences that say why a name may be wrong."""
    flights = search.flights
    found: dict[str, Iterable[str]] = {
        "composite": composite_doubts(flights, fit),
        "unlisted equivalent": unlisted_equivalent_doubts(search, fit),
        "hidden cause": hidden_causes(search, fit),
        "implausible coefficient": implausible_coefficients(search, fit),
    }
    if flights.filtered and fit.effects:
        found["filtered pose"] = [FILTERED_NAMES]
    else:
        found["delay"] = delay_doubts(search, fit, rotor_delay)
    return {check: sentences for check, words in found.items() if (sentences := tuple(words))}


def _ranking(
    flights: Flights, search: Search, fit: FittedEffects, report: Report
) -> Ranking | None:
    """Return the posterior of sets of effects; None where the logs hold no poses and rotor speeds
    as they were measured, or where the vehicle declares effects, of which none is then tried.
    """
    if flights.inertial or flights.filtered or flights.vehicle.effects:
        return None
    periods = [log.period for log in flights.logs]
    if max(periods) > SEARCH_VERDICT.most_period_ratio * min(periods):
        return None
    report("asking how probable each effect is")
    found = {effect: fit.setting[effect] for effect in fit.effects}
    return rank(flights, search.library, found, report)


def _pooling(flights: Flights, ranking: Ranking | None) -> PoolingSettings:
    """Return how findings of such logs become probabilities."""
    if ranking:
        return POOLING
    return SEARCH_ALONE["imu" if flights.inertial else "filtered" if flights.filtered else "pose"]


def _inertial_notes(flights: Flights, effects: Sequence[str]) -> list[str]:
    """Return, as sentences, what follows from a motion that is read from an IMU."""
    if not flights.inertial:
        return []
    rates = [pose_rate(log) for log in flights.logs]
    notes = [
        "the log has no pose: the motion is read from gyro and accelerometer. Horizontal axes are "
        f"those in which the vehicle pointed at t = {flights.logs[0].t[0]:.4g} s, where its flight "
        "begins, and drift with the gyro"
        if not any(rates)
        else f"the log has {min(rates):.3g} positions a second: fast motion is read from gyro and "
        "accelerometer, slow motion from the positions"
    ]
    notes += [
        f"{effect}: an IMU that is mounted tilted by as much leaves the same log"
        for effect in playing(Role.THRUST_AXIS, among=effects)
    ]
    return notes


def _is_small(share: float) -> bool:
    """Return whether an effect explains little beside the residual: ``share`` of both together.

    Of 340 flights with a wrong name it doubts 96, and now one as the only check.
    """
    least = SEARCH_VERDICT.least_share_of_residual
    return share < least / (1.0 + least)


def _named(
    search: Search,
    fit: FittedEffects,
    effect: str,
    others: tuple[str, ...],
    structured: bool,
    noisy: bool,
) -> NamedEffect:
    error = search.error(fit)
    gain = search.error_without(fit, effect) - error
    std = {k: fit.std.get((effect, k), 0.0) for k in fit.setting[effect]}
    # that an effect acts at the rotors, as it is written, is nothing to report
    values = {
        k: v
        for k, v in fit.setting[effect].items()
        if k != CENTRAL or v > 3.0 * fit.std.get((effect, k), np.inf)
    }
    sizes = [
        abs(v) / typical_size((effect, k), search.flights.vehicle)
        for k, v in values.items()
        if k != CENTRAL
    ]
    return NamedEffect(
        name=effect,
        coefficients=values,
        std={k: std[k] for k in values},
        units={k: coefficient((effect, k)).unit for k in values},
        tentative=structured or (noisy and _is_small(gain / (gain + error))),
        indistinguishable_from=others,
        evidence={
            "energy_explained": gain / (gain + error),
            "energy_explained_in_noise_units": gain,
            "largest_coefficient_in_typical_sizes": max(sizes, default=0.0),
        },
        channels=carrying_channels(
            search.flights, fit.setting, effect, traces_of(search, fit, effect)
        ),
    )


def _candidates(first: Sequence[Gain], fit: FittedEffects) -> tuple[Candidate, ...]:
    return tuple(Candidate(x.effect, x.share, x.effect in fit.effects) for x in first)
