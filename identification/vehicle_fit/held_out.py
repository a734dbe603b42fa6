"""The test of a vehicle by data outside its fit.

Coefficients are fitted anew without some segments of the flights, or without one flight, and
predict the segments or flight left out. The set of parameters and the noise's spectrum stay. Four
models predict: the vehicle; the vehicle with an unchanged body rate; thrust and drag with an
unchanged body rate; and the vehicle's torques with an unchanged velocity. A part of the vehicle
that predicts worse than no change is refuted.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...dynamics.effects import Role, get
from ...dynamics.vehicle import ModelStatus, Standing, Vehicle
from ...runtime.arrays import Array, Index
from ..logs.flight_log import Logs
from ..prediction import QUANTITIES, PredictionErrors, errors_of_models
from .channels import MotionPiece
from .model import coefficients
from .solve import VehicleFit, refitted
from .spectra import Segment, edges_of

FOLDS = 3  # every third segment is held out at a time
LEAST_HZ = 0.4  # lowest frequency of the shares: below it lies the mean, such as the weight
_ALIKE = 1.02  # ratio of errors: two models within it count as equal
_DRAGS = (Role.ROTOR_DRAG, Role.BODY_DRAG, Role.LAG)
_POSITION, _VELOCITY, _ATTITUDE, _RATE = range(len(QUANTITIES))


@dataclass(frozen=True, eq=False)
class HeldOut:
    """What predictions of held-out data say.

    Attributes:
        errors: the vehicle's, by ``held_out_blocks`` and ``flights_left_out``.
        simplest: the same of thrust and drag with an unchanged body rate.
        status: identified or refuted, of force and torque.
        further: whether effects beside drag stand.
        why: figures of a refuted torque; else empty.
    """

    errors: Mapping[str, PredictionErrors]
    simplest: Mapping[str, PredictionErrors]
    status: ModelStatus
    further: bool = True
    why: str = ""


def held_out(
    pieces: Sequence[MotionPiece],
    logs: Logs,
    fit: VehicleFit,
    vehicle_of: Callable[[VehicleFit], Vehicle],
) -> HeldOut:
    """Return the test by blocks of 5 s, and by several flights each predicted by the others; of
    logs without a pose, by the balance of forces and torques in the blocks alone.

    Raises:
        InputError: too little would be left of the logs.
    """
    # each segment's log, and from and to, s after the log's start
    number = []
    spans = []
    for piece in pieces:
        t, edges = piece.t - logs[piece.log].t[0], edges_of(len(piece.t), piece.period)
        number += [piece.log] * (len(edges) - 1)
        spans += list(zip(t[edges[:-1]].tolist(), t[edges[1:] - 1].tolist(), strict=True))
    turn = np.arange(len(number)) % FOLDS
    if not all(log.has_pose for log in logs):
        return _by_balance(fit, turn)
    errors = {}
    for where, fold in {"held_out_blocks": turn, "flights_left_out": np.array(number)}.items():
        names = np.unique(fold)
        if len(names) < 2 and where == "flights_left_out":
            continue
        parts = []
        for held, part in zip(names, refitted(fit, [fold != name for name in names]), strict=True):
            windows: dict[int, list[tuple[float, float]]] = {}
            for i in np.flatnonzero(fold == held):
                windows.setdefault(number[i], []).append(spans[i])
            of, models = [logs[i] for i in windows], models_of(vehicle_of(part))
            parts.append(errors_of_models(of, models, windows=list(windows.values())))
        errors[where] = [PredictionErrors.pooled(each) for each in zip(*parts, strict=True)]
    return judged(errors)


def models_of(vehicle: Vehicle) -> list[Vehicle]:
    """Return the vehicle; with the body rate kept; thrust and drag with the body rate kept; and
    with the velocity kept.
    """
    keeps_rate = replace(vehicle, status=ModelStatus(torque="refuted"))
    return [
        vehicle,
        keeps_rate,
        without_further(keeps_rate),
        replace(vehicle, status=ModelStatus(force="refuted")),
    ]


def without_further(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle without effects beside drag and lag."""
    return vehicle.with_effects(*(e for e in vehicle.effects if get(e.name).role in _DRAGS))


