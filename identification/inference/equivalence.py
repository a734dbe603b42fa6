"""Which other effect would have left the same traces: decided from the flights and the laws, not
from the noise's luck.

An effect's own part of the residual is projected on the columns of another one. What is left over
is the energy, in units of the noise, by which the flights can tell the two apart.
"""

from copy import copy

import numpy as np
from numpy.typing import NDArray

from .gram_matrix import BELIEVED, PRIOR, gram
from .regression import CENTRAL, SHIFT, SHIFT_RANGE, Flights, coefficient
from .search import COMPLEXITY, LEAST_SIZE, Fit, Search, freedom
from .turning_delay import ALIKE

Array = NDArray[np.float64]

APART = 30.0  # whitened energy; five standard deviations and a little
APART_SHARE = 0.001  # of the effect's own energy: laws are no truer than that
SHARE_OF_COMMANDS = 0.005  # the same where thrust is a guess
_HOPEFUL = 0.1  # share of it that another one must explain where it is linear, to be worth a fit
_HOPEFUL_OF_COMMANDS = 0.3
_NEAR_OF_COMMANDS = 6.0
_MOST = 0.4  # of what is left without the effect
_NEAR = (
    40.0  # times the limit: what the linear fit leaves of an effect that is worth a fit of its own
)
_OUT_OF_STEP = 0.98  # share of what is allowed
_MOST_SURE = 2  # effects at once
# a vehicle that is declared without aerodynamics lacks all of these together
_AERODYNAMICS = frozenset(
    {
        "rotor_drag",
        "body_drag",
        "inflow_thrust",
        "translational_lift",
        "rate_damping",
        "flapping_moment",
    }
)
_COINCIDE = (
    0.1  # share of what an inertia explains that one which goes with the mass may leave of it
)
_SAME, _NOTHING = (
    3.0,
    0.01,
)  # standard deviations between efficiencies that are the same, and one that is as good as zero
_EXACT = 1e-9  # relative; standard deviations are no smaller
_CANCEL = 0.1  # of a scale of thrust, which a mass takes back but for that
_HANGS = 5.0  # times as far along z as across it
_EVEN = 0.95  # correlation of voltage and time
# one with as much inertia is the other: thrust and moments scale alike, or neither does
_MATES = {"mass": "thrust_scale", "thrust_scale": "mass"}
_AXES = ("jx", "jy", "jz")
_PLAUSIBLE = 1.2 * PRIOR  # typical sizes


def equivalents(search: Search, fit: Fit, effect: str) -> list[str]:
    """Return the effects of the library that would explain what ``effect`` explains, given all
    others of the fit.
    """
    flights = search.flights
    if search.held(effect):
        return [other for other in ALIKE if other in search.library]
    less = fit.without(effect)
    regression = search.linearise(less)
    whole = flights.residual(fit.setting)
    part = flights.residual(less.setting) - whole
    g = gram(flights, less.setting, search.whiten, regression.columns, part)
    limit = _limit(search, part)
    if (
        flights.commanded
    ):  # little of such flights is beyond doubt: the other one must explain most of it
        alone = search.refit(less)
        limit = min(limit, _MOST * search.whitened_energy(flights.residual(alone.setting) - whole))
    # no farther apart than that, by the triangle's inequality
    enough = (np.sqrt(search.whitened_energy(whole)) + np.sqrt(limit)) ** 2
    out = []
    for other in search.gains(less, regression, g):
        near, hopeful = (
            (_NEAR_OF_COMMANDS, _HOPEFUL_OF_COMMANDS) if flights.commanded else (_NEAR, _HOPEFUL)
        )
        if other.share < hopeful:
            continue
        if other.effect == effect or other.size > _PLAUSIBLE or other.left > near * limit:
            continue
        # what is far from linear is fitted to the flights themselves
        swapped = search.refit(other.fit, enough)
        if search.whitened_energy(flights.residual(swapped.setting) - whole) < limit:
            out.append(other.effect)
    return out


def overshadowed(search: Search, fit: Fit, effect: str) -> list[str]:
    """Return the effects that explain more than ``effect`` in its place, and that the flights
    hardly excite.

    Their columns are noise of the sensors in good part, so they are not searched for; what is named
    in the place of one may be it all the same.
    """
    if not search.hidden:
        return []
    less, wider = fit.without(effect), copy(search)
    wider.library = search.hidden
    regression = wider.linearise(less)
    own = search.error_without(fit, effect) - search.error(fit) - COMPLEXITY * freedom(effect)
    return [
        x.effect
        for x in wider.gains(less, regression, wider.gram(less, regression))
        if x.energy - COMPLEXITY * freedom(x.effect) > own and LEAST_SIZE < x.size <= _PLAUSIBLE
    ]


