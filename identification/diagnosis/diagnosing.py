"""From flight logs to the effects missing in their vehicle's model: the whole of a diagnosis.

Effects and coefficients are chosen on the fitted blocks of flight. The errors before and after are
of blocks, or logs, outside the fit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...dynamics.effects import names
from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError, unknown_name
from ...runtime.threads import one_thread
from ..findings import CHANNELS, Candidate, Diagnosis, Errors, Structure, Trace
from ..logs.flight_log import Logs
from ..logs.screening import LEAST_SECONDS, screen_log
from ..logs.table import Pair
from ..motion.noise_spectrum import filtering_notes, pose_was_filtered
from ..motion.pose_clock import on_pose_clock
from ..motion.smoothing import CUTOFFS
from ..prediction import nis_without_wrench_state, rollout_error
from ..wrench_series import pose_notes
from .advice import advice, cancelling, inertial_notes, late_rotors, outside_the_fit
from .column import Part
from .log_offsets import delays_at_bound
from .naming import SetFit, fit_sets, judged
from .ranking import Report
from .regression import RegressedFlights
from .residuals import is_beyond_calm
from .settings import DIAGNOSIS, DiagnosisSettings
from .traces import signature

# deviance of a typical size, from which an effect would be sure: for one of some thirty effects,
# with one expected before, 20 to 1 afterwards
LEAST_SHOWN = 13.0


@one_thread()
def diagnose(
    logs: Logs,
    vehicle: Vehicle,
    test: Logs = (),
    without: Sequence[str] = (),
    report: Report = lambda text: None,
    settings: DiagnosisSettings = DIAGNOSIS,
) -> Diagnosis:
    """Return the findings of one vehicle's logs about its model.

    Args:
        logs: flights to learn from.
        vehicle: as declared. Coefficients missing in a declared effect are fitted.
        test: flights for the error alone; default: 3 s of each 12 s of ``logs``, left out of the
            fit.
        without: effects taken out of the library.
        report: called with a line of progress.
        settings: which logs are taken, and when a name is sure.

    Raises:
        InputError: a log contradicts its declaration, or an effect is unknown.
    """
    for name in without:
        if name not in names():
            raise unknown_name("effect", name, names(), "--without")
    if not logs:
        raise InputError("diagnose: no log was given; expected at least one")
    report("looking at the logs")
    logs, test = ([on_pose_clock(log) for log in some] for some in (logs, test))
    every = (*logs, *test)
    least = (
        LEAST_SECONDS if len(every) == 1 and not every[0].commanded else settings.least_seconds_each
    )
    checked = [screen_log(log, vehicle, least) for log in every]
    flights = RegressedFlights(logs, vehicle, test)
    noted = [
        *((log, log.notes) for log in flights.logs),
        *checked,
        *((log, filtering_notes(log)) for log in every),
        *((log, pose_notes(log, vehicle)) for log, _ in checked),
    ]
    notes = [f"{log.name}: {note}" for log, own in noted for note in own]
    fit = fit_sets(flights, [n for n in names() if n not in without], report)
    found, balance = fit.found, fit.balance
    effects, not_needed, doubts, probabilities = judged(fit, settings)
    structure = _structure(fit)
    noisy = balance.noisy or is_beyond_calm(found.gusts, vehicle) or fit.pushes
    remainder = "structured" if structure else "random" if noisy else "none"
    sure = remainder == "none" and not any(
        effect.tentative or effect.indistinguishable_from for effect in effects
    )
    if effects:
        verdict = "explained" if sure else "partly explained"
    else:
        verdict = "nothing to explain" if sure else "unexplained"
    report("predicting the flights")
    named = {e: x for e, x in fit.setting.items() if e}
    amended = flights.amended(named) if named else vehicle
    posterior = found.posterior
    said = [effect.name for effect in effects]
    notes += [
        *inertial_notes(flights, said),
        *(sentence for sentences in doubts.values() for sentence in sentences),
        *cancelling({e: fit.parts[e] for e in said}, balance.after),
        *late_rotors(flights, found.needed, found.sensors),
        *delays_at_bound(fit.setting),
        *outside_the_fit(flights),
    ]
    segments = _segments(flights)
    predicted = {model: _predicted(flights, model, segments) for model in {vehicle, amended}}
    not_shown = {e for e, x in posterior.shown().items() if x < LEAST_SHOWN}
    # hidden by the errors of an IMU alone
    by_bias = posterior.shown([c._replace(part=Part.NUISANCE) for c in flights.biases])
    by_imu = {e for e in not_shown if by_bias[e] >= LEAST_SHOWN}
    hidden = sorted(flights.needs_pose | by_imu)
    unseen = (flights.not_identifiable | not_shown - by_imu) - flights.needs_pose
    alone = sorted(posterior.alone().items(), key=lambda x: -x[1])
    return Diagnosis(
        verdict=verdict,
        remainder=remainder,
        effects=tuple(effects),
        not_needed=tuple(not_needed),
        held_out_segments=tuple((flights.logs[i].name, a, b) for i, a, b in segments),
        before=Errors(*balance.error_before, *predicted[vehicle]),
        after=Errors(*balance.error_after, *predicted[amended]),
        floor_force_rms=balance.floor[0],
        floor_torque_rms=balance.floor[1],
        advice=tuple(advice(effects, sorted(unseen), remainder, flights.filtered, hidden)),
        notes=tuple(dict.fromkeys(notes)),
        candidates=tuple(Candidate(e, gain, e in said) for e, gain in alone),
        traces=tuple(
            Trace(
                flights.logs[flights.log[rows[0]]].name,
                flights.period,
                flights.t[rows],
                balance.before[rows],
                balance.after[rows],
                ~flights.fit_rows[rows],
                {effect: part[rows] for effect, part in fit.parts.items()},
            )
            for rows in flights.runs
        ),
        signatures=tuple(
            signature(flights, fit.setting, e.name, fit.parts[e.name], balance.after)
            for e in effects
        ),
        structure=structure,
        gusts=found.gusts,
        pushes=tuple(fit.pushes),
        cutoff_hz=CUTOFFS.residual_hz,
        declared=vehicle,
        amended=amended,
        logs=tuple(log.name for log in logs),
        test_logs=tuple(log.name for log in test),
        seconds=float(sum(log.t[-1] - log.t[0] for log in every)),
        floor_is_bound=not flights.inertial
        and (flights.filtered or any(map(pose_was_filtered, every))),
        needs_pose=tuple(hidden),
        doubts=doubts,
        ranking=found.ranking,
        probabilities=probabilities,
    )


def _structure(fit: SetFit) -> tuple[Structure, ...]:
    """Return the dictionary's best column beside the likeliest set, if a cause outside the library
    is likely and shows there.
    """
    if fit.strange <= 0.5 or fit.found.ranking.structure <= 0.0:
        return ()
    posterior = fit.found.posterior
    c, _, gained = posterior.strangest()
    where = f"{CHANNELS[c.number]} with {c.coefficient}"
    if c.part == Part.CHANGING:
        where = f"the part of {c.coefficient}"
    return (Structure(c.group, where, gained / posterior.left()),)


def _segments(flights: RegressedFlights) -> list[tuple[int, float, float]]:
    """Return the held-out stretches of flight: log, from, to (s)."""
    blocks = np.unique(flights.block[~flights.fit_rows])
    ends = [np.flatnonzero(flights.block == b)[[0, -1]] for b in blocks]
    return [(int(flights.log[a]), *flights.t[[a, b]].tolist()) for a, b in ends]


def _predicted(
    flights: RegressedFlights, vehicle: Vehicle, segments: Sequence[tuple[int, float, float]]
) -> Pair:
    """Return how far a model's predictions of the held-out stretches are off: NIS, and m RMS."""
    each = []
    for i, log in enumerate(flights.logs):
        if own := [(a, b) for k, a, b in segments if k == i]:
            distance = rollout_error(log, vehicle, own)
            seconds = sum(b - a for a, b in own)
            each.append((nis_without_wrench_state(log, vehicle, own), distance * distance, seconds))
    values = np.ma.masked_invalid(np.reshape(each, (-1, 3)))
    mean = np.ma.average(values[:, :2], axis=0, weights=values[:, 2])
    nis, square = np.ma.filled(mean, math.nan).tolist()
    return nis, math.sqrt(square)
