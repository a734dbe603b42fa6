"""Fits of named effects to the racer's force, tested on what they never saw, beside the published
figures; and the wrench filter on the same flights.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from windwrench.dynamics import EffectSetting, Vehicle, load_vehicle
from windwrench.dynamics.effects import Role, playing
from windwrench.estimator.noise_fit import NoiseFitSettings
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.motion.residual import acting_wrench
from windwrench.identification.motion.smoothing import CUTOFFS, derivative, low_pass
from windwrench.identification.wrench_series import estimate_log, tune_to_log
from windwrench.runtime.errors import InputError

from .blade_element import Coefficient, priors
from .flights import Flight, pose_log, read_flight, velocity_log
from .force_fit import ForceModel, Regression, Rows

Array = NDArray[np.float64]

# published vector RMSE of force, N, at 400 Hz, by the last letter of a flight's name: the network
# and the estimator
PUBLISHED: Mapping[str, tuple[float, float]] = {
    "c": (0.250, 0.079),
    "d": (0.517, 0.204),
    "e": (0.659, 0.366),
    "g": (0.345, 0.068),
    "h": (0.423, 0.099),
    "j": (1.197, 0.339),
}


def _of(effect: str, *names: str) -> tuple[Coefficient, ...]:
    return tuple((effect, name) for name in names)


_SLOW = (
    *_of("thrust_scale", "s"),
    *_of("inflow_thrust", "kz"),
    *_of("translational_lift", "kh"),
    *_of("rotor_drag", "kdx", "kdy"),
    *_of("body_drag", "cx", "cy", "cz"),
)
_PLACE = (*_of("com_offset", "cx", "cy", "cz"), *_of("ground_effect", "rho"))
_FAST = (*_of("rotor_interaction", "kp", "kw"), *_of("inflow_drag", "kl"))
# nested models: what each adds, and whether the force's own low-pass is part of it
MODELS: Mapping[str, tuple[tuple[Coefficient, ...], bool]] = {
    "thrust alone": (_of("thrust_scale", "s"), False),
    "and drag, inflow and lift": (_SLOW, False),
    "and the log's low-pass": (_SLOW, True),
    "and centre of mass and ground": ((*_SLOW, *_PLACE), True),
    "and the effects of fast flight": ((*_SLOW, *_PLACE, *_FAST), True),
}
FULL = "and the effects of fast flight"
# the velocity of an estimator was filtered before it was written, and may be less noisy than motion
# capture, whose noise else bounds a tuning from below
QUIET = NoiseFitSettings(position=(1e-7, 0.3), attitude=(1e-5, 0.5))
_OFF_CENTRE = frozenset(playing(Role.CENTRE_OF_MASS))


@dataclass(frozen=True)
class StudySettings:
    """How flights are divided, and how sure a figure is."""

    blocks: int = 5  # of a flight, each tested on a fit without it
    resample: float = 2.0  # s, of the blocks of the bootstrap: longer than the residual remembers
    draws: int = 2000
    hover: float = 1.0  # s at a flight's start, for a thrust scale of its own
    # Hz, at which the filter's error is split: the force of these files has little above it
    split_hz: float = 8.0
    settled: float = 1.0  # s after the filter's start that do not count


SETTINGS = StudySettings()


def read_flights(folder: Path) -> tuple[list[Flight], Vehicle]:
    """Return the flights ``flight_*.csv*`` of a folder and the vehicle of its ``vehicle.yaml``.

    The floor is put at 0 m where the vehicle states none: the flights land there.

    Raises:
        InputError: fewer than two flights, or a file that is not what it should be.
    """
    paths = sorted(folder.glob("flight_*.csv*"))
    if len(paths) < 2:
        raise InputError(f"{folder}: expected at least two files flight_*.csv, found {len(paths)}")
    vehicle = load_vehicle(folder / "vehicle.yaml")
    if not np.isfinite(vehicle.floor_z):
        vehicle = replace(vehicle, floor_z=0.0)
    return [read_flight(path, vehicle) for path in paths], vehicle


def rmse(residual: Array) -> float:
    """Return the root of the mean squared length of a residual (n, 3)."""
    return float(np.sqrt(np.mean(np.sum(np.square(residual), axis=1))))


def interval(residual: Array, period: float, rng: np.random.Generator) -> tuple[float, float]:
    """Return the 95 % interval of ``rmse`` by a bootstrap over blocks."""
    length = max(1, round(SETTINGS.resample / period))
    squares = np.sum(np.square(residual), axis=1)
    parts = np.array_split(squares, max(2, len(squares) // length))
    means = np.array([part.mean() for part in parts])
    drawn = means[rng.integers(len(means), size=(SETTINGS.draws, len(means)))].mean(axis=1)
    low, high = np.quantile(np.sqrt(drawn), [0.025, 0.975])
    return float(low), float(high)


def _whole(flights: Sequence[Flight]) -> list[Rows]:
    return [(flight, slice(None)) for flight in flights]


def own_scale(flight: Flight, predicted: Array, thrust: Array) -> float:
    """Return by which share more thrust a flight's first second shows than a model says."""
    first = flight.signals.t < flight.signals.t[0] + SETTINGS.hover
    missing = float(np.mean(flight.force[first, 2] - predicted[first, 2]))
    return missing / float(np.mean(thrust[first, 2]))


