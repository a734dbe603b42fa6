"""The test of a vehicle by data outside its fit.

Coefficients are fitted anew without some segments of the flights, or without one flight, and
predict the segments or flight left out. The set of parameters and the noise's spectrum stay.
Several models predict beside the guess that nothing changes: thrust and drag, the vehicle's force,
its torque, both; and where torque is refuted, the flight loop's reaction in its place. A model
stands if no quantity is worse than the better one of no change and of thrust and drag. The one with
the least mean of these ratios is the vehicle.

One flight, or flights of commands on one day, show no other day. They are predicted with a thrust
off by the spread between days to either side. One flight tells no reaction: on a slower flight of
a racer the body rate was off by 3 times the error of no change.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...dynamics.effects import Role, get
from ...dynamics.vehicle import ClosedLoop, ModelStatus, Standing, Vehicle
from ...runtime.arrays import Array, Index
from ..logs.flight_log import Logs
from ..prediction import QUANTITIES, LoggedStarts, PredictionErrors, errors_at, logged_starts
from .channels import MotionPiece
from .closed_loop import LoopFit, fit_loop
from .geometry import USUAL
from .model import coefficients
from .solve import VehicleFit, refitted
from .spectra import Segment, edges_of

FOLDS = 3  # every third segment is held out at a time
LEAST_HZ = 0.4  # lowest frequency of the shares: below it lies the mean, such as the weight
_ALIKE = 1.02  # ratio of errors: two models within it count as equal
_DRAGS = (Role.ROTOR_DRAG, Role.BODY_DRAG, Role.LAG)
_HORIZON = 0.5  # s
OTHER_FLIGHTS = "flights_left_out"
NO_CHANGE, SIMPLEST, WHOLE = "no change", "thrust and drag", "force and torque"
# each model's errors of the parts held out, by where they are
Errors = Mapping[str, Mapping[str, Sequence[PredictionErrors]]]


@dataclass(frozen=True, eq=False)
class HeldOut:
    """What predictions of held-out data say.

    Attributes:
        errors: the vehicle's, by ``held_out_blocks`` and ``flights_left_out``.
        simplest: the same of thrust and drag with an unchanged body rate.
        stands: the model of ``models_of`` that stands.
        loop: the flight loop's reaction, where this stands in for the torque.
        why: figures of a refuted torque; else empty.
    """

    errors: Mapping[str, PredictionErrors]
    simplest: Mapping[str, PredictionErrors]
    stands: str
    loop: LoopFit | None = None
    why: str = ""


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Starts in the segments of a fit, and the parts held out in turn."""

    starts: list[LoggedStarts]  # of each log
    segment: list[Index]  # of each log's starts
    folds: Mapping[str, Index]  # (s,) the part of each segment
    refits: Mapping[str, list[VehicleFit]]  # without each part
    spreads: tuple[float, ...]  # factors of the thrust

    def errors(self, models: Callable[[VehicleFit, Index], Mapping[str, Vehicle]]) -> Errors:
        """Return the errors of models made of each refit and the numbers of its segments."""
        errors: dict[str, dict[str, Sequence[PredictionErrors]]] = {}
        for where, fold in self.folds.items():
            names: tuple[str, ...] = ()
            parts: list[list[PredictionErrors]] = []
            for held, part in zip(np.unique(fold), self.refits[where], strict=True):
                starts = [
                    of.those(fold[numbers] == held)
                    for of, numbers in zip(self.starts, self.segment, strict=True)
                ]
                if any(len(of.rows) for of in starts):
                    vehicles = models(part, np.flatnonzero(fold != held))
                    names = tuple(vehicles)
                    for share in self.spreads:
                        of_day = [_with_thrust(v, share) for v in vehicles.values()]
                        parts.append(errors_at(starts, of_day))
            if parts:
                errors[where] = dict(zip(names, zip(*parts, strict=True), strict=True))
        return errors


