"""Which other effects would explain the same residual: decided from the flights and the effect
models, not from chance.

An effect's own part of the residual is projected on the columns of another effect. What remains is
the deviance by which the flights tell the two apart.
"""

from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...dynamics.effects import Family, Role, get, of_family, playing
from .gram_matrix import GRAM, gram
from .regression import (
    CENTRAL,
    Flights,
    unit_of_change,
)
from .search import SEARCH, FittedEffects, Search, coefficient_count

Array = NDArray[np.float64]


@dataclass(frozen=True)
class EquivalenceSettings:
    """From which deviance on, flights tell two explanations apart."""

    least_deviance: float = 30.0  # between two explanations; a little over five std deviations
    # of an effect's own deviance, by which two explanations must differ: effect models are true to
    # that
    least_share_apart: float = 0.001
    # share of the effect's deviance that another one must explain, linearised, to be worth a refit
    least_linear_share: float = 0.1
    # times the limit, which the linear fit of another one may leave of it to be worth a refit
    most_linear_deviance_ratio: float = 40.0
    largest_size: float = 1.2 * GRAM.prior_std  # typical sizes
    most_reliable_effects: int = 2  # at once; aerodynamic ones count as one
    # share of what an inertia explains, which one that goes with the mass may leave of it
    most_share_apart: float = 0.1
    least_std: float = 1e-9  # relative; standard deviations are no smaller
    # share of a thrust scale which a mass may fail to cancel
    most_share_uncancelled: float = 0.1
    least_hanging_ratio: float = 5.0  # a centre of mass along z over across it: a load that hangs


EQUIVALENCE = EquivalenceSettings()
# a vehicle that is declared without aerodynamics lacks all of these together
ONE_CAUSE = (Family.DRAG, Family.AERODYNAMICS)
# one with as much inertia is the other: thrust and moments scale alike, or neither does
COUNTERPARTS = {Role.MASS: Role.THRUST, Role.THRUST: Role.MASS}
# what scales thrust: all of it, or by way of each rotor
THRUSTS = (Role.THRUST, Role.ROTOR_THRUSTS)


def equivalents(search: Search, fit: FittedEffects, effect: str) -> list[str]:
    """Return the effects of the library that would explain what ``effect`` explains, given all
    others of the fit.
    """
    flights = search.flights
    less = fit.without(effect)
    regression = search.linearise(less)
    whole = flights.residual(fit.setting)
    part = flights.residual(less.setting) - whole
    g = gram(flights, less.setting, search.whiten, regression.columns, part)
    limit = limit_of(search, part)
    # by the triangle inequality they are no farther apart
    enough = (np.sqrt(search.deviance_of(whole)) + np.sqrt(limit)) ** 2
    out = []
    for other in search.gains(less, regression, g):
        if (
            other.effect == effect
            or other.share < EQUIVALENCE.least_linear_share
            or other.size > EQUIVALENCE.largest_size
            or other.deviance_left > EQUIVALENCE.most_linear_deviance_ratio * limit
        ):
            continue
        # a nonlinear effect is refitted to the flights
        swapped = search.refit(other.fit, enough)
        if search.deviance_of(flights.residual(swapped.setting) - whole) < limit:
            out.append(other.effect)
    return out


def unidentifiable_rivals(search: Search, fit: FittedEffects, effect: str) -> list[str]:
    """Return the effects that explain more than ``effect`` in its place, but are not identifiable.

    Their columns are sensor noise to a large part, so they are not searched for; the named effect
    may stand for one of them.
    """
    if not search.dominated_by_noise:
        return []
    less, wider = fit.without(effect), copy(search)
    wider.library = search.dominated_by_noise
    regression = wider.linearise(less)
    own = (
        search.error_without(fit, effect)
        - search.error(fit)
        - SEARCH.deviance_per_coefficient * coefficient_count(effect)
    )
    return [
        x.effect
        for x in wider.gains(less, regression, wider.gram(less, regression))
        if x.deviance_reduction - SEARCH.deviance_per_coefficient * coefficient_count(x.effect)
        > own
        and SEARCH.least_size < x.size <= EQUIVALENCE.largest_size
    ]


