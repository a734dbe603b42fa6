"""A designed controller's knowledge before its flight: vehicle, sensors, kind of fan, and for some
controllers the fan's family of motions.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ..dynamics.vehicle import Vehicle
from ..dynamics.vehicle_file import load_vehicle
from ..runtime.arrays import Array

# the vehicle of the tasks
standard_vehicle = cache(partial(load_vehicle, "ardrone2"))


def _along(value: ArrayLike, axis: int) -> float:
    return float(np.broadcast_to(np.asarray(value, dtype=np.float64), (3,))[axis])


@dataclass(frozen=True)
class FilterNoise:
    """The wrench filter's noise: standard deviations in one step. They determine how fast the
    estimate follows the truth.
    """

    torque: float = 0.03  # Nm about z, error of the rotor model, new each step
    torque_walk: float = 3.26e-4 / 0.45  # Nm, change of the external torque
    thrust: float = 0.3  # N along y, likewise
    force_walk: float = 3.26e-3 / 0.45  # N
    position: float = 0.001  # m, one measurement
    attitude: float = 0.005  # rad, one measurement
    period: float = 0.005  # s, of a step

    @classmethod
    def of(cls, tuning: Any, period: float) -> Self:
        """Return the noise of a wrench filter with this ``estimator.UKFTuning`` and steps of
        ``period`` s.
        """
        return cls(
            _along(tuning.motor_torque_noise, 2),
            _along(tuning.torque_walk, 2),
            _along(tuning.thrust_noise, 1),
            _along(tuning.force_walk, 1),
            _along(tuning.position_noise, 1),
            _along(tuning.attitude_noise, 2),
            period,
        )


@dataclass(frozen=True)
class Air:
    """Uncertainty of the wrench beyond the mean jet, in the standard scenarios: the actuators'
    unmodelled disturbance and the jet's gusts.
    """

    disturbance_force: float = 0.03  # N, standard deviation along each axis
    disturbance_torque: float = 0.01  # Nm
    disturbance_time: float = 0.3  # s, correlation time
    turbulence: float = 0.10  # gusts as a share of the local axial speed
    gust_length: float = 0.25  # m, correlation length of gusts
    gust_time: float = 0.10  # s, correlation time of gusts


@dataclass(frozen=True)
class Jet:
    """The fan in front of the vehicle, coefficients of the effect ``fan_jet``."""

    u0: float = 3.6  # m/s
    kd: float = 0.020  # N/(m/s), drag of each rotor
    area: float = 0.060  # m2, drag area of the hull
    distance: float = 2.3  # m, the vehicle's distance


# places (n,) m after times (s) of motions with a largest speed (m/s) over a travel (m), from 0 to
# positive places first
PLACES: dict[str, Callable[..., Array]] = {
    "still": lambda speed, travel, time: 0.0 * (speed * time),
    "sine": lambda speed, travel, time: travel * np.sin(speed / travel * time),
    "triangle": lambda speed, travel, time: (
        travel * 2 / math.pi * np.arcsin(np.sin(math.pi / 2 * speed / travel * time))
    ),
    "ramp": lambda speed, travel, time: np.minimum(speed * time, 0.8 + (travel - 0.5) * 8 / 7),
}


@dataclass(frozen=True)
class Motions:
    """The family of a fan's motions, each from its place at the start: a share ``motions`` of
    still, sine, triangle and ramp, at a largest ``speed`` and over a ``travel`` within these
    ranges. A ramp ends after 0.8 m and 8/7 of the travel above its least.
    """

    motions: tuple[str, ...] = ("sine", "triangle", "ramp", "still")
    speed: tuple[float, float] = (0.05, 0.35)  # m/s
    travel: tuple[float, float] = (0.5, 1.2)  # m
    offset: tuple[float, float] = (0.0, 0.1)  # m, from the axis at the start, on either side


@dataclass(frozen=True)
class Briefing:
    """The whole briefing, by default of the scenario ``base``."""

    vehicle: Vehicle = field(default_factory=standard_vehicle)
    noise: FilterNoise = FilterNoise()
    air: Air = Air()
    jet: Jet = Jet()
    motions: Motions = Motions()
