"""Which other effects would explain the same residual: decided from the flights and the effect
models, not from chance.

An effect's own part of the residual is projected on the columns of another effect. What remains is
the deviance by which the flights tell the two apart.
"""

from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .gram_matrix import GRAM, gram
from .regression import CENTRAL, REGRESSION, ROTOR_TIME_OFFSET, Flights, coefficient
from .search import SEARCH, FittedEffects, Search, coefficient_count
from .turning_delay import SAME_DELAY_EFFECTS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class EquivalenceSettings:
    """From which deviance on, flights tell two explanations apart.

    ``commanded`` marks flights whose rotor speeds are worked out from commands.
    """

    least_deviance: float = 30.0  # between two explanations; a little over five std deviations
    least_share: float = 0.001  # of the effect's own deviance: effect models are true to that
    commanded_least_share: float = 0.005  # the same where thrust is a guess
    # share of the effect's deviance that another one must explain, linearised, to be worth a refit
    least_linear_share: float = 0.1
    commanded_least_linear_share: float = 0.3
    # times the limit, which the linear fit of another one may leave of it to be worth a refit
    most_linear_deviance_ratio: float = 40.0
    commanded_most_linear_deviance_ratio: float = 6.0
    # share of what is left without the effect, which is the limit for commanded flights at most
    commanded_most_share_without: float = 0.4
    largest_size: float = 1.2 * GRAM.prior_std  # typical sizes
    share_of_bound: float = 0.98  # of a bound, from which a coefficient has reached it
    most_reliable_effects: int = 2  # at once; aerodynamic ones count as one
    # share of what an inertia explains, which one that goes with the mass may leave of it
    most_share_apart: float = 0.1
    # standard deviations between rotor efficiencies that are the same
    most_std_apart: float = 3.0
    least_efficiency: float = 0.01  # relative, below which a rotor is as good as declared
    least_std: float = 1e-9  # relative; standard deviations are no smaller
    # share of a thrust scale which a mass may fail to cancel
    most_share_uncancelled: float = 0.1
    least_hanging_ratio: float = 5.0  # a centre of mass along z over across it: a load that hangs
    least_voltage_correlation: float = 0.95  # of voltage and time, where the voltage falls evenly


EQUIVALENCE = EquivalenceSettings()
# a vehicle that is declared without aerodynamics lacks all of these together
AERODYNAMIC_EFFECTS = frozenset(
    {
        "rotor_drag",
        "body_drag",
        "inflow_thrust",
        "translational_lift",
        "rate_damping",
        "flapping_moment",
    }
)
# one with as much inertia is the other: thrust and moments scale alike, or neither does
COUNTERPARTS = {"mass": "thrust_scale", "thrust_scale": "mass"}
INERTIA_AXES = ("jx", "jy", "jz")


