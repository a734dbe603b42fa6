"""The judgement of flights whose rotors are known by commands: the evidence of the force balance.

A name is sure where it is probable, where what it does is at least as large as what is left
unexplained, and where nothing outside the library is likelier than not. What other effects and the
nuisances could do in its place does not count as its own: a wind and a force that cancel are then
neither of them sure.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..dynamics.effects import get, playing
from .findings import (
    CHANNELS,
    STRUCTURE_TESTS,
    Alternative,
    Candidate,
    NamedEffect,
    Probabilities,
    RankedSet,
    Structure,
)
from .inference.carrying_channels import carrying_channels
from .inference.commanded_rotors import (
    COMMANDED,
    THRUST_FACTORS,
    assumed_thrust_doubts,
    thrust_is_assumed,
)
from .inference.regression import CENTRAL, Flights, coefficient, typical_size, unit_of_change
from .inference.turning_delay import Delay, rotor_delay, same_delays, turning_delay
from .judged import Judged, Report, balance
from .posterior.force_nuisances import calibrations
from .posterior.force_ranking import ForceRanking, rank_by_force

Array = NDArray[np.float64]
Setting = dict[str, dict[str, float]]


@dataclass(frozen=True)
class ForceVerdictSettings:
    """From when on a name is sure."""

    least_sure_probability: float = 0.95
    least_worth: float = 1.0  # times the RMS of what is left, in the channel where it does most
    least_seconds: float = 10.0  # of flight; a shorter one names nothing surely
    # that something acts which no effect of the library is, before the flight is seen
    unknown: float = 0.01
    # of Schwarz's criterion, from which on flights tell one effect from another in its place: a
    # likelihood of 20 to 1
    deviance_apart: float = 6.0
    most_rivals: int = 2  # that are tried in an effect's place, the likeliest
    least_stated: float = 0.001  # probability of an alternative that is reported
    least_size: float = 0.1  # typical sizes, from which a calibration is worth a name


FORCE_VERDICT = ForceVerdictSettings()


def judged_by_force(flights: Flights, library: Sequence[str], report: Report) -> Judged:
    """Return what acts, by the evidence of sets of effects.

    Args:
        flights: with rotors known by commands.
        library: effects that may be named.
        report: called with a line of progress.
    """
    library = [e for e in library if e not in flights.not_identifiable]
    late = rotor_delay(library)
    as_late = same_delays(late, library) if late else []
    delay = turning_delay(
        [p.signals for p in flights.pieces({}) if flights.fit_rows[flights.log == p.log].any()],
        flights.vehicle,
    )
    fixed: Setting = delay.setting(late) if delay and late else {}
    if late:
        library = [e for e in library if e not in as_late and e not in fixed]
    first = {
        e: {c.name: 0.0 for c in get(e).coefficients if c.name != CENTRAL}
        | dict(flights.coefficients({}, e))
        for e in calibrations(library)
    }
    if playing(*THRUST_FACTORS, among=first):  # thrust over mass is known, and neither alone
        library = [e for e in library if e in first or get(e).role not in THRUST_FACTORS]
    report("asking how probable each effect is")
    found = rank_by_force(flights, library, first, fixed, report)
    best = found.ranking.sets[0]
    setting: Setting = {**fixed, **found.setting}
    worth = found.likelihood.worth(found.setting)
    unknown = _unknown(found.ranking.structure)
    differs = {e: _differs(flights, best, e) for e in first if e in found.setting}
    least = FORCE_VERDICT.least_sure_probability
    named = [e for e in found.setting if differs.get(e, 1.0) >= least]
    seconds = sum(float(p.signals.t[-1] - p.signals.t[0]) for p in flights.pieces({}))
    doubts: dict[str, tuple[str, ...]] = {}
    if unknown > 0.5:
        doubts["unknown"] = (
            f"something that no effect of the library is acts with a probability of {unknown:.0%}: "
            "all names are tentative",
        )
    if seconds < FORCE_VERDICT.least_seconds:
        doubts["short"] = (
            f"{seconds:.1f} s of flight are too few for a sure name: fly at least "
            f"{FORCE_VERDICT.least_seconds:g} s",
        )
    unsure = bool(doubts)
    names = {
        e: (1.0 - unknown) * found.ranking.probability[e] + unknown * found.beside_unknown[e]
        for e in named
    } | {e: x for e, x in differs.items() if e in named}
    others = {
        e: tuple(as_late)
        if e == late
        else tuple(x for x in playing(*THRUST_FACTORS) if x != e)
        if get(e).role in THRUST_FACTORS
        else ()
        if e in first
        else _rivals(found, e)
        for e in named
    }
    assumed = thrust_is_assumed(flights.logs, flights.vehicle)
    effects = [
        _named(flights, found, e, names[e], worth[e], unsure, others[e], assumed) for e in named
    ]
    if delay and late:
        effects.append(_late(delay, late, as_late, "short" in doubts))
        named.append(late)
        names[late] = 1.0
    if assumed and (words := assumed_thrust_doubts(named)):
        doubts["assumed thrust"] = tuple(words)
    if flights.inertial:
        setting[""] = found.likelihood.biases(found.setting)
    left = balance(flights, setting)
    signs = (_sign(found),) if unknown > 0.5 else ()
    alternatives = _alternatives(found, frozenset(first), 1.0 - unknown)
    return Judged(
        setting,
        left,
        tuple(effects),
        "structured" if signs else "random" if left.noisy else "none",
        signs,
        _candidates(found, named),
        tuple(sentence for sentences in doubts.values() for sentence in sentences),
        doubts,
        ranking=found.ranking,
        probabilities=Probabilities(names, alternatives, unknown),
    )


def _unknown(structure: float) -> float:
    """Return the probability that something acts which no effect of the library is."""
    prior = FORCE_VERDICT.unknown
    odds = math.log(prior / (1.0 - prior)) + structure
    return float(1.0 / (1.0 + math.exp(-min(max(odds, -700.0), 700.0))))


def _differs(flights: Flights, best: RankedSet, effect: str) -> float:
    """Return the probability that a calibration, which is in every set, differs from what the
    vehicle states; 0 where it does so by too little for a name.
    """
    own = flights.coefficients({}, effect)
    most = 0.0
    for name, value in best.coefficients[effect].items():
        off, std = abs(value - own.get(name, 0.0)), best.std[effect].get(name, 0.0)
        if off > FORCE_VERDICT.least_size * typical_size((effect, name), flights.vehicle) and std:
            most = max(most, math.erf(off / std / math.sqrt(2.0)))
    return most


def _named(
    flights: Flights,
    found: ForceRanking,
    effect: str,
    probability: float,
    worth: float,
    unsure: bool,
    others: tuple[str, ...],
    assumed: bool,
) -> NamedEffect:
    best = found.ranking.sets[0]
    values, std = dict(found.setting[effect]), dict(best.std[effect])
    uncertain = assumed and get(effect).role in THRUST_FACTORS
    if uncertain:
        std = {
            name: math.hypot(
                x, COMMANDED.unstated_thrust_std * unit_of_change((effect, name), flights.vehicle)
            )
            for name, x in std.items()
        }
    gain, left = found.gain(effect), found.left()
    sizes = [
        abs(x) / typical_size((effect, name), flights.vehicle)
        for name, x in values.items()
        if name != CENTRAL
    ]
    return NamedEffect(
        name=effect,
        coefficients=values,
        std={name: std.get(name, 0.0) for name in values},
        units={name: coefficient((effect, name)).unit for name in values},
        tentative=unsure
        or uncertain
        or probability < FORCE_VERDICT.least_sure_probability
        or worth < FORCE_VERDICT.least_worth,
        indistinguishable_from=others,
        evidence={
            "energy_explained": gain / (gain + left),
            "energy_explained_in_noise_units": gain,
            "largest_coefficient_in_typical_sizes": max(sizes, default=0.0),
            "size_over_what_is_left": worth,
        },
        channels=carrying_channels(
            flights, found.setting, effect, ["accelerometer" if flights.inertial else "position"]
        ),
    )


def _late(delay: Delay, effect: str, others: Sequence[str], tentative: bool) -> NamedEffect:
    """Return the delay of commands, which the vehicle's turns show and no force."""
    values = delay.setting(effect)[effect]
    return NamedEffect(
        name=effect,
        coefficients=values,
        std=dict.fromkeys(values, delay.std),
        units={name: coefficient((effect, name)).unit for name in values},
        tentative=tentative,
        indistinguishable_from=tuple(others),
        evidence={"energy_explained_in_noise_units": delay.log_likelihood_ratio},
        channels=("attitude", "motor commands"),
    )


