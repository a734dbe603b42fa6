"""From flight logs to the effects that their vehicle's model lacks: the whole of a diagnosis.

The residual wrench is regressed on whole effects of the library (``inference.search``), every named
effect is compared with what else it could be (``inference.equivalence``), and the residual is
searched for further structure (``inference.residual_structure``). Effects and coefficients are
chosen on the fitted blocks of flight; the errors before and after are those of blocks, or logs,
that the fit never saw.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..dynamics.effects import Role, get, names, playing
from ..dynamics.vehicle import Vehicle
from ..runtime.errors import InputError, unknown_name
from .findings import (
    CHANNELS,
    Candidate,
    Diagnosis,
    Disturbance,
    Errors,
    NamedEffect,
    Ranking,
    Signature,
    Structure,
    Trace,
)
from .inference.candidate_regressors import explanatory_variables
from .inference.carrying_channels import carrying_channels
from .inference.coefficient_range import implausible_coefficients
from .inference.commanded_rotors import (
    COMMANDED,
    THRUST_FACTORS,
    assumed_thrust_doubts,
    thrust_is_assumed,
    without_deviations,
)
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
from .inference.regression import (
    CENTRAL,
    Flights,
    coefficient,
    lost_behind_a_filter,
    typical_size,
    unit_of_change,
)
from .inference.residual_structure import find_structure
from .inference.search import FittedEffects, Gain, Search
from .inference.sensor_bias import biases
from .inference.stepwise_search import find_effects, with_proposal
from .inference.time_offsets import ROTOR_TIME_OFFSET
from .inference.transient_disturbances import transient_disturbances
from .logs.flight_log import FlightLog
from .logs.screening import LEAST_SECONDS, screen_log
from .motion.inertial_signals import pose_rate
from .motion.noise_spectrum import filtering_notes, pose_was_filtered
from .motion.smoothing import CUTOFFS
from .posterior.deviations import with_both_estimates
from .posterior.pooling import POOLING, SEARCH_ALONE, PoolingSettings, Signs, pooled
from .posterior.ranking import rank
from .prediction import nis_without_wrench_state, rollout_error
from .wrench_series import pose_notes

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DiagnosisSettings:
    """What the verdict of a diagnosis goes by."""

    # times the noise floor; a residual up to that is the sensors' noise
    most_floor_ratio: float = 1.2
    # shares of the weight, and of the weight times the arm: a weaker disturbance, below the cut-off
    # ``CUTOFFS.calm_hz``, is none
    calm_force: float = 0.006
    calm_torque: float = 0.0015
    least_seconds_each: float = 3.0  # of flight, where several logs are given together
    # share of the residual's deviance; a name that explains less beside a large residual is
    # tentative
    least_share_of_residual: float = 0.1
    # with which names are sure, where probabilities are known. On 788 simulated flights 443 of 444
    # sure names were right, and 482 of 489 without it
    least_sure_probability: float = 0.95
    most_signature_points: int = 600
    least_rotor_time_offset: float = 0.001  # s, worth a note
    most_period_ratio: float = 1.01  # between logs that one filter of the posterior reads


DIAGNOSIS = DiagnosisSettings()
SMALL, IMPROBABLE = "small beside the residual", "improbable"
FILTERED_NAMES = (
    "the pose was filtered before the log was written. Whether the named effects act on the "
    "vehicle, or follow from feedback-induced correlation, shows only in the sensors' "
    "own noise, so all names are tentative. Log the pose as it was measured"
)


def diagnose(
    logs: Sequence[FlightLog],
    vehicle: Vehicle,
    test: Sequence[FlightLog] = (),
    without: Sequence[str] = (),
    report: Callable[[str], None] = lambda text: None,
    probabilities: bool = False,
) -> Diagnosis:
    """Return what the logs of one vehicle say about its model.

    Args:
        logs: flights to learn from.
        vehicle: as it is declared. An effect that it declares with some coefficients left out has
            those fitted.
        test: flights on which alone the error is reported; default: 3 s of each 12 s of ``logs``,
            which the fit never sees.
        without: effects that are taken out of the library.
        report: called with a line of progress.
        probabilities: whether how probable each name is, is worked out as well; not where rotor
            speeds come from commands. Where pose and rotor speeds were measured, and the vehicle
            declares no effect, it has a posterior: its likeliest set is then named if it explains
            the residual better than what the search has found, and the standard deviation of a
            coefficient includes how far the posterior's estimate of it is from the search's. That
            takes about as long again. Elsewhere a probability is how often such findings of the
            search are right.

    Raises:
        InputError: a log that is not what it claims to be, or an unknown effect.
    """
    for name in without:
        if name not in names():
            raise unknown_name("effect", name, names(), "--without")
    if not logs:
        raise InputError("diagnose: no log was given; expected at least one")
    report("looking at the logs")
    every = (*logs, *test)
    least = (
        LEAST_SECONDS
        if len(every) == 1 and not every[0].commanded
        else DIAGNOSIS.least_seconds_each
    )
    doubts = [f"{log.name}: {note}" for log in every for note in screen_log(log, vehicle, least)]
    flights = Flights(logs, vehicle, test)
    notes = [*(f"{log.name}: {note}" for log in flights.logs for note in log.notes), *doubts]
    notes += [f"{log.name}: {note}" for log in every for note in filtering_notes(log)]
    notes += [f"{log.name}: {note}" for log in every for note in pose_notes(log, vehicle)]
    search = Search(flights, [n for n in names() if n not in without], report)
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

    before, after = (
        flights.residual(biases(fit.setting)),
        flights.residual(without_deviations(fit.setting)),
    )  # no flight's own thrust scale or tilt
    held_out = ~flights.fit_rows
    floor = _rms(flights.visible_noise)
    calm = _calm(vehicle.weight, vehicle.arm_l)
    error_before, error_after = _rms(before[held_out]), _rms(after[held_out])
    # an IMU's own noise is far below the disturbances that count for none
    least_seen = np.hypot(floor, calm[[0, 3]]) if flights.inertial else np.array(floor)
    hidden = hidden_by_bias(search, fit)
    fit = with_errors_of_fusion(search, fit)
    noisy = (
        flights.filtered
        or error_after[0] > DIAGNOSIS.most_floor_ratio * least_seen[0]
        or error_after[1] > DIAGNOSIS.most_floor_ratio * least_seen[1]
    )
    disturbances = (
        ()
        if not flights.has_innovations
        else tuple(
            Disturbance(channel, *found)
            for channel, found in zip(
                CHANNELS, Innovations(flights, fit.setting).disturbances(), strict=True
            )
        )
    )
    transients = (
        () if not flights.has_innovations else tuple(transient_disturbances(flights, fit.setting))
    )
    beyond = beyond_calm(disturbances, vehicle.weight, vehicle.arm_l)
    disturbed = bool(transients) or beyond > 0.0
    remainder = "structured" if signs else "random" if noisy or unconfirmed or disturbed else "none"
    large = disturbed if flights.has_innovations else noisy
    effects = tuple(
        _named(search, fit, effect, classes[effect], bool(signs or name_doubts), large)
        for effect in fit.effects
    )
    notes += _inertial_notes(flights, fit.effects)
    if not flights.commanded and any(
        effect.tentative for effect in effects
    ):  # what one effect explains too much, another one explains too little
        effects = tuple(replace(effect, tentative=True) for effect in effects)
    if thrust_is_assumed(every, vehicle):
        effects = tuple(_with_assumed_thrust(effect, vehicle) for effect in effects)
        notes += assumed_thrust_doubts(fit.effects)
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
    if ranking and stated:
        least = DIAGNOSIS.least_sure_probability
        low = {e.name: p for e in effects if (p := stated.names[e.name]) < least}
        if low and not any(effect.tentative for effect in effects):
            effects = tuple(replace(effect, tentative=True) for effect in effects)
            words = " and ".join(f"{name} ({p:.0%})" for name, p in low.items())
            doubted_by[IMPROBABLE] = (f"less probable than {least:.0%}, so tentative: {words}",)
            notes += doubted_by[IMPROBABLE]
    sure = remainder == "none" and not any(
        effect.tentative or effect.indistinguishable_from for effect in effects
    )
    verdict = (
        ("explained" if sure else "partly explained")
        if effects
        else ("nothing to explain" if remainder == "none" else "unexplained")
    )
    notes += name_doubts
    if large and (small := [e.name for e in effects if _is_small(e.evidence["energy_explained"])]):
        doubted_by[SMALL] = tuple(small)
    report("predicting the flights")
    amended = flights.amended({k: v for k, v in fit.setting.items() if k})
    segments = _segments(flights)
    time_offsets = fit.setting.get(ROTOR_TIME_OFFSET[0], {})
    offset = time_offsets.get(ROTOR_TIME_OFFSET[1], 0.0)
    if abs(offset) > DIAGNOSIS.least_rotor_time_offset and Innovations(
        flights, {**fit.setting, ROTOR_TIME_OFFSET[0]: {**time_offsets, ROTOR_TIME_OFFSET[1]: 0.0}}
    ).confirm(fit.setting):
        notes.append(
            f"the rotor speeds act {abs(1000 * offset):.1f} ms "
            f"{'later' if offset > 0 else 'earlier'} than they are logged"
            + (
                ", or the filter of the pose delays it by as much"
                if flights.filtered and offset > 0
                else ""
            )
        )
    return Diagnosis(
        verdict=verdict,
        remainder=remainder,
        effects=effects,
        held_out_segments=tuple((flights.logs[i].name, a, b) for i, a, b in segments),
        before=_errors(flights, vehicle, segments, error_before),
        after=_errors(flights, amended, segments, error_after),
        floor_force_rms=floor[0],
        floor_torque_rms=floor[1],
        advice=tuple(
            _advice(
                effects,
                sorted(flights.not_identifiable - flights.needs_pose),
                remainder,
                flights.filtered,
                sorted(flights.needs_pose | hidden),
            )
        ),
        notes=tuple(dict.fromkeys(notes)),
        candidates=_candidates(first, fit, search),
        traces=tuple(_traces(flights, before, after, _parts(flights, fit, after))),
        signatures=tuple(_signature(flights, fit, effect, after) for effect in fit.effects),
        structure=tuple(signs),
        gusts=disturbances,
        pushes=transients,
        cutoff_hz=CUTOFFS.residual_hz,
        declared=vehicle,
        amended=amended,
        logs=tuple(log.name for log in logs),
        test_logs=tuple(log.name for log in test),
        seconds=float(sum(log.t[-1] - log.t[0] for log in (*logs, *test))),
        floor_is_bound=not flights.inertial
        and (flights.filtered or any(map(pose_was_filtered, every))),
        needs_pose=tuple(sorted(flights.needs_pose | hidden)),
        doubts=doubted_by,
        ranking=ranking,
        probabilities=stated,
    )


def _calm(weight: float, arm: float) -> Array:
    """Return the disturbances (6,) that count for none, N and Nm."""
    return weight * np.repeat([DIAGNOSIS.calm_force, DIAGNOSIS.calm_torque * arm], 3)


def beyond_calm(disturbances: Sequence[Disturbance], weight: float, arm: float) -> float:
    """Return the logarithm of the largest disturbance of the six channels over what counts for
    none; ``-inf`` where none was fitted.

    Args:
        disturbances: one a channel.
        weight: N, of the vehicle.
        arm: m.
    """
    slow = [x.below(CUTOFFS.calm_hz) for x in disturbances]
    return float(np.log(np.max(slow / _calm(weight, arm)))) if slow else -np.inf


def _name_doubts(
    search: Search, fit: FittedEffects, rotor_delay: DelayKind | None
) -> dict[str, tuple[str, ...]]:
    """Return for each check, by its name, the sentences that say why a name may be wrong."""
    flights = search.flights
    found: dict[str, Iterable[str]] = {
        "composite": composite_doubts(flights, fit),
        "unlisted equivalent": unlisted_equivalent_doubts(search, fit),
        "hidden cause": hidden_causes(search, fit),
    }
    if not flights.commanded:
        found["implausible coefficient"] = implausible_coefficients(search, fit)
    if flights.filtered and fit.effects:
        found["filtered pose"] = [FILTERED_NAMES]
    elif not flights.commanded:
        found["delay"] = delay_doubts(search, fit, rotor_delay)
    return {check: sentences for check, words in found.items() if (sentences := tuple(words))}


def _ranking(
    flights: Flights, search: Search, fit: FittedEffects, report: Callable[[str], None]
) -> Ranking | None:
    """Return the posterior of sets of effects; None where the logs hold no poses and rotor speeds
    as they were measured, or where the vehicle declares effects, of which none is then tried.
    """
    if flights.commanded or flights.inertial or flights.filtered or flights.vehicle.effects:
        return None
    periods = [log.period for log in flights.logs]
    if max(periods) > DIAGNOSIS.most_period_ratio * min(periods):
        return None
    report("asking how probable each effect is")
    found = {effect: fit.setting[effect] for effect in fit.effects}
    return rank(flights, search.library, found, report)


def _pooling(flights: Flights, ranking: Ranking | None) -> PoolingSettings | None:
    """Return how findings of such logs become probabilities; None of commanded rotors: there is no
    flight of theirs whose truth is known.
    """
    if flights.commanded:
        return None
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


def _rms(wrench: Array) -> tuple[float, float]:
    """Return the RMS of force (N) and torque (Nm) over rows and axes."""
    return float(np.sqrt(np.mean(np.square(wrench[:, :3])))), float(
        np.sqrt(np.mean(np.square(wrench[:, 3:])))
    )


def _is_small(share: float) -> bool:
    """Return whether an effect explains little beside the residual: ``share`` of both together.

    Of 340 flights with a wrong name it doubts 96, and now one as the only check.
    """
    least = DIAGNOSIS.least_share_of_residual
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
    if search.delay is not None and search.is_fixed(effect):
        gain = search.delay.log_likelihood_ratio
        std = dict.fromkeys(search.delay.setting(effect)[effect], search.delay.std)
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
        channels=carrying_channels(search, fit, effect),
    )


def _with_assumed_thrust(effect: NamedEffect, vehicle: Vehicle) -> NamedEffect:
    """Return an effect as it is where nobody knows how much thrust a command makes: a factor on
    thrust and a mass are tentative, may be each other, and are no better known than that thrust.
    """
    if get(effect.name).role not in THRUST_FACTORS:
        return effect
    return replace(
        effect,
        tentative=True,
        std={
            name: float(
                np.hypot(
                    std,
                    COMMANDED.unstated_thrust_std * unit_of_change((effect.name, name), vehicle),
                )
            )
            for name, std in effect.std.items()
        },
        indistinguishable_from=tuple(
            dict.fromkeys(
                (
                    *effect.indistinguishable_from,
                    *(x for x in playing(*THRUST_FACTORS) if x != effect.name),
                )
            )
        ),
    )


def _segments(flights: Flights) -> list[tuple[int, float, float]]:
    """Return the held-out stretches of flight: log, from, to (s)."""
    held_out = ~flights.fit_rows
    begins = np.flatnonzero(
        held_out
        & (
            flights.start
            | np.concatenate([[True], flights.fit_rows[:-1]])
            | (np.diff(flights.block, prepend=-1) != 0)
        )
    )
    ends = [int(np.flatnonzero(flights.block == flights.block[b])[-1]) for b in begins]
    return [
        (int(flights.log[b]), float(flights.t[b]), float(flights.t[e]))
        for b, e in zip(begins, ends, strict=True)
    ]


def _errors(
    flights: Flights,
    vehicle: Vehicle,
    segments: Sequence[tuple[int, float, float]],
    rms: tuple[float, float],
) -> Errors:
    nis, distance, weight = [], [], []
    for i, log in enumerate(flights.logs):
        own = [(a, b) for k, a, b in segments if k == i]
        if own:
            nis.append(nis_without_wrench_state(log, vehicle, own))
            distance.append(rollout_error(log, vehicle, own))
            weight.append(sum(b - a for a, b in own))
    return Errors(
        *rms, _mean(np.array(nis), weight), float(np.sqrt(_mean(np.square(distance), weight)))
    )


def _mean(values: Array, weight: Sequence[float]) -> float:
    good = np.isfinite(values)
    return (
        float(np.average(values[good], weights=np.array(weight)[good]))
        if good.any()
        else float("nan")
    )


def _candidates(first: Sequence[Gain], fit: FittedEffects, search: Search) -> tuple[Candidate, ...]:
    return tuple(Candidate(x.effect, x.share, x.effect in fit.effects) for x in first)


def _parts(flights: Flights, fit: FittedEffects, after: Array) -> dict[str, Array]:
    """Return by how much the residual (rows, 6) grows where one named effect is left out."""
    return {
        effect: flights.residual(without_deviations(fit.without(effect).setting)) - after
        for effect in fit.effects
    }


def _traces(
    flights: Flights, before: Array, after: Array, parts: Mapping[str, Array]
) -> list[Trace]:
    begins = np.flatnonzero(flights.start)
    out = []
    for a, b in zip(begins, [*begins[1:], len(flights.t)], strict=True):
        out.append(
            Trace(
                flights.logs[flights.log[a]].name,
                flights.period,
                flights.t[a:b],
                before[a:b],
                after[a:b],
                ~flights.fit_rows[a:b],
                {effect: part[a:b] for effect, part in parts.items()},
            )
        )
    return out


def _signature(flights: Flights, fit: FittedEffects, effect: str, after: Array) -> Signature:
    """Return the channel in which an effect is largest, against what it follows most closely."""
    share = flights.residual(fit.without(effect).setting) - after
    noise = np.maximum(flights.sensor_noise.std(axis=0), 1e-12)
    channel = (
        int(np.argmax(share.std(axis=0) / noise))
        if np.any(share.std(axis=0) > 0.3 * noise)
        else int(np.argmax(np.abs(share).mean(axis=0) / noise))
    )
    y = share[:, channel]
    known = explanatory_variables(flights, fit.setting)
    name, x = max(
        known, key=lambda d: abs(float(np.corrcoef(d[1], y)[0, 1])) if y.std() > 1e-9 else 0.0
    )
    thin = slice(None, None, max(1, len(y) // DIAGNOSIS.most_signature_points))
    return Signature(
        effect, CHANNELS[channel], name, x[thin], (y + after[:, channel])[thin], y[thin]
    )


def _advice(
    effects: Sequence[NamedEffect],
    not_identifiable: Sequence[str],
    remainder: str,
    filtered: bool,
    needs_pose: Sequence[str] = (),
) -> list[str]:
    out = []
    if filtered:
        out.append(
            "Log the pose as it was measured, before any filter or estimator. Behind one, no "
            f"flight identifies {', '.join(sorted(lost_behind_a_filter()))}, and no name is more "
            "than "
            "tentative."
        )
        not_identifiable = [x for x in not_identifiable if x not in lost_behind_a_filter()]
    for effect in effects:
        if effect.indistinguishable_from:
            group = (effect.name, *effect.indistinguishable_from)
            out.append(
                f"{' or '.join(group)}: these logs cannot tell them apart. To separate them, fly: "
                + "; ".join(f"{name}: {get(name).excitation}" for name in group)
            )
    if remainder == "structured":
        out.append(
            "The residual still has structure that no effect of the library explains, so the "
            "named effects are tentative. Fly one thing at a time (hover, climbs, level flight at "
            "several speeds, turns) to see what the residual follows."
        )
    if needs_pose:
        out.append(
            "An IMU alone does not show "
            + ", ".join(needs_pose)
            + ": they need a velocity, a position or an attitude that no gyro and accelerometer "
            "know. To identify one of them, log the pose as well."
        )
    if not_identifiable:
        out.append(
            "Not identifiable from these flights: "
            + ", ".join(not_identifiable)
            + ". To identify one of them, fly: "
            + "; ".join(f"{name}: {get(name).excitation}" for name in not_identifiable[:4])
        )
    return out


__all__ = ["Diagnosis", "Structure", "diagnose"]
