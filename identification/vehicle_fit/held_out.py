"""The test of a vehicle by data outside its fit.

Coefficients are fitted anew without some segments of the flights, or without one flight, and
predict the segments or flight left out. The set of parameters and the noise's spectrum stay.
Several models predict beside the guess that nothing changes: thrust and drag, the vehicle's force,
its torque, both; and where torque is refuted, the flight loop's reaction in its place. A model
stands if no quantity is worse than the better one of no change and of thrust and drag. The one with
the least mean of these ratios is the vehicle.

One flight tells how the body rate decays, and nothing else of a reaction. All nine coefficients
hold the trajectory, too: on a slower flight of a racer the body rate was off by 1.9 times the error
of no change, and by 0.9 times with two dampings.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...dynamics.effects import Role, get
from ...dynamics.vehicle import ModelStatus, Standing, Vehicle
from ...runtime.arrays import Array, Mask
from ..logs.flight_log import Logs
from ..prediction import (
    QUANTITIES,
    ErrorsByPart,
    LoggedStarts,
    PredictionErrors,
    errors_at,
    logged_starts,
)
from .closed_loop import LoopFit, fit_loop
from .model import coefficients
from .solve import VehicleFit, refitted

FOLDS = 3  # every third segment is held out at a time
LEAST_HZ = 0.4  # lowest frequency of the shares: below it lies the mean, such as the weight
_ALIKE = 1.02  # ratio of errors: two models within it count as equal
_DRAGS = (Role.ROTOR_DRAG, Role.BODY_DRAG, Role.LAG, Role.DELAY)
_HORIZON = 0.5  # s
OTHER_FLIGHTS = "flights_left_out"
NO_CHANGE, SIMPLEST, WHOLE = "no change", "thrust and drag", "force and torque"
# each model's errors of the parts held out, by where they are
Errors = dict[str, dict[str, list[PredictionErrors]]]
Models = dict[str, Vehicle]  # by name


class HeldOut(NamedTuple):
    """What predictions of held-out data say.

    Attributes:
        errors: the vehicle's, and of thrust and drag with an unchanged body rate, by
            ``held_out_blocks`` and ``flights_left_out``.
        stands: the model of ``models_of`` that stands.
        loop: the flight loop's reaction, where this stands in for the torque.
        why: figures of a refuted torque; else empty.
    """

    errors: ErrorsByPart
    stands: str
    loop: LoopFit | None = None
    why: str = ""


def _errors(
    all_starts: Sequence[LoggedStarts],
    refits: Sequence[tuple[str, Mask, VehicleFit]],
    models: Callable[[VehicleFit, Mask], Models],
) -> Errors:
    """Return the errors of models made of each refit and the segments that it keeps."""
    errors: Errors = {}
    for where, kept, part in refits:
        starts = [of.those(~kept[of.segment]) for of in all_starts]
        if any(len(of.rows) for of in starts):
            vehicles = models(part, kept)
            said = errors.setdefault(where, {name: [] for name in vehicles})
            offs = errors_at(starts, list(vehicles.values()))
            for name, off in zip(vehicles, offs, strict=True):
                said[name].append(off)
    return errors


def held_out(
    logs: Logs,
    fit: VehicleFit,
    vehicle_of: Callable[[VehicleFit, str], Vehicle],
) -> HeldOut:
    """Return the test by blocks of 5 s, and by several flights each predicted by the others; of
    logs without a pose, by the balance of forces and torques in the blocks alone.

    Args:
        logs: the flights.
        fit: of all of them.
        vehicle_of: the vehicle of a fit, with a reason to doubt its torque or an empty text.

    Raises:
        InputError: too little would be left of the logs.
    """
    if not fit.model.sources.velocity:
        return _by_balance(fit)
    whole, starts, segments = vehicle_of(fit, ""), [], fit.balance.segments
    number = np.array([s.log for s in segments])
    for i, log in enumerate(logs):
        own = np.flatnonzero(number == i)
        of_log = logged_starts(log, whole, [segments[k].span for k in own], _HORIZON)
        starts.append(of_log._replace(segment=own[of_log.segment]))
    folds = {"held_out_blocks": np.arange(len(number)) % FOLDS, OTHER_FLIGHTS: number}
    refits = [
        (where, *each)
        for where, fold in folds.items()
        if np.ptp(fold) > 0
        for each in refitted(fit, fold)
    ]
    errors = _errors(starts, refits, lambda part, _: models_of(vehicle_of(part, "")))
    loop: LoopFit | None = None
    if not errors:
        # torques refuted on the flight of their fit were off by up to 37 times the error of no
        # change on others (10 Crazyflie flights of 9 s)
        if any(len(of.rows) for of in starts):
            loop = fit_loop(starts, whole, damped=True)
            damped = replace(whole, closed_loop=loop.loop)
            near, far = (of.model[:, -1] for of in errors_at(starts, [damped, whole]))
            loop = loop if np.log(near / far).mean() < 0.0 else None
        return HeldOut({}, "", loop)
    stands, why = standing(errors), ""
    if stands not in ("torque", WHOLE):
        why, alone = _reason(errors), OTHER_FLIGHTS not in errors
        fitted = loop = fit_loop(starts, vehicle_of(fit, why), damped=alone)

        def without(part: VehicleFit, kept: Mask) -> Models:
            vehicle = vehicle_of(part, why)
            others = [of.those(kept[of.segment]) for of in starts]
            found = fit_loop(others, vehicle, fitted.loop, alone)
            return loops_of(replace(vehicle, closed_loop=found.loop))

        further = _errors(starts, refits, without)
        errors = {where: {**each, **further[where]} for where, each in errors.items()}
        stands = standing(errors)
    pooled = {
        where: [PredictionErrors.pooled(each[name]) for name in (stands, SIMPLEST)]
        for where, each in errors.items()
    }
    return HeldOut(pooled, stands, loop, why)


def models_of(vehicle: Vehicle) -> Models:
    """Return models without a loop's reaction by their names, the simplest ones first."""

    def of(force: Standing, torque: Standing) -> Vehicle:
        return replace(vehicle, closed_loop=None, status=ModelStatus(force, torque))

    force = of("identified", "refuted")
    return {
        NO_CHANGE: of("refuted", "refuted"),
        SIMPLEST: force.with_effects(*(e for e in vehicle.effects if get(e.name).role in _DRAGS)),
        "force": force,
        "torque": of("refuted", "identified"),
        WHOLE: of("identified", "identified"),
    }