def _blocks(
    pieces: Sequence[MotionPiece], logs: Logs, fit: VehicleFit, vehicle: Vehicle
) -> _Blocks:
    """Return the starts in the segments of a fit.

    Raises:
        InputError: too little would be left of the logs.
    """
    numbers: list[int] = []  # each segment's log
    spans = []  # s, from and to
    for piece in pieces:
        edges = edges_of(len(piece.t), piece.period)
        numbers += [piece.log] * (len(edges) - 1)
        ends = piece.t[edges[:-1]].tolist(), piece.t[edges[1:] - 1].tolist()
        spans += list(zip(*ends, strict=True))
    number = np.array(numbers)
    starts, segment = [], []
    for i, log in enumerate(logs):
        own = np.flatnonzero(number == i)
        starts.append(logged_starts(log, vehicle, [spans[j] for j in own], _HORIZON))
        begins = np.array([spans[j][0] for j in own])
        at = np.searchsorted(begins, log.t[starts[-1].rows] + log.period, side="right")
        segment.append(own[at - 1] if len(own) else np.empty(0, np.int64))
    folds = {"held_out_blocks": np.arange(len(number)) % FOLDS, OTHER_FLIGHTS: number}
    folds = {where: fold for where, fold in folds.items() if len(np.unique(fold)) > 1}
    refits = {w: refitted(fit, [fold != n for n in np.unique(fold)]) for w, fold in folds.items()}
    commands = fit.drive.commands
    spread = USUAL.command_spread if commands else USUAL.thrust_spread
    one_day = commands or OTHER_FLIGHTS not in folds
    spreads = (1.0 - spread, 1.0 + spread) if one_day else (1.0,)
    return _Blocks(starts, segment, folds, refits, spreads)


def _with_thrust(vehicle: Vehicle, share: float) -> Vehicle:
    """Return a vehicle with a share of its thrust, by rotor speeds and by commands."""
    curve = vehicle.motor_curve
    if curve is not None:
        curve = replace(curve, thrust=tuple(share * c for c in curve.thrust))
    return replace(vehicle, k=share * vehicle.k, p=share * vehicle.p, motor_curve=curve)


def held_out(
    pieces: Sequence[MotionPiece],
    logs: Logs,
    fit: VehicleFit,
    vehicle_of: Callable[[VehicleFit, str], Vehicle],
) -> HeldOut:
    """Return the test by blocks of 5 s, and by several flights each predicted by the others; of
    logs without a pose, by the balance of forces and torques in the blocks alone.

    Args:
        pieces: of the logs.
        logs: the flights.
        fit: of all of them.
        vehicle_of: the vehicle of a fit, with a reason to doubt its torque or an empty text.

    Raises:
        InputError: too little would be left of the logs.
    """
    if not all(log.has_pose for log in logs):
        return _by_balance(fit, np.arange(len(fit.balance.segments)) % FOLDS)
    blocks = _blocks(pieces, logs, fit, vehicle_of(fit, ""))
    errors = blocks.errors(lambda part, _: models_of(vehicle_of(part, "")))
    if not errors:
        return HeldOut({}, {}, "")
    stands, why = standing(errors), ""
    loop: LoopFit | None = None
    if models_of(vehicle_of(fit, ""))[stands].status.torque == "refuted":
        why = _reason(errors)
        if OTHER_FLIGHTS in errors:
            loop = fit_loop(blocks.starts, blocks.segment, vehicle_of(fit, why))
    if loop is not None:
        fitted = loop

        def reacting(part: VehicleFit, kept: Index) -> Mapping[str, Vehicle]:
            return loops_of(vehicle_of(part, why), fitted.by(kept))

        further = blocks.errors(reacting)
        errors = {where: {**each, **further[where]} for where, each in errors.items()}
        stands = standing(errors)
    pooled = {
        name: {where: PredictionErrors.pooled(each[name]) for where, each in errors.items()}
        for name in (stands, SIMPLEST)
    }
    return HeldOut(pooled[stands], pooled[SIMPLEST], stands, loop, why)