def unlisted(search: Search, fit: Fit) -> list[str]:
    """Return in words which names may stand for an exact equivalent that the library lacks, where
    the flights do not tell.

    Mass and thrust_scale are alike but for the moments. A load on a cable is a mass that does not
    turn with the body.
    """
    flights = search.flights
    found = []
    for effect, mate in _MATES.items():
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
        turned = flights.residual({**fit.setting, "inertia": dict.fromkeys(_AXES, share)})
        columns = flights.columns(fit.setting, search.base(fit.effects), 0.1)
        g = gram(flights, fit.setting, search.whiten, columns, turned - whole)
        if g.error(np.arange(len(g.columns))) < _limit(
            search, flights.residual(fit.without(effect).setting) - whole
        ):
            found.append(
                f"whether the moments go with {effect} these flights do not show: an effect that "
                f"is not among these "
                "names may be behind it"
            )
        elif search.whitened_energy(turned) < search.whitened_energy(whole):
            found.append(
                f"moments that do not go as {effect} says fit better: an effect that is not among "
                f"these names may be "
                "behind it"
            )
    heavier = fit.setting.get("mass", {}).get("dm", 0.0) > 0.0
    if heavier and "com_offset" in fit.effects and "slung_payload" not in search.library:
        centre = fit.setting["com_offset"]
        if abs(centre["cz"]) > _HANGS * max(abs(centre["cx"]), abs(centre["cy"])):
            found.append(
                "more mass, and a centre of mass that is off along z alone: a load that hangs may "
                "be behind them"
            )
    return found


def _limit(search: Search, part: Array) -> float:
    """Return the energy from which two explanations of ``part`` (rows, 6) are apart."""
    return max(
        APART,
        (SHARE_OF_COMMANDS if search.flights.commanded else APART_SHARE)
        * search.whitened_energy(part),
    )


def _relative(flights: Flights, fit: Fit) -> tuple[Array, Array]:
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


def _three_alike(fit: Fit) -> bool:
    """Return whether the efficiencies of just three rotors are the same, and not zero."""
    rotors = [f"e{i + 1}" for i in range(4)]
    off = np.array([fit.setting["rotor_efficiency"].get(name, 0.0) for name in rotors])
    std = max(fit.std.get(("rotor_efficiency", name), 0.0) for name in rotors)
    middle = float(np.median(off))
    same = np.abs(off - middle) < max(_SAME * std, _COINCIDE * abs(middle))
    return np.count_nonzero(same) == len(rotors) - 1 and abs(middle) > max(_SAME * std, _NOTHING)


def composites(flights: Flights, fit: Fit) -> list[str]:
    """Return in words which single effect the named ones could be instead, where together they are
    its exact equivalent.

    Mass is thrust_scale with inertia, thrust_scale is mass with inertia, and inertia is mass with
    thrust_scale (coefficients that coincide give them away); a battery that falls evenly is a
    thrust that is off and fades.
    """
    found = []
    names = set(fit.effects)
    if len(names - _AERODYNAMICS) + bool(names & _AERODYNAMICS) > _MOST_SURE:
        found.append(f"{len(names)} effects at once may stand for one that the library lacks")
    shift = fit.setting.get(SHIFT[0], {}).get(SHIFT[1], 0.0)
    if names and shift < _OUT_OF_STEP * SHIFT_RANGE[0]:
        found.append(
            "turn rates would act before they are logged, by as much as is allowed: an effect that "
            "is not among these "
            "names may be behind it"
        )
    if (
        max(fit.setting.get("rotor_efficiency", {"": 0.0}).values())
        > _OUT_OF_STEP * BELIEVED["rotor_efficiency"]
    ):
        found.append(
            "a rotor would have to deliver far more than declared: rotor_efficiency may stand for "
            "another effect"
        )
    if "rotor_efficiency" in names and _three_alike(fit):
        found.append(
            "three rotors are off by the same: a mass or a thrust_scale, and one rotor, may be "
            "behind them"
        )
    if "inertia" in names and names & {"mass", "thrust_scale", "rotor_efficiency"}:
        values, std = _relative(flights, fit)
        off = (values - _weighted(values, std)) / np.maximum(std, _EXACT)
        whole = values[: len(_AXES)] / np.maximum(std[: len(_AXES)], _EXACT)
        if off @ off < APART + _COINCIDE * whole @ whole:
            found.append(
                "coefficients of inertia and thrust or mass coincide: a single other effect may be "
                "behind them"
            )
    if {"mass", "thrust_scale"} <= names:
        weight = 1.0 + fit.setting["mass"].get("dm", 0.0) / flights.vehicle.mass
        thrust = 1.0 + fit.setting["thrust_scale"].get("s", 0.0)
        if abs(thrust / weight - 1.0) < _CANCEL * abs(thrust - 1.0):
            found.append(
                "more mass and as much more thrust cancel, but for the moments: inertia may be "
                "behind them"
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
        even = all(abs(float(np.corrcoef(t, v)[0, 1])) > _EVEN for t, v in drop if v.std() > 0)
        if drop and even:
            found.append(
                "the battery's voltage falls evenly: thrust that is off and fades may be "
                "battery_sag"
            )
    return found