def _rivals(found: ForceRanking, effect: str) -> tuple[str, ...]:
    """Return the effects with which, in the place of one, the flights fit as well. Whether they are
    as likely before is no matter of the flights.
    """
    use, likelihood = FORCE_VERDICT, found.likelihood
    best = found.ranking.sets[0]
    rest = set(best.effects) - {effect}
    out: list[str] = []
    tried = 0
    for other in found.ranking.sets:
        more = set(other.effects) - rest
        if not rest < set(other.effects) or len(more) != 1 or effect in more:
            continue
        tried += 1
        if tried > use.most_rivals:
            break
        setting = likelihood.fitted({e: dict(x) for e, x in other.coefficients.items()})
        if likelihood.criterion(setting) < likelihood.criterion(found.setting) + use.deviance_apart:
            out += more
    return tuple(out)


def _alternatives(
    found: ForceRanking, given: frozenset[str], share: float
) -> tuple[Alternative, ...]:
    sets = [
        Alternative(tuple(e for e in x.effects if e not in given), x.probability * share)
        for x in found.ranking.sets
    ]
    return tuple(x for x in sets if x.probability >= FORCE_VERDICT.least_stated)


def _candidates(found: ForceRanking, named: Sequence[str]) -> tuple[Candidate, ...]:
    """Return what each effect explains alone beside the calibrations, the best first."""
    shares = found.alone_shares()
    order = sorted(shares, key=shares.__getitem__, reverse=True)
    return tuple(Candidate(e, shares[e], e in named) for e in order)


def _sign(found: ForceRanking) -> Structure:
    """Return which column of the dictionary explains most beside the likeliest set."""
    (_, name), gained = found.strangest
    what, channel = name.split(": ", 1)[1].rsplit(" in ", 1)
    where = f"{CHANNELS[int(channel)]} with {what}"
    return Structure("a candidate regressor", where, gained / found.left(), STRUCTURE_TESTS[0])
