"""What the evidence of sets of effects says of flights, in words that a report can use.

A name is sure where it is probable, where what it does is at least as large as what is left
unexplained beyond the sensors' noise, and where little speaks for a cause outside the library.
The rule is the same for every kind of log; what differs is whose likelihood it is: that of the
poses, where they and the rotors were measured as they were, or that of the wrench's balance.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ...dynamics.effects import Role, get, playing
from ...dynamics.vehicle import Vehicle
from ..findings import (
    CHANNELS,
    Alternative,
    Candidate,
    Disturbance,
    NamedEffect,
    Probabilities,
    Structure,
)
from ..motion.inertial_signals import pose_rate
from ..motion.smoothing import CUTOFFS
from .carrying_channels import carrying_channels
from .commanded_rotors import COMMANDED, THRUST_FACTORS, assumed_thrust_doubts
from .commands import Given, what_commands_show
from .composite import composites
from .judged import Balance, Judged, Report, balance, calm
from .likelihood import NUISANCE
from .ranking import Found, rank
from .regression import (
    CENTRAL,
    Column,
    Flights,
    coefficient,
    moves_time,
    typical_size,
    unit_of_change,
)
from .row_ranking import rank_by_rows
from .settings import DiagnosisSettings
from .time_offsets import ROTOR_TIME_OFFSET
from .transient_disturbances import transient_disturbances
from .unknown import Signs, unknown
from .worth import worth

Array = NDArray[np.float64]
Setting = Mapping[str, Mapping[str, float]]


FILTERED = (
    "the pose was filtered before the log was written. Whether the named effects act on the "
    "vehicle, or follow from feedback-induced correlation, shows only in the sensors' own noise, "
    "so all names are tentative. Log the pose as it was measured"
)


def judged(
    flights: Flights, library: Sequence[str], rule: DiagnosisSettings, report: Report
) -> Judged:
    """Return what acts, by the evidence of sets of effects.

    Args:
        flights: of the vehicle.
        library: effects that may be named.
        rule: when a name is sure, and what is reported.
        report: called with a line of progress.
    """
    library = [e for e in library if e not in flights.not_identifiable]
    given = what_commands_show(flights, library)
    report("asking how probable each effect is")
    found = (
        rank(flights, library, report)
        if flights.has_raw_poses
        else rank_by_rows(flights, given.library, given.first, given.fixed, report)
    )
    setting = _whole_setting(given, found)
    left = balance(flights, setting)
    gusts = _gusts(flights, found)
    pushes = tuple(transient_disturbances(flights, setting))
    best = found.ranking.sets[0]
    differs = {e: _differs(rule, flights, found, e) for e in given.first if e in best.effects}
    named = [e for e in found.setting if differs.get(e, 1.0) >= rule.least_sure_probability]
    disturbed = beyond_calm(gusts, flights.vehicle)
    one = composites(flights.vehicle, found.setting, best.std)
    some = any(e not in differs for e in named)
    signs = Signs(found.ranking.structure, disturbed, bool(pushes), some)
    strange = unknown(signs)
    rivals = {
        e: _other_factor(e)
        if get(e).role in THRUST_FACTORS and e in given.first
        else ()
        if e in given.first
        else _rivals(rule, found, e)
        for e in named
    }
    known = {e: differs[e] if e in differs else _probability(found, (e, *rivals[e])) for e in named}
    names = {e: (1.0 - strange) * p for e, p in known.items()}
    doubts = _doubts(rule, flights, strange, named, given, found.behind, one, left)
    worths = worth(flights, given.fixed, given.first, found.setting)
    energy = _energy_shares(flights, setting, left.after, named)
    unsure = bool(set(doubts) - {"assumed thrust"})
    effects = [
        _named(rule, flights, found, given, e, known[e], (worths[e], energy[e]), unsure, rivals[e])
        for e in named
    ]
    if given.late:
        effects.append(given.late_name(tentative="short" in doubts))
        names[given.late] = 1.0
    structured = strange > 0.5 and found.ranking.structure > 0.0
    structure = (_sign(found),) if structured else ()
    some = left.noisy or disturbed > 0.0 or bool(pushes)
    biases = [("", f"{NUISANCE}{name}") for _, name in flights.biases]
    unseen = _too_small_to_show(rule, found)
    hidden = unseen - _too_small_to_show(rule, found, biases)
    return Judged(
        setting,
        left,
        tuple(effects),
        "structured" if structured else "random" if some else "none",
        structure,
        _candidates(found, named),
        (
            *_inertial_notes(flights, named),
            *(sentence for sentences in doubts.values() for sentence in sentences),
            *_late_rotors(rule, flights, found),
        ),
        doubts,
        hidden,
        unseen - hidden,
        gusts,
        pushes,
        found.ranking,
        Probabilities(
            names, _alternatives(rule, found, frozenset(given.first), 1.0 - strange), strange
        ),
    )


def _too_small_to_show(
    rule: DiagnosisSettings, found: Found, known: Sequence[Column] = ()
) -> frozenset[str]:
    """Return the effects of which a typical size would not be sure, with some nuisances known."""
    shown = found.posterior.shown(known)
    return frozenset(e for e, x in shown.items() if x < rule.least_shown)


def beyond_calm(disturbances: Sequence[Disturbance], vehicle: Vehicle) -> float:
    """Return the logarithm of the largest disturbance of the six channels over what counts for
    none; ``-inf`` where none was fitted.
    """
    slow = [x.below(CUTOFFS.calm_hz) for x in disturbances]
    return float(np.log(np.max(slow / calm(vehicle.weight, vehicle.arm_l)))) if slow else -np.inf


def _whole_setting(given: Given, found: Found) -> dict[str, dict[str, float]]:
    """Return the coefficients of all effects; under no name time offsets and biases."""
    own = {name: value for name, (value, _) in found.sensors.items()}
    setting = {e: dict(x) for e, x in {**given.fixed, **found.setting}.items()}
    return {**setting, **({"": own} if own else {})}


def _gusts(flights: Flights, found: Found) -> tuple[Disturbance, ...]:
    vehicle = flights.vehicle
    inertias = [vehicle.mass] * 3 + np.diagonal(vehicle.inertia).tolist()
    return tuple(
        Disturbance(channel, inertia * noise.disturbance, noise.time)
        for channel, inertia, noise in zip(CHANNELS, inertias, found.noise, strict=False)
    )


def _differs(rule: DiagnosisSettings, flights: Flights, found: Found, effect: str) -> float:
    """Return the probability that a calibration, which is in every set, differs from what the
    vehicle states; 0 where it does so by too little for a name.
    """
    best, own = found.ranking.sets[0], flights.coefficients({}, effect)
    most = 0.0
    for name, value in best.coefficients[effect].items():
        off, std = abs(value - own.get(name, 0.0)), best.std[effect].get(name, 0.0)
        if off > rule.least_size * typical_size((effect, name), flights.vehicle) and std:
            most = max(most, math.erf(off / std / math.sqrt(2.0)))
    return most


def _rivals(rule: DiagnosisSettings, found: Found, effect: str) -> tuple[str, ...]:
    """Return the effects that, in the place of one of the likeliest set, explain the flights nearly
    as well.
    """
    best = found.ranking.sets[0]
    rest = set(best.effects) - {effect}
    out: list[str] = []
    for other in found.ranking.sets:
        more = set(other.effects) - rest
        in_its_place = rest < set(other.effects) and len(more) == 1 and effect not in more
        if in_its_place and other.probability > rule.least_rival * best.probability:
            out += more
    return tuple(out)


def _other_factor(effect: str) -> tuple[str, ...]:
    return tuple(x for x in playing(*THRUST_FACTORS) if x != effect)


def _probability(found: Found, effects: Sequence[str]) -> float:
    """Return the probability that one of some effects acts, which flights do not tell apart, if
    nothing acts but effects of the library.
    """
    return min(sum(x.probability for x in found.ranking.sets if set(effects) & set(x.effects)), 1.0)


def _doubts(
    rule: DiagnosisSettings,
    flights: Flights,
    strange: float,
    named: Sequence[str],
    given: Given,
    behind: Mapping[str, Sequence[str]],
    one: tuple[str, ...],
    left: Balance,
) -> dict[str, tuple[str, ...]]:
    """Return for each check, by its name, the sentences that say why a name may be wrong."""
    found: dict[str, tuple[str, ...]] = {}
    if one:
        found["composite"] = one
    if strange > rule.most_unknown:
        found["unknown"] = (
            "something that no effect of the library is acts with a probability of "
            f"{strange:.0%}: all names are tentative",
        )
    seconds = sum(float(p.signals.t[-1] - p.signals.t[0]) for p in flights.pieces({}))
    if seconds < rule.least_seconds:
        found["short"] = (
            f"{seconds:.1f} s of flight are too few for a sure name: fly at least "
            f"{rule.least_seconds:g} s",
        )
    if named and not left.better:
        growth, std = (100.0 * x for x in left.growth)
        found["held out"] = (
            "on held-out flight the named effects do not make the squared error smaller "
            f"({growth:+.2g} +- {std:.2g} %): the model stays as it was declared",
        )
    if flights.filtered and named:
        found["filtered pose"] = (FILTERED,)
    if behind:
        found["hidden cause"] = tuple(
            f"{effect}: {' or '.join(hidden)}, which these logs do not show, would look like it. "
            "Log the pose to tell them apart"
            for effect, hidden in behind.items()
        )
    if given.assumed and (words := assumed_thrust_doubts(named)):
        found["assumed thrust"] = tuple(words)
    return found


def _energy_shares(
    flights: Flights, setting: Setting, after: Array, named: Sequence[str]
) -> dict[str, float]:
    """Return of each effect the share of the residual's energy without it that it explains, each
    channel over its sensors' noise.
    """
    size = np.sqrt(np.mean(np.square(flights.visible_noise), axis=0)) + 1e-12
    held_out = ~flights.fit_rows

    def energy(residual: Array) -> float:
        return float(np.mean(np.square(residual[held_out] / size)))

    left = energy(after)
    out = {}
    for effect in named:
        whole = energy(flights.residual({e: x for e, x in setting.items() if e != effect}))
        out[effect] = max(1.0 - left / whole, 0.0) if whole > 0.0 else 0.0
    return out


def _named(
    rule: DiagnosisSettings,
    flights: Flights,
    found: Found,
    given: Given,
    effect: str,
    probability: float,
    measures: tuple[float, float],
    unsure: bool,
    others: tuple[str, ...],
) -> NamedEffect:
    size, energy = measures
    std = dict(found.ranking.sets[0].std[effect])
    # that an effect acts at the rotors, as it is written, is nothing to report
    values = {
        name: x
        for name, x in found.setting[effect].items()
        if name != CENTRAL or x > rule.least_in_std * std.get(name, math.inf)
    }
    uncertain = given.assumed and get(effect).role in THRUST_FACTORS
    if uncertain:
        std = {
            name: math.hypot(
                x, COMMANDED.unstated_thrust_std * unit_of_change((effect, name), flights.vehicle)
            )
            for name, x in std.items()
        }
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
        or probability < rule.least_sure_probability
        or size < rule.least_worth,
        indistinguishable_from=others,
        evidence={
            "energy_explained": energy,
            "log_bayes_factor": found.posterior.log_bayes_factor(effect),
            "largest_coefficient_in_typical_sizes": max(sizes, default=0.0),
            "size_over_what_is_left": size,
        },
        channels=carrying_channels(flights, found.setting, effect),
    )


def _alternatives(
    rule: DiagnosisSettings, found: Found, given: frozenset[str], share: float
) -> tuple[Alternative, ...]:
    sets = [
        Alternative(tuple(e for e in x.effects if e not in given), x.probability * share)
        for x in found.ranking.sets
    ]
    return tuple(x for x in sets if x.probability >= rule.least_stated)


def _candidates(found: Found, named: Sequence[str]) -> tuple[Candidate, ...]:
    """Return what each effect explains alone, the best first."""
    alone = found.posterior.alone()
    order = sorted(alone, key=alone.__getitem__, reverse=True)
    return tuple(Candidate(e, alone[e], e in named) for e in order)


def _sign(found: Found) -> Structure:
    """Return which column of the dictionary explains most beside the likeliest set."""
    (_, name), _, gained = found.posterior.strangest()
    group, what = name.removeprefix("unknown ").split(": ", 1)
    column, _, channel = what.rpartition(" in ")
    where = f"{CHANNELS[int(channel)]} with {column}" if column else f"the part of {what}"
    return Structure(group, where, gained / found.posterior.left())


def _late_rotors(rule: DiagnosisSettings, flights: Flights, found: Found) -> list[str]:
    """Return, as a sentence, by how much rotor speeds act later than they are logged."""
    offset, std = found.sensors.get(ROTOR_TIME_OFFSET[1], (0.0, math.inf))
    if flights.inertial or any(moves_time(e) for e in found.setting):
        return []
    if abs(offset) < max(rule.least_rotor_time_offset, rule.least_in_std * std):
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
