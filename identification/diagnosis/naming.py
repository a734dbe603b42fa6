"""The names behind flights: the fit of the likeliest set of effects, each effect's probability, and
the doubts of all.

A name is sure under three conditions. It is probable. Its effect is at least as large as the
unexplained residual beyond the sensors' noise. Little speaks for a cause outside the library.
The rule is the same for every kind of log. The likelihood differs: of the poses, where poses and
rotors were logged as measured, or of the wrench's balance.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from ...dynamics.effects import Role, get, playing
from ..findings import (
    LEAST_RIVAL,
    Alternative,
    NamedEffect,
    Probabilities,
    RankedSet,
    TransientDisturbance,
)
from ..logs.table import Array, NamedNumbers, Names, Values
from ..motion.smoothing import mean_square
from .advice import FILTERED, composites
from .coefficients import CENTRAL, Setting, coefficient, typical_size, unit_of_change, without
from .column import Column
from .commanded_rotors import THRUST_FACTORS
from .commands import Given, what_commands_show
from .ranking import FittedPosterior, Report, rank
from .regression import RegressedFlights
from .residuals import Balance, balance, transient_disturbances
from .row_nuisances import between_flights
from .settings import DiagnosisSettings
from .traces import carrying_channels
from .unknown import beside_unknown, unknown
from .worth import BY_CHANCE, worth

LEAST_STATED = 0.001  # probability of a reported alternative
LEAST_SIZE = 0.1  # typical sizes, from which a calibration is worth a name


@dataclass(frozen=True, eq=False)
class SetFit:
    """The likeliest set of effects behind flights, the facts known before, and the residual beside
    it.

    Attributes:
        flights: the vehicle's flights.
        given: facts known before.
        found: the posterior, and the fit of its likeliest set.
        balance: the residual.
        setting: coefficients of the needed effects; under no name the sensors' errors.
        parts: growth of the residual (rows, 6) with one effect left out.
        pushes: transient disturbances.
        strange: probability of a cause outside the library.
    """

    flights: RegressedFlights
    given: Given
    found: FittedPosterior
    balance: Balance
    setting: Setting
    parts: Mapping[str, Array]
    pushes: Sequence[TransientDisturbance]
    strange: float

    @property
    def best(self) -> RankedSet:
        """The likeliest set."""
        return self.found.ranking.sets[0]


def fit_sets(flights: RegressedFlights, library: Sequence[str], report: Report) -> SetFit:
    """Return the likeliest set of effects of a library; ``report`` is called with a line of
    progress.
    """
    library = [e for e in library if e not in flights.not_identifiable]
    given = what_commands_show(flights, library)
    report("asking how probable each effect is")
    likeliest = rank(flights, given.library, report, given.first, given.fixed)
    sensors = {name: value for name, (value, _) in likeliest.sensors.items()}
    known_apart = {**given.fixed, "": sensors}
    # no set with a larger error on held-out flight is printed
    for fitted in (likeliest, replace(likeliest, needed={}, behind={})):
        setting = {**known_apart, **fitted.needed}
        residual = balance(flights, setting)
        if residual.better:
            break
    parts = {e: flights.residual(without(setting, e)) - residual.after for e in setting if e}
    pushes = transient_disturbances(flights, setting)
    return SetFit(
        flights,
        given,
        fitted,
        residual,
        setting,
        parts,
        pushes,
        unknown(fitted.ranking.structure, bool(pushes)),
    )


def judged(
    fit: SetFit, rule: DiagnosisSettings
) -> tuple[Sequence[NamedEffect], Sequence[NamedEffect], dict[str, Names], Probabilities]:
    """Return named effects, needless effects, doubts and probabilities, as of ``Diagnosis``;
    ``rule`` says when a name is sure.
    """
    known = {e: _differs(fit, e) for e in fit.given.first if e in fit.best.effects}
    likely = [e for e in fit.best.effects if known.get(e, 1.0) >= rule.least_sure_probability]
    named = [e for e in fit.found.needed if e in likely]
    rivals = {e: _rivals(fit, e) for e in named}
    for e in {*named}.difference(known):  # an effect, or its rivals in these flights
        alike = [x.probability for x in fit.found.ranking.sets if {e, *rivals[e]} & {*x.effects}]
        factor = fit.found.posterior.factor_in_set(e)
        known[e] = beside_unknown(
            min(sum(alike), 1.0), factor, fit.found.ranking.structure, fit.strange
        )
    doubts = _doubts(fit, named, rule)
    unsure = bool(set(doubts) - {"assumed thrust"})
    sizes = worth(fit.flights, fit.given.fixed, fit.given.first, fit.found.needed)
    names = {e: known[e] for e in named}
    effects = [
        _named(
            fit,
            e,
            rivals[e],
            sizes[e],
            unsure or names[e] < rule.least_sure_probability or sizes[e] < rule.least_worth,
        )
        for e in named
    ]
    for x in effects if "assumed thrust" in doubts else ():
        if get(x.name).role in THRUST_FACTORS:  # all of it may be the assumed thrust's error
            names[x.name] = _apart(*x.coefficients.values(), *x.std.values())
    if late := fit.given.late:
        names[late.name] = _apart(*late.coefficients.values(), *late.std.values())
        effects.append(
            replace(
                late,
                std=_of_any_flight(fit.flights, late.name, late.coefficients, late.std),
                tentative=unsure or names[late.name] < rule.least_sure_probability,
            )
        )
    stated = tuple(
        Alternative(tuple(e for e in x.effects if e not in fit.given.first), x.probability)
        for x in fit.found.ranking.sets
        if x.probability >= LEAST_STATED
    )
    needless = [
        _stated(fit, e, *fit.found.ranking.averaged(e)) for e in likely if e not in fit.found.needed
    ]
    return effects, needless, doubts, Probabilities(names, stated, fit.strange)


def _of_any_flight(
    flights: RegressedFlights, effect: str, values: Values, std: Values
) -> NamedNumbers:
    """Return standard deviations of coefficients with the spread from flight to flight."""
    return {
        name: math.hypot(x, between_flights(Column(effect, name), values[name], flights))
        for name, x in std.items()
    }


def _differs(fit: SetFit, effect: str) -> float:
    """Return the probability of a calibration, in every set, to differ from the vehicle's
    statement; 0 where the difference is too small for a name.
    """
    apart = [0.0]
    # for a delay: these flights are late, however late others are
    values, stds = fit.found.ranking.averaged(effect)
    if get(effect).role != Role.DELAY:
        stds = _of_any_flight(fit.flights, effect, values, stds)
    for name, std in stds.items():
        c = Column(effect, name)
        off = abs(values[name] - fit.flights.value({}, c))
        if off > LEAST_SIZE * typical_size(c, fit.flights.vehicle) and std:
            apart.append(_apart(off, std))
    return max(apart)


def _apart(value: float, std: float) -> float:
    """Return the probability of a value with a standard deviation to differ from zero."""
    return math.erf(abs(value) / std / math.sqrt(2.0))


def _rivals(fit: SetFit, effect: str) -> Names:
    """Return the effects with nearly the likelihood of one in the likeliest set, in its
    place.
    """
    if effect in fit.given.first:
        factors = playing(*THRUST_FACTORS)
        return tuple(x for x in factors if x != effect) if effect in factors else ()
    own = {*fit.best.effects}
    least = LEAST_RIVAL * fit.best.probability
    swapped = [
        own ^ {*x.effects}
        for x in fit.found.ranking.sets
        if x.probability > least and len(x.effects) == len(own)
    ]
    return tuple(e for x in swapped if effect in x and len(x) == 2 for e in x - {effect})


def _doubts(fit: SetFit, named: Sequence[str], rule: DiagnosisSettings) -> dict[str, Names]:
    """Return for each check, by its name, sentences with a reason to doubt a name."""
    flights = fit.flights
    unsure = ": all names are tentative" if named else ""
    found = {e: fit.found.ranking.averaged(e) for e in fit.found.needed}
    doubts = {
        "composite": tuple(composites(flights.vehicle, found)),
        "unknown": (
            f"a cause outside the library acts with a probability of {fit.strange:.0%}{unsure}",
        )
        * (fit.strange > rule.most_unknown),
        "short": (
            f"{flights.seconds:.1f} s of flight are too few for a sure name: fly at least "
            f"{rule.least_seconds:g} s",
        )
        * (flights.seconds < rule.least_seconds),
        "filtered pose": (FILTERED,) * (flights.filtered and bool(named)),
        "hidden cause": tuple(
            f"{effect}: {' or '.join(hidden)}, which these logs do not show, would look like "
            "it. Log the pose to tell them apart"
            for effect, hidden in fit.found.behind.items()
            if hidden
        ),
        "assumed thrust": tuple(
            f"{effect}: the log holds motor commands and the vehicle file states no motor "
            "curve, so a command's thrust is assumed, and this effect may be the assumption's "
            "error alone. State motor_curve in the vehicle file, or log rotor speeds"
            for effect in playing(*THRUST_FACTORS, among=named)
            if flights.thrust_std > 0.0
        ),
    }
    return {check: sentences for check, sentences in doubts.items() if sentences}


def _named(fit: SetFit, effect: str, others: Names, size: float, tentative: bool) -> NamedEffect:
    flights = fit.flights
    vehicle = flights.vehicle
    found, own = fit.found.ranking.averaged(effect)
    std = _of_any_flight(flights, effect, found, own)
    # the point of action of an effect at the rotors, as declared, is nothing to report
    values = {
        name: x
        for name, x in found.items()
        if name != CENTRAL or x > BY_CHANCE * std.get(name, math.inf)
    }
    uncertain = flights.thrust_std > 0.0 and get(effect).role in THRUST_FACTORS
    if uncertain:
        std = {
            name: math.hypot(x, flights.thrust_std * unit_of_change(Column(effect, name), vehicle))
            for name, x in std.items()
        }
    # shares of the residual's energy without it, each channel over its sensors' noise
    after = fit.balance.after
    over = mean_square(flights.visible_noise) ** 0.5 + 1e-12
    left, whole = (
        float(mean_square(x[~flights.fit_rows] / over).mean())
        for x in (after, after + fit.parts[effect])
    )
    stated = _stated(fit, effect, values, std)
    return replace(
        stated,
        tentative=tentative or uncertain,
        indistinguishable_from=others,
        evidence={
            "energy_explained": max(1.0 - left / whole, 0.0) if whole > 0.0 else 0.0,
            "log_bayes_factor": fit.found.posterior.log_bayes_factor(effect),
            "largest_coefficient_in_typical_sizes": max(
                abs(x) / typical_size(Column(effect, name), vehicle) * (name != CENTRAL)
                for name, x in values.items()
            ),
            "size_over_what_is_left": size,
            **stated.evidence,
        },
        channels=carrying_channels(flights, fit.found.needed, effect),
    )


def _stated(fit: SetFit, effect: str, values: Values, std: Values) -> NamedEffect:
    """Return an effect with its gain on flight left out of its fit."""
    gained, spread = fit.found.gains[effect]
    return NamedEffect(
        name=effect,
        coefficients=values,
        std={name: std.get(name, 0.0) for name in values},
        units={name: coefficient(Column(effect, name)).unit for name in values},
        tentative=True,
        indistinguishable_from=(),
        evidence={"held_out_gain": gained, "held_out_gain_std": spread},
    )