def judged(errors: Mapping[str, Sequence[PredictionErrors]]) -> HeldOut:
    """Return what the errors of ``models_of`` say, each as in ``HeldOut.errors``.

    The simplest model that is not clearly worse stands. A torque that misses the body rate or the
    attitude by more than no change is refuted, and so is one beside which thrust and drag alone
    predict the motion better.
    """

    def ends(model: int) -> Array:
        return np.array([each[model].model[:, -1] for each in errors.values()])

    still = np.array([each[0].still[:, -1] for each in errors.values()])
    moving, turning = [_POSITION, _VELOCITY], [_ATTITUDE, _RATE]
    simple = ends(2)
    refuted = bool(
        np.any(ends(0)[:, turning] > still[:, turning])
        or np.any(ends(0)[:, moving] > _ALIKE * simple[:, moving])
    )
    chosen, further = 0, True
    if refuted:
        further = not np.any(ends(1)[:, moving] > _ALIKE * simple[:, moving])
        chosen = 1 if further else 2
    force = bool(np.any(ends(chosen)[:, moving] > still[:, moving]))
    if force and not refuted:
        chosen = 3
    status = _status_of(force, refuted)
    kept = {where: each[chosen] for where, each in errors.items()}
    if force and refuted:
        kept = {where: replace(of, model=of.still) for where, of in kept.items()}
    simplest = {where: each[2] for where, each in errors.items()}
    return HeldOut(kept, simplest, status, further, _reason(errors) if refuted else "")


def _status_of(force: bool, torque: bool) -> ModelStatus:
    """Return the status of a vehicle whose force or torque is refuted."""
    words: tuple[Standing, Standing] = ("identified", "refuted")
    return ModelStatus(words[force], words[torque])


def _reason(errors: Mapping[str, Sequence[PredictionErrors]]) -> str:
    """Return the figures of the prediction with the largest ratio of body rates."""
    where = max(errors, key=lambda w: errors[w][0].model[_RATE, -1] / errors[w][0].still[_RATE, -1])
    of = errors[where][0]
    what = where.replace("_", " ")
    if of.model[_RATE, -1] > of.still[_RATE, -1]:
        return (
            f"not identifiable: torques predict the body rate of {what} worse than the guess that "
            f"nothing changes ({of.model[_RATE, -1]:.2g} against {of.still[_RATE, -1]:.2g} rad/s "
            f"after {of.horizon[-1]:.2g} s)"
        )
    without = errors[where][2].model[_POSITION, -1]
    return (
        f"not identifiable: torques predict the motion of {what} worse than thrust and drag with "
        f"an unchanged body rate ({of.model[_POSITION, -1]:.2g} against {without:.2g} m after "
        f"{of.horizon[-1]:.2g} s)"
    )


def _by_balance(fit: VehicleFit, fold: Index) -> HeldOut:
    """Return what the balance of held-out segments says: the fit must leave less power of specific
    force along z, and of turning, than no model.
    """
    names = np.unique(fold)
    left, total = np.zeros((2, 6))
    for held, part in zip(names, refitted(fit, [fold != name for name in names]), strict=True):
        both = powers(part, [fit.balance.segments[i] for i in np.flatnonzero(fold == held)])
        left, total = left + both[0], total + both[1]
    force, torque = bool(left[2] > total[2]), bool(np.sum(left[3:]) > np.sum(total[3:]))
    why = (
        "not identifiable: torques leave more of the turning of held-out blocks than no model "
        f"({np.sum(left[3:]) / np.sum(total[3:]):.2g} times its power)"
    )
    return HeldOut({}, {}, _status_of(force, torque), why=why if torque else "")


def powers(
    fit: VehicleFit, segments: Sequence[Segment], spectra: Sequence[Array] | None = None
) -> tuple[Array, Array]:
    """Return the power (6,) that a fit leaves of specific force and turning, and all of it, from
    ``LEAST_HZ`` on; ``spectra`` divide it, frequency by frequency.
    """
    count = len(fit.balance.names)
    model = coefficients(fit.values, fit.balance.names, fit.model.mass, fit.model.powers)
    left, total = np.zeros((2, 6))
    for i, s in enumerate(segments):
        inside = s.frequency >= LEAST_HZ
        unit = 1.0 if spectra is None else spectra[i][inside]
        measured = s.columns[:, inside, :6]
        residual = measured - s.columns[:, inside, 6 : 6 + count] @ model.T
        left += np.sum(np.abs(residual) ** 2 / unit, axis=(0, 1))
        total += np.sum(np.abs(measured) ** 2 / unit, axis=(0, 1))
    return left, total


def warnings_of(tested: HeldOut) -> list[str]:
    """Return a warning for a refuted force or torque: what predictions keep in its place."""
    kept = {"force": "velocity", "torque": "body rate"}
    return [
        f"warning: {part}: refuted by data outside the fit. Predictions keep the {kept[part]}; "
        f"the file's numbers of it are assumptions"
        for part in kept
        if getattr(tested.status, part) == "refuted"
    ]