def loops_of(vehicle: Vehicle) -> Models:
    """Return the models with the loop's reaction in place of the torque, and the reaction alone."""
    models = models_of(vehicle)
    return {
        f"{name}, closed loop": replace(models[name], closed_loop=vehicle.closed_loop)
        for name in (NO_CHANGE, SIMPLEST, "force")
    }


def standing(errors: Errors) -> str:
    """Return the name of the model that stands by its errors at the horizon's end.

    Blocks count by their mean, flights by the worst of them.
    """
    scores = {}
    for name in next(iter(errors.values())):
        bounds, ratios = [], []
        for where, each in errors.items():
            least = [np.minimum(of.still, of.model)[:, -1] for of in each[SIMPLEST]]
            ratio = np.array([of.model[:, -1] for of in each[name]]) / least
            bounds.append(np.max(ratio if where == OTHER_FLIGHTS else ratio.mean(axis=0)))
            ratios.append(np.log(ratio).mean())
        scores[name] = max(_ALIKE, *bounds), np.mean(ratios)
    return min(scores, key=scores.__getitem__)


def _reason(errors: Errors) -> str:
    """Return the figures of the torques' worst prediction."""
    said = []
    for where, each in errors.items():
        whole, simple = (PredictionErrors.pooled(each[name]) for name in (WHOLE, SIMPLEST))
        ends = whole.model[:, -1], np.minimum(whole.still, simple.model)[:, -1]
        said += [
            (
                end / best,
                f"{what} of {where.replace('_', ' ')} worse than the simplest guess "
                f"({end:.2g} against {best:.2g} {unit} after {_HORIZON:g} s)",
            )
            for (what, unit), end, best in zip(QUANTITIES.items(), *ends, strict=True)
        ]
    return f"not identifiable: torques predict the {max(said, key=lambda each: each[0])[1]}"


def _by_balance(fit: VehicleFit) -> HeldOut:
    """Return what the balance of held-out segments says: the fit must leave less power of specific
    force along z, and of turning, than no model.
    """
    refits = refitted(fit, np.arange(len(fit.balance.segments)) % FOLDS)
    left, total = np.sum([powers(part)[~kept].sum(axis=0) for kept, part in refits], axis=0)
    force, turning = left[2] > total[2], left[3:].sum() / total[3:].sum()
    why = (
        "not identifiable: torques leave more of the turning of held-out blocks than no model "
        f"({turning:.2f} times its power)"
    )
    if turning > 1.0:
        return HeldOut({}, NO_CHANGE if force else "force", why=why)
    return HeldOut({}, "torque" if force else WHOLE)


def powers(fit: VehicleFit, by_noise: bool = False) -> Array:
    """Return the power that a fit leaves of specific force and turning in each segment, and all
    power (s, 2, 6), from ``LEAST_HZ`` on; ``by_noise``: each frequency's over that of the noise.
    """
    names, out = fit.balance.names, []
    model = coefficients(fit.model, fit.values, names)
    for s, spectrum in zip(fit.balance.segments, fit.spectra, strict=True):
        inside = s.frequency >= LEAST_HZ
        unit = spectrum[inside] if by_noise else 1.0
        measured = s.columns[:, inside, :6]
        residual = measured - s.columns[:, inside, 6 : 6 + len(names)] @ model.T
        both = np.abs([residual, measured])
        out.append((both**2 / unit).sum(axis=(1, 2)))
    return np.array(out)