def unlisted_equivalent_doubts(search: Search, fit: FittedEffects) -> list[str]:
    """Return, as sentences, which named effects may stand for an exact equivalent outside the
    library.

    Mass and the scale of thrust differ only in the moments. A load on a cable is a mass that does
    not rotate with the body.

    Of 340 flights with a wrong name it doubts 14, and 10 as the only check.
    """
    flights = search.flights
    found = []
    named = [
        (e, mate) for role, mate in COUNTERPARTS.items() for e in playing(role, among=fit.effects)
    ]
    for effect, mate in named:
        inertias = playing(Role.INERTIA)
        if (
            playing(mate, among=search.library)
            or playing(Role.INERTIA, among=fit.effects)
            or not inertias
        ):
            continue
        name, value = next(iter(fit.setting[effect].items()))
        axes = get(inertias[0]).coefficients[:3]
        share = float(
            np.clip(
                value / unit_of_change((effect, name), flights.vehicle),
                axes[0].minimum,
                axes[0].maximum,
            )
        )
        whole = flights.residual(fit.setting)
        turned = flights.residual(
            {**fit.setting, inertias[0]: dict.fromkeys((c.name for c in axes), share)}
        )
        columns = flights.columns(fit.setting, search.model_columns(fit.effects), 0.1)
        g = gram(flights, fit.setting, search.whiten, columns, turned - whole)
        if g.error(np.arange(len(g.columns))) < limit_of(
            search, flights.residual(fit.without(effect).setting) - whole
        ):
            found.append(
                f"{effect}: these flights do not show whether the moments change with it. An "
                "effect outside the library may be the cause: fly faster rolls and pitches"
            )
        elif search.deviance_of(turned) < search.deviance_of(whole):
            found.append(
                f"{effect}: moments other than those of this effect fit better. An effect outside "
                "the library may be the cause"
            )
    heavier = _changes(flights, fit, Role.MASS) > 0.0
    centres = playing(Role.CENTRE_OF_MASS, among=fit.effects)
    if heavier and centres and not playing(Role.SUSPENDED_LOAD, among=search.library):
        x, y, z = (abs(get(centres[0]).vector(fit.setting[centres[0]])[i]) for i in range(3))
        if z > EQUIVALENCE.least_hanging_ratio * max(x, y):
            found.append(
                "a larger mass and a centre of mass that is off along z alone were found: a "
                "suspended load may be the cause"
            )
    return found


def limit_of(search: Search, part: Array) -> float:
    """Return the deviance from which on two explanations of ``part`` (rows, 6) are told apart."""
    return max(
        EQUIVALENCE.least_deviance,
        EQUIVALENCE.least_share_apart * search.deviance_of(part),
    )


def _changes(flights: Flights, fit: FittedEffects, role: Role) -> float:
    """Return by how much, relatively, the effects of a role change what they change."""
    return sum(
        float(get(effect).vector(fit.setting[effect])[0])
        / unit_of_change((effect, get(effect).coefficients[0].name), flights.vehicle)
        for effect in playing(role, among=fit.effects)
    )


def _relative(flights: Flights, fit: FittedEffects) -> tuple[Array, Array]:
    """Return the relative changes of inertia (three), mass and thrust in a fit, and their standard
    deviations.
    """
    parts = [
        (effect, name)
        for effect in playing(Role.INERTIA, Role.MASS, *THRUSTS, among=fit.effects)
        for name in fit.setting[effect]
        if name != CENTRAL
    ]
    scale = np.array([1.0 / unit_of_change(part, flights.vehicle) for part in parts])
    return (
        scale * np.array([fit.setting[effect][name] for effect, name in parts]),
        scale * np.array([fit.std.get(part, 0.0) for part in parts]),
    )


def _weighted(values: Array, std: Array) -> float:
    """Return the mean of values weighted by their precision; where one is exact,
    that of all alike.
    """
    return float(np.average(values, weights=None if np.any(std == 0.0) else std**-2.0))


def composite_doubts(flights: Flights, fit: FittedEffects) -> list[str]:
    """Return, as sentences, which single effect may be the cause of several named ones that are
    together its exact equivalent.

    Thrust is known by what it moves: only its ratios to mass and to inertia show. So of mass,
    inertia and a scale of thrust any two can be the third: where both change alike, or where mass
    and thrust cancel. And the more effects are needed, the rather they are parts of one.

    Of 340 flights with a wrong name it doubts 70, and 8 as the only check.
    """
    found = []
    names = set(fit.effects)
    air = of_family(*ONE_CAUSE, among=names)

    def named(*roles: Role) -> tuple[str, ...]:
        return playing(*roles, among=fit.effects)

    if len(names - air) + bool(air) > EQUIVALENCE.most_reliable_effects:
        found.append(
            f"{len(names)} effects were needed: together they may stand for one effect outside the "
            "library"
        )
    if named(Role.INERTIA) and named(Role.MASS, *THRUSTS):
        values, std = _relative(flights, fit)
        off = (values - _weighted(values, std)) / np.maximum(std, EQUIVALENCE.least_std)
        axes = sum(len(fit.setting[effect]) for effect in named(Role.INERTIA))
        whole = values[:axes] / np.maximum(std[:axes], EQUIVALENCE.least_std)
        if off @ off < EQUIVALENCE.least_deviance + EQUIVALENCE.most_share_apart * whole @ whole:
            found.append(
                "the relative changes of inertia and of thrust or mass coincide: a single other "
                "effect may be the cause"
            )
    if named(Role.MASS) and named(Role.THRUST):
        weight, thrust = (1.0 + _changes(flights, fit, x) for x in (Role.MASS, Role.THRUST))
        if abs(thrust / weight - 1.0) < EQUIVALENCE.most_share_uncancelled * abs(thrust - 1.0):
            found.append(
                f"{' and '.join(named(Role.MASS, Role.THRUST))} cancel, but for the moments: a "
                "change of the inertia may be the cause"
            )
    return found
