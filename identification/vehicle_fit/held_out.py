"""Errors of a vehicle's predictions of held-out data. Coefficients are fitted anew without some
segments of the flights, or without one flight, and predict the segments or flight left out. The set
of parameters and the noise's spectrum stay.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError
from ..logs.flight_log import FlightLog
from ..prediction import QUANTITIES, PredictionErrors, prediction_errors
from .channels import MotionPiece
from .solve import VehicleFit, refitted
from .spectra import edges_of

FOLDS = 3  # every third segment is held out at a time


def predicted(
    pieces: Sequence[MotionPiece],
    logs: Sequence[FlightLog],
    fit: VehicleFit,
    vehicle_of: Callable[[VehicleFit], Vehicle],
) -> dict[str, PredictionErrors]:
    """Return the errors of predicted blocks of 5 s, and of several flights each predicted by the
    others.

    Raises:
        InputError: a log has no pose, or too little would be left of them.
    """
    for log in logs:
        if not log.has_pose:
            raise InputError(f"{log.name}: has no pose; expected one, to predict from")
    # each segment's log, and from and to, s after the log's start
    number: list[int] = []
    spans: list[tuple[float, float]] = []
    for piece in pieces:
        t, edges = piece.t - logs[piece.log].t[0], edges_of(len(piece.t), piece.period)
        number += [piece.log] * (len(edges) - 1)
        spans += list(zip(t[edges[:-1]].tolist(), t[edges[1:] - 1].tolist(), strict=True))
    turn = np.arange(len(number)) % FOLDS
    errors: dict[str, PredictionErrors] = {}
    for where, fold in {"held_out_blocks": turn, "flights_left_out": np.array(number)}.items():
        names = np.unique(fold)
        if len(names) < 2 and where == "flights_left_out":
            continue
        parts = []
        for held, part in zip(names, refitted(fit, [fold != name for name in names]), strict=True):
            windows: dict[int, list[tuple[float, float]]] = {}
            for i in np.flatnonzero(fold == held):
                windows.setdefault(number[i], []).append(spans[i])
            of = [logs[i] for i in windows]
            parts.append(prediction_errors(of, vehicle_of(part), windows=list(windows.values())))
        errors[where] = PredictionErrors.pooled(parts)
    return errors


def torque_refuted(errors: Mapping[str, PredictionErrors]) -> str:
    """Return the figures if fitted torques predict the body rate of held-out blocks worse than the
    guess of no change; else nothing. A whole flight left out is no test: the only flight with yaw
    takes Jzz with it.
    """
    rate, of = list(QUANTITIES).index("body rate"), errors.get("held_out_blocks")
    if of is None or of.model[rate, -1] <= of.still[rate, -1]:
        return ""
    return (
        "not identifiable: torques predict the body rate of held-out blocks worse than the guess "
        f"that nothing changes ({of.model[rate, -1]:.2g} against {of.still[rate, -1]:.2g} rad/s "
        f"after {of.horizon[-1]:.2g} s)"
    )


def warnings_of(errors: Mapping[str, PredictionErrors]) -> list[str]:
    """Return a warning for each kind of flight predicted worse than by the guess of no change."""
    return [
        f"warning: {where.replace('_', ' ')}: {', '.join(of.worse)}: predicted worse than by the "
        "guess that nothing changes. This vehicle is no model of it"
        for where, of in errors.items()
        if of.worse
    ]
