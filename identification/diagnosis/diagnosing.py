"""From flight logs to the effects that their vehicle's model lacks: the whole of a diagnosis.

The evidence of sets of effects says what acts (``verdict``). Effects and coefficients are chosen on
the fitted blocks of flight; the errors before and after are those of blocks, or logs, that the fit
never saw.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ...dynamics.effects import get, names
from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError, unknown_name
from ..findings import CHANNELS, Diagnosis, Errors, NamedEffect, Signature, Trace
from ..logs.flight_log import FlightLog
from ..logs.screening import LEAST_SECONDS, screen_log
from ..motion.noise_spectrum import filtering_notes, pose_was_filtered
from ..motion.smoothing import CUTOFFS
from ..prediction import nis_without_wrench_state, rollout_error
from ..wrench_series import pose_notes
from .explanatory_variables import explanatory_variables, range_notes
from .regression import Flights, lost_behind_a_filter
from .settings import DIAGNOSIS, DiagnosisSettings
from .verdict import Judged

Array = NDArray[np.float64]


def diagnose(
    logs: Sequence[FlightLog],
    vehicle: Vehicle,
    test: Sequence[FlightLog] = (),
    without: Sequence[str] = (),
    report: Callable[[str], None] | None = None,
    settings: DiagnosisSettings = DIAGNOSIS,
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
        settings: which logs are taken, when a name is sure, and what is reported.

    Raises:
        InputError: a log that is not what it claims to be, or an unknown effect.
    """
    for name in without:
        if name not in names():
            raise unknown_name("effect", name, names(), "--without")
    report = report or (lambda text: None)
    if not logs:
        raise InputError("diagnose: no log was given; expected at least one")
    report("looking at the logs")
    every = (*logs, *test)
    least = (
        LEAST_SECONDS if len(every) == 1 and not every[0].commanded else settings.least_seconds_each
    )
    checked = [screen_log(log, vehicle, least) for log in every]
    doubts = [f"{log.name}: {note}" for log, found in checked for note in found]
    flights = Flights(logs, vehicle, test)
    notes = [*(f"{log.name}: {note}" for log in flights.logs for note in log.notes), *doubts]
    notes += [f"{log.name}: {note}" for log in every for note in filtering_notes(log)]
    notes += [f"{log.name}: {note}" for log, _ in checked for note in pose_notes(log, vehicle)]
    said = Judged(flights, [n for n in names() if n not in without], settings, report)
    effects, found, setting = said.effects, said.balance, said.setting
    sure = said.remainder == "none" and not any(
        effect.tentative or effect.indistinguishable_from for effect in effects
    )
    verdict = (
        ("explained" if sure else "partly explained")
        if effects
        else ("nothing to explain" if said.remainder == "none" else "unexplained")
    )
    report("predicting the flights")
    named = {e: x for e, x in setting.items() if e}
    amended = flights.amended(named) if named else vehicle
    notes += [*said.notes, *range_notes(flights)]
    segments = _segments(flights)
    predicted = {model: _predicted(flights, model, segments) for model in {vehicle, amended}}
    hidden = flights.needs_pose | said.hidden
    unseen = (flights.not_identifiable | said.unseen) - flights.needs_pose
    return Diagnosis(
        verdict=verdict,
        remainder=said.remainder,
        effects=effects,
        held_out_segments=tuple((flights.logs[i].name, a, b) for i, a, b in segments),
        before=Errors(*found.error_before, *predicted[vehicle]),
        after=Errors(*found.error_after, *predicted[amended]),
        floor_force_rms=found.floor[0],
        floor_torque_rms=found.floor[1],
        advice=tuple(
            _advice(effects, sorted(unseen), said.remainder, flights.filtered, sorted(hidden))
        ),
        notes=tuple(dict.fromkeys(notes)),
        candidates=said.candidates,
        traces=tuple(_traces(flights, said)),
        signatures=tuple(
            _signature(flights, said, e.name, settings.most_signature_points) for e in effects
        ),
        structure=said.structure,
        gusts=said.gusts,
        pushes=said.pushes,
        cutoff_hz=CUTOFFS.residual_hz,
        declared=vehicle,
        amended=amended if found.better else vehicle,
        logs=tuple(log.name for log in logs),
        test_logs=tuple(log.name for log in test),
        seconds=float(sum(log.t[-1] - log.t[0] for log in every)),
        floor_is_bound=not flights.inertial
        and (flights.filtered or any(map(pose_was_filtered, every))),
        needs_pose=tuple(sorted(hidden)),
        doubts=said.doubts,
        ranking=said.ranking,
        probabilities=said.probabilities,
    )


def _segments(flights: Flights) -> list[tuple[int, float, float]]:
    """Return the held-out stretches of flight: log, from, to (s)."""
    blocks = np.unique(flights.block[~flights.fit_rows])
    ends = [np.flatnonzero(flights.block == b)[[0, -1]] for b in blocks]
    return [(int(flights.log[a]), float(flights.t[a]), float(flights.t[b])) for a, b in ends]


def _predicted(
    flights: Flights, vehicle: Vehicle, segments: Sequence[tuple[int, float, float]]
) -> tuple[float, float]:
    """Return how far a model's predictions of the held-out stretches are off: NIS, and m RMS."""
    nis, distance, weight = [], [], []
    for i, log in enumerate(flights.logs):
        own = [(a, b) for k, a, b in segments if k == i]
        if own:
            nis.append(nis_without_wrench_state(log, vehicle, own))
            distance.append(rollout_error(log, vehicle, own))
            weight.append(sum(b - a for a, b in own))
    squares = np.square(distance)
    return _mean(np.array(nis), weight), float(np.sqrt(_mean(squares, weight)))


def _mean(values: Array, weight: Sequence[float]) -> float:
    good = np.isfinite(values)
    return (
        float(np.average(values[good], weights=np.array(weight)[good]))
        if good.any()
        else float("nan")
    )


def _traces(flights: Flights, said: Judged) -> Iterator[Trace]:
    for rows in flights.runs:
        yield Trace(
            flights.logs[flights.log[rows[0]]].name,
            flights.period,
            flights.t[rows],
            said.balance.before[rows],
            said.balance.after[rows],
            ~flights.fit_rows[rows],
            {effect: part[rows] for effect, part in said.parts.items()},
        )


def _signature(flights: Flights, said: Judged, effect: str, points: int) -> Signature:
    """Return the channel in which an effect is largest, against what it follows most closely."""
    share = said.parts[effect]
    noise = np.maximum(flights.sensor_noise.std(axis=0), 1e-12)
    channel = (
        int(np.argmax(share.std(axis=0) / noise))
        if np.any(share.std(axis=0) > 0.3 * noise)
        else int(np.argmax(np.abs(share).mean(axis=0) / noise))
    )
    y, after = share[:, channel], said.balance.after[:, channel]
    name, x = max(
        explanatory_variables(flights, said.setting),
        key=lambda d: abs(float(np.corrcoef(d[1], y)[0, 1])) if y.std() > 1e-9 else 0.0,
    )
    thin = slice(None, None, max(1, len(y) // points))
    return Signature(effect, CHANNELS[channel], name, x[thin], (y + after)[thin], y[thin])


def _advice(
    effects: Sequence[NamedEffect],
    not_identifiable: Sequence[str],
    remainder: str,
    filtered: bool,
    needs_pose: Sequence[str],
) -> list[str]:
    out = []
    if filtered:
        out.append(
            "Log the pose as it was measured, before any filter or estimator. Behind one, no "
            f"flight identifies {', '.join(sorted(lost_behind_a_filter()))}, and no name is more "
            "than tentative."
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