def equivalents(search: Search, fit: FittedEffects, effect: str) -> list[str]:
    """Return the effects of the library that would explain what ``effect`` explains, given all
    others of the fit.
    """
    flights = search.flights
    if search.is_fixed(effect):
        return [other for other in SAME_DELAY_EFFECTS if other in search.library]
    less = fit.without(effect)
    regression = search.linearise(less)
    whole = flights.residual(fit.setting)
    part = flights.residual(less.setting) - whole
    g = gram(flights, less.setting, search.whiten, regression.columns, part)
    limit = _limit(search, part)
    if flights.commanded:  # they tell less: the other one must explain most of it
        alone = search.refit(less)
        limit = min(
            limit,
            EQUIVALENCE.commanded_most_share_without
            * search.deviance_of(flights.residual(alone.setting) - whole),
        )
    # by the triangle inequality they are no farther apart
    enough = (np.sqrt(search.deviance_of(whole)) + np.sqrt(limit)) ** 2
    out = []
    for other in search.gains(less, regression, g):
        near, hopeful = (
            (
                EQUIVALENCE.commanded_most_linear_deviance_ratio,
                EQUIVALENCE.commanded_least_linear_share,
            )
            if flights.commanded
            else (EQUIVALENCE.most_linear_deviance_ratio, EQUIVALENCE.least_linear_share)
        )
        if other.share < hopeful:
            continue
        if (
            other.effect == effect
            or other.size > EQUIVALENCE.largest_size
            or other.deviance_left > near * limit
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

    Mass and thrust_scale differ only in the moments. A load on a cable is a mass that does not
    rotate with the body.
    """
    flights = search.flights
    found = []
    for effect, mate in COUNTERPARTS.items():
        if (
            effect not in fit.effects
            or mate in search.library
            or "inertia" in fit.effects
            or flights.commanded
        ):
            continue
        value = next(iter(fit.setting[effect].values()))
        jx = coefficient(("inertia", "jx"))
        share = float(
            np.clip(
                value / flights.vehicle.mass if effect == "mass" else value, jx.minimum, jx.maximum
            )
        )
        whole = flights.residual(fit.setting)
        turned = flights.residual({**fit.setting, "inertia": dict.fromkeys(INERTIA_AXES, share)})
        columns = flights.columns(fit.setting, search.model_columns(fit.effects), 0.1)
        g = gram(flights, fit.setting, search.whiten, columns, turned - whole)
        if g.error(np.arange(len(g.columns))) < _limit(
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
    heavier = fit.setting.get("mass", {}).get("dm", 0.0) > 0.0
    if heavier and "com_offset" in fit.effects and "slung_payload" not in search.library:
        centre = fit.setting["com_offset"]
        if abs(centre["cz"]) > EQUIVALENCE.least_hanging_ratio * max(
            abs(centre["cx"]), abs(centre["cy"])
        ):
            found.append(
                "a larger mass and a centre of mass that is off along z alone were found: a "
                "suspended load may be the cause"
            )
    return found


def _limit(search: Search, part: Array) -> float:
    """Return the deviance from which on two explanations of ``part`` (rows, 6) are told apart."""
    return max(
        EQUIVALENCE.least_deviance,
        (EQUIVALENCE.commanded_least_share if search.flights.commanded else EQUIVALENCE.least_share)
        * search.deviance_of(part),
    )


def _relative(flights: Flights, fit: FittedEffects) -> tuple[Array, Array]:
    """Return the relative changes of inertia (three), mass and thrust in a fit, and their standard
    deviations.
    """
    parts = [
        (effect, name)
        for effect in ("inertia", "mass", "thrust_scale", "rotor_efficiency")
        for name in fit.setting.get(effect, {})
        if name != CENTRAL
    ]
    scale = np.array(
        [1.0 / flights.vehicle.mass if effect == "mass" else 1.0 for effect, _ in parts]
    )
    return (
        scale * np.array([fit.setting[effect][name] for effect, name in parts]),
        scale * np.array([fit.std.get(part, 0.0) for part in parts]),
    )


def _weighted(values: Array, std: Array) -> float:
    """Return the mean of values weighted by their precision; where one is exact,
    that of all alike.
    """
    return float(np.average(values, weights=None if np.any(std == 0.0) else std**-2.0))


def _three_alike(fit: FittedEffects) -> bool:
    """Return whether the efficiencies of just three rotors are the same, and not zero."""
    rotors = [f"e{i + 1}" for i in range(4)]
    off = np.array([fit.setting["rotor_efficiency"].get(name, 0.0) for name in rotors])
    std = max(fit.std.get(("rotor_efficiency", name), 0.0) for name in rotors)
    middle = float(np.median(off))
    same = np.abs(off - middle) < max(
        EQUIVALENCE.most_std_apart * std, EQUIVALENCE.most_share_apart * abs(middle)
    )
    return np.count_nonzero(same) == len(rotors) - 1 and abs(middle) > max(
        EQUIVALENCE.most_std_apart * std, EQUIVALENCE.least_efficiency
    )


def composite_doubts(flights: Flights, fit: FittedEffects) -> list[str]:
    """Return, as sentences, which single effect may be the cause of several named ones that are
    together its exact equivalent.

    Mass is thrust_scale with inertia, thrust_scale is mass with inertia, and inertia is mass with
    thrust_scale (their coefficients coincide then); a battery that falls evenly is a thrust that is
    off and fades.
    """
    found = []
    names = set(fit.effects)
    if (
        len(names - AERODYNAMIC_EFFECTS) + bool(names & AERODYNAMIC_EFFECTS)
        > EQUIVALENCE.most_reliable_effects
    ):
        found.append(
            f"{len(names)} effects were needed: together they may stand for one effect outside the "
            "library"
        )
    offset = fit.setting.get(ROTOR_TIME_OFFSET[0], {}).get(ROTOR_TIME_OFFSET[1], 0.0)
    if names and offset < EQUIVALENCE.share_of_bound * REGRESSION.rotor_time_offset_range[0]:
        found.append(
            f"the fitted rotor speeds act at least {-1000.0 * offset:.1f} ms earlier than they are "
            "logged: an effect outside the library may be the cause"
        )
    if (
        max(fit.setting.get("rotor_efficiency", {"": 0.0}).values())
        > EQUIVALENCE.share_of_bound * GRAM.plausible_maxima["rotor_efficiency"]
    ):
        found.append(
            "a rotor reaches the largest plausible thrust: rotor_efficiency may stand for another "
            "effect"
        )
    if "rotor_efficiency" in names and _three_alike(fit):
        found.append(
            "three rotors have the same efficiency: a mass or a thrust_scale, and one weak rotor, "
            "may be the cause"
        )
    if "inertia" in names and names & {"mass", "thrust_scale", "rotor_efficiency"}:
        values, std = _relative(flights, fit)
        off = (values - _weighted(values, std)) / np.maximum(std, EQUIVALENCE.least_std)
        whole = values[: len(INERTIA_AXES)] / np.maximum(
            std[: len(INERTIA_AXES)], EQUIVALENCE.least_std
        )
        if off @ off < EQUIVALENCE.least_deviance + EQUIVALENCE.most_share_apart * whole @ whole:
            found.append(
                "the relative changes of inertia and of thrust or mass coincide: a single other "
                "effect may be the cause"
            )
    if {"mass", "thrust_scale"} <= names:
        weight = 1.0 + fit.setting["mass"].get("dm", 0.0) / flights.vehicle.mass
        thrust = 1.0 + fit.setting["thrust_scale"].get("s", 0.0)
        if abs(thrust / weight - 1.0) < EQUIVALENCE.most_share_uncancelled * abs(thrust - 1.0):
            found.append(
                "mass and thrust_scale cancel, but for the moments: inertia may be the cause"
            )
    if "thrust_fade" in names and names & {
        "mass",
        "thrust_scale",
        "rotor_efficiency",
        "constant_force",
    }:
        drop = [
            (p.signals.t, p.signals.voltage)
            for p in flights.pieces({})
            if p.signals.voltage is not None
        ]
        even = all(
            abs(float(np.corrcoef(t, v)[0, 1])) > EQUIVALENCE.least_voltage_correlation
            for t, v in drop
            if v.std() > 0
        )
        if drop and even:
            found.append(
                "the battery's voltage falls evenly: a thrust that is off and fades may be "
                "battery_sag"
            )
    return found