def force_study(
    flights: Sequence[Flight], vehicle: Vehicle, report: Callable[[str], None]
) -> list[dict[str, Any]]:
    """Return one row a model, test flight and way of fitting: its residual force and what it found.

    Ways: ``others``, fitted on all other flights; ``one``, on each other flight alone; ``blocks``,
    on all other flights and the other blocks of the same one; ``all``, on every flight, the tested
    one among them.
    """
    rows: list[dict[str, Any]] = []
    for label, (coefficients, filtered) in MODELS.items():
        report(f"fitting: {label}")
        regression = Regression(flights, vehicle, coefficients, priors(vehicle))

        def fit(
            parts: Sequence[Rows], of: Regression = regression, smoothed: bool = filtered
        ) -> ForceModel:
            return of.fit(parts) if smoothed else of.fit(parts, (None,))

        everything = fit(_whole(flights))
        for test in flights:
            others = [flight for flight in flights if flight is not test]
            ways: list[tuple[str, str, ForceModel]] = [
                ("all", "", everything),
                ("others", "", fit(_whole(others))),
            ]
            if label == FULL and len(others) > 1:
                ways += [("one", other.name, fit(_whole([other]))) for other in others]
            for way, on, model in ways:
                predicted = model.force(test, vehicle)
                thrust = model.thrust(test, vehicle)
                scale = own_scale(test, predicted, thrust)
                rows.append(_row(label, test, way, on, test.force - predicted, model, scale))
                rows[-1]["rmse_own_scale"] = rmse(test.force - predicted - scale * thrust)
                rows[-1]["doubt"] = regression.doubt(model, test)
            rows.append(_row(label, test, "blocks", "", _blocks(test, others, fit, vehicle), None))
    for flight in flights:
        if flight.network is not None:
            residual = flight.force - flight.network
            rows.append(_row("published network", flight, "published", "", residual, None))
    return rows


def _blocks(
    test: Flight,
    others: Sequence[Flight],
    fit: Callable[[Sequence[Rows]], ForceModel],
    vehicle: Vehicle,
) -> Array:
    """Return the residual (n, 3) of a flight whose blocks were each left out of the fit."""
    out = np.empty_like(test.force)
    edges = np.linspace(0, len(out), SETTINGS.blocks + 1).astype(int)
    for first, last in pairwise(edges):
        kept: list[Rows] = [(test, slice(0, first)), (test, slice(last, None))]
        model = fit([*_whole(others), *(part for part in kept if part[1] != slice(0, 0))])
        out[first:last] = (test.force - model.force(test, vehicle))[first:last]
    return out


def _row(
    label: str,
    test: Flight,
    way: str,
    on: str,
    residual: Array,
    model: ForceModel | None,
    scale: float | None = None,
) -> dict[str, Any]:
    period = test.signals.period
    slow = low_pass(residual, CUTOFFS.residual_hz, period)
    return {
        "model": label,
        "flight": test.name,
        "way": way,
        "fitted_on": on,
        "samples": len(residual),
        "rmse": rmse(residual),
        "interval": interval(residual, period, np.random.default_rng(0)),
        "rmse_below_5_hz": rmse(slow),
        "axes": [float(x) for x in np.sqrt(np.mean(np.square(residual), axis=0))],
        "own_scale": scale,
        "cutoff_hz": None if model is None else model.cutoff_hz,
        "coefficients": {}
        if model is None
        else {f"{e}.{n}": value for (e, n), value in model.coefficients.items()},
    }