def models_of(vehicle: Vehicle) -> dict[str, Vehicle]:
    """Return models without a loop's reaction by their names, the simplest ones first."""
    vehicle = replace(vehicle, closed_loop=None)
    force = replace(vehicle, status=_status(True, False))
    return {
        NO_CHANGE: replace(vehicle, status=_status(False, False)),
        SIMPLEST: without_further(force),
        "force": force,
        "torque": replace(vehicle, status=_status(False, True)),
        WHOLE: replace(vehicle, status=_status(True, True)),
    }


def loops_of(vehicle: Vehicle, loop: ClosedLoop) -> dict[str, Vehicle]:
    """Return the models with a loop's reaction in place of the torque, and the reaction alone."""
    models = models_of(vehicle)
    return {
        f"{name}, closed loop": replace(models[name], closed_loop=loop)
        for name in (NO_CHANGE, SIMPLEST, "force")
    }


def without_further(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle without effects beside drag and lag."""
    return vehicle.with_effects(*(e for e in vehicle.effects if get(e.name).role in _DRAGS))


def standing(errors: Errors) -> str:
    """Return the name of the model that stands by its errors at the horizon's end.

    Blocks count by their mean, flights by the worst of them.
    """
    worst, means = {}, {}
    for name in next(iter(errors.values())):
        bounds, ratios = [], []
        for where, each in errors.items():
            still, simple = _ends(each[SIMPLEST], still=True), _ends(each[SIMPLEST])
            ratio = _ends(each[name]) / np.minimum(still, simple)
            bounds.append(np.max(ratio if where == OTHER_FLIGHTS else ratio.mean(axis=0)))
            ratios.append(np.log(ratio).mean())
        worst[name], means[name] = float(max(bounds)), float(np.mean(ratios))
    fine = [name for name, bound in worst.items() if bound <= _ALIKE]
    return min(fine, key=means.__getitem__) if fine else min(worst, key=worst.__getitem__)


def _ends(parts: Sequence[PredictionErrors], still: bool = False) -> Array:
    """Return the errors (parts, 4) at the horizon's end, of a model or of no change."""
    return np.array([(of.still if still else of.model)[:, -1] for of in parts])


def _status(force: bool, torque: bool) -> ModelStatus:
    words: tuple[Standing, Standing] = ("refuted", "identified")
    return ModelStatus(words[force], words[torque])


def _reason(errors: Errors) -> str:
    """Return the figures of the torques' worst prediction."""
    worst = 0.0
    for where, each in errors.items():
        whole, simple = (PredictionErrors.pooled(each[name]) for name in (WHOLE, SIMPLEST))
        end, still, least = whole.model[:, -1], whole.still[:, -1], simple.model[:, -1]
        for i, (what, unit) in enumerate(QUANTITIES.items()):
            best = min(still[i], least[i])
            if end[i] > worst * best:
                worst = end[i] / best
                other = "no change" if still[i] < least[i] else "thrust and drag alone"
                figures = f"{what} of {where.replace('_', ' ')} worse than {other} "
                figures += f"({end[i]:.2g} against {best:.2g} {unit} after {_HORIZON:g} s)"
    return f"not identifiable: torques predict the {figures}"


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
    stands = (WHOLE, "torque", "force", NO_CHANGE)[force + 2 * torque]
    return HeldOut({}, {}, stands, why=why if torque else "")


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


def warnings_of(vehicle: Vehicle) -> list[str]:
    """Return a warning for a refuted force or torque: what predictions do in its place."""
    kept = {"force": "keep the velocity", "torque": "keep the body rate"}
    if vehicle.closed_loop is not None:
        kept["torque"] = "follow the flight loop's reaction (closed_loop)"
    return [
        f"warning: {part}: refuted by data outside the fit. Predictions {instead}; the file's "
        f"numbers of it are assumptions"
        for part, instead in kept.items()
        if getattr(vehicle.status, part) == "refuted"
    ]
