"""Flights whose external wrench is known, and what is done to their poses."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from windwrench.dynamics.vehicle import Vehicle
from windwrench.dynamics.vehicle_file import load_vehicle
from windwrench.envs.recording import background, record_flight
from windwrench.estimator import UKFTuning
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.runtime.errors import InputError
from windwrench.studies.trials.rotorpy_flights import hummingbird_vehicle, rotorpy_flight

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Wind = tuple[float, float, float]

SETTLED = 2.0  # s after the start that no error counts
# trajectory and mean wind, m/s: from a hover to a shake with all that the rotors give
ROTORPY: tuple[tuple[str, Wind], ...] = (
    ("hover", (2.0, 0.0, 0.0)),
    ("gentle", (0.0, 0.0, 0.0)),
    ("yaw", (2.0, 0.0, 0.0)),
    ("circle", (0.0, 3.0, 0.0)),
    ("vertical", (2.0, 2.0, 0.0)),
    ("fast", (3.0, 1.0, 0.5)),
    ("excite", (0.0, 0.0, 0.0)),
    ("excite", (1.0, -2.0, 0.0)),
    ("shake", (0.0, 0.0, 0.0)),
)
PLANT_VEHICLES = ("ardrone2", "crazyflie")
TURBULENCE = 5.0  # times the disturbance of the standard scenarios


@dataclass(frozen=True, eq=False)
class Flight:
    """A log with its truth, the vehicle as declared, and the tuning that it is estimated with."""

    name: str
    log: FlightLog
    vehicle: Vehicle
    tuning: UKFTuning | None = None  # None: the default of ``estimate``


def rotorpy_flights(seconds: float, seed: int) -> Iterator[Flight]:
    """Fly RotorPy's Hummingbird with its aerodynamics, of which the declared vehicle has none: they
    are the external wrench.
    """
    vehicle = hummingbird_vehicle()
    for i, (trajectory, wind) in enumerate(ROTORPY):
        log = _flown(trajectory, seconds, seed + i, wind)
        speed = float(np.linalg.norm(wind))
        yield Flight(f"{trajectory}, wind {speed:.1f} m/s", log, vehicle)


def _flown(trajectory: str, seconds: float, seed: int, wind: Wind) -> FlightLog:
    """Fly it with the first of ten seeds at which RotorPy's controller keeps to the path."""
    for further in range(9):
        try:
            return rotorpy_flight(trajectory, seconds, seed + 100 * further, wind=wind)
        except InputError:
            continue
    return rotorpy_flight(trajectory, seconds, seed + 900, wind=wind)


def plant_flight(name: str, seconds: float, seed: int) -> Flight:
    """Fly one of the kit's vehicles in its own plant, calmly or fast by turns, in turbulence."""
    vehicle = load_vehicle(name)
    columns: dict[str, Any] = record_flight(
        vehicle,
        trajectory=("gentle", "fast")[seed % 2],
        seconds=seconds,
        seed=seed,
        settings=background(vehicle, TURBULENCE),
    )
    return Flight(name, FlightLog(**columns, name=f"{name}-{seed}"), vehicle)


def isolated(log: FlightLog, share: float, far: float, rng: np.random.Generator) -> FlightLog:
    """Move a share of the poses by ``far`` m, each in a direction of its own."""
    hit: Mask = (rng.random(len(log.t)) < share) & (log.t > log.t[0] + SETTLED) & log.valid
    return replace(log, position=log.position + hit[:, None] * far * _directions(len(hit), rng))


def bursts(
    log: FlightLog,
    seconds: float,
    every: float,
    far: float,
    together: bool,
    rng: np.random.Generator,
) -> tuple[FlightLog, Mask]:
    """Spoil all poses of ``seconds`` s every so many s: by one and the same ``far`` m, as where two
    markers change places, or (not ``together``) each in a direction of its own. Returns also the
    spoiled rows.
    """
    hit, number = _stretches(log, seconds, every)
    drawn = _directions(len(hit), rng)
    apart = drawn[number] if together else drawn
    return replace(log, position=log.position + hit[:, None] * far * apart), hit


def gaps(log: FlightLog, seconds: float, every: float) -> tuple[FlightLog, Mask]:
    """Take the poses of the same stretches away. Returns also their rows."""
    hit, _ = _stretches(log, seconds, every)
    return replace(log, valid=log.valid & ~hit), hit


def _stretches(log: FlightLog, seconds: float, every: float) -> tuple[Mask, NDArray[np.int64]]:
    """Return the rows of the last ``seconds`` s of every so many, and each row's stretch."""
    where = log.t - log.t[0] - SETTLED
    hit = (where > 0.0) & (np.mod(where, every) > every - seconds)
    return hit, np.floor_divide(where, every).astype(np.int64).clip(0)


def _directions(count: int, rng: np.random.Generator) -> Array:
    drawn = rng.standard_normal((count, 3))
    unit: Array = drawn / np.linalg.norm(drawn, axis=1, keepdims=True)
    return unit