def filter_study(
    flights: Sequence[Flight],
    vehicle: Vehicle,
    fits: Mapping[str, Mapping[str, float]],
    report: Callable[[str], None],
) -> list[dict[str, Any]]:
    """Return the error of the filter's total force on each flight, of the past alone and smoothed:
    by what it measures, pose or attitude and velocity, and with the declared vehicle or with what
    was fitted on the other flights, but for the centre of mass. Beside the whole error stand its
    parts below and above a frequency.

    Total force is what rotors and declared effects give plus the estimated external force. The
    accelerometer is left out: it is what the filter is compared with.
    """
    rows = []
    for flight in flights:
        named = {
            key: x
            for key, x in fits[flight.name].items()
            if key.partition(".")[0] not in _OFF_CENTRE
        }
        for measured, log, settings in (
            ("pose", pose_log(flight), None),
            ("velocity", velocity_log(flight), QUIET),
        ):
            for label, flown in (
                ("declared vehicle", vehicle),
                ("with named effects", _with_fit(vehicle, named)),
            ):
                report(f"filtering: {flight.name}, {measured}, {label}")
                for row in filtered(flight, log, flown, settings):
                    rows.append({"measured": measured, "vehicle": label, **row})
    return rows


def filtered(
    flight: Flight, log: FlightLog, flown: Vehicle, settings: NoiseFitSettings | None
) -> list[dict[str, Any]]:
    """Return the error of the total force, of the past alone and smoothed, of a filter that is
    tuned to a flight's log and knows a vehicle.
    """
    s = flight.signals
    kept = s.t >= s.t[0] + SETTINGS.settled
    tuning = tune_to_log(log, flown, settings=settings).tuning
    rows = []
    for smooth in (False, True):
        series = estimate_log(log, flown, tuning, smooth=smooth)
        error = _total(flight, flown, series.force) - flight.force
        slow = low_pass(error, SETTINGS.split_hz, s.period)
        rows.append(
            {
                "flight": flight.name,
                "smooth": smooth,
                "rmse": rmse(error[kept]),
                "rmse_slow": rmse(slow[kept]),
                "rmse_fast": rmse((error - slow)[kept]),
                "interval": interval(error[kept], s.period, np.random.default_rng(0)),
            }
        )
    return rows


def pose_study(flights: Sequence[Flight], vehicle: Vehicle) -> list[dict[str, Any]]:
    """Return by how much each flight's force differs from that of its own velocity, differentiated:
    what no estimate from the motion can lower. With it how long and fast it flew, and what position
    has above a frequency that the integral of velocity has not.
    """
    gravity = np.array([0.0, 0.0, vehicle.gravity])
    rows = []
    for flight in flights:
        s = flight.signals
        acceleration = derivative(s.velocity, s.period)
        needed = vehicle.mass * np.einsum("nji,nj->ni", s.rotation, acceleration + gravity)
        inside = slice(round(0.25 / s.period), -round(0.25 / s.period))
        apart = s.position - velocity_log(flight).position
        apart -= low_pass(apart, CUTOFFS.residual_hz, s.period)
        rows.append(
            {
                "flight": flight.name,
                "seconds": float(s.t[-1] - s.t[0]),
                "fastest": float(np.linalg.norm(s.velocity, axis=1).max()),
                "rmse": rmse((flight.force - needed)[inside]),
                "position_noise": rmse(apart[inside]) / np.sqrt(3.0),
            }
        )
    return rows


def _total(flight: Flight, vehicle: Vehicle, external: Array) -> Array:
    """Return rotors, declared effects and an external force (n, 3) N, world, in body axes, as the
    force at the pose's point, that of the accelerometer.
    """
    acting, _ = acting_wrench(flight.signals, vehicle)
    total: Array = np.einsum("nji,nj->ni", flight.signals.rotation, acting[:, :3] + external)
    return total


def _with_fit(vehicle: Vehicle, coefficients: Mapping[str, float]) -> Vehicle:
    effects: dict[str, dict[str, float]] = {}
    for key, value in coefficients.items():
        effect, name = key.split(".")
        effects.setdefault(effect, {})[name] = value
    return vehicle.with_effects(*(EffectSetting(k, v) for k, v in effects.items()))
