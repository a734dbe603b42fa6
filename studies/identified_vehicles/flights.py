"""Vehicles that nobody declared: presets with every coefficient off by a factor of 0.5 to 2, flown
in the plant.
"""

from dataclasses import replace

import numpy as np

from windwrench.dynamics import load_vehicle
from windwrench.dynamics.vehicle import EffectSetting, Vehicle
from windwrench.envs.recording import record_flight
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.runtime.errors import InputError

VEHICLES = ("ardrone2", "crazyflie", "hummingbird")
TRAJECTORIES = ("excite", "shake", "yaw")
SECONDS = 20.0  # of each of the three
LAG = {"ardrone2": 0.04, "crazyflie": 0.05, "hummingbird": 0.04}  # s, times 0.6 to 1.6
_ATTEMPTS = 4


def drawn_vehicle(name: str, rng: np.random.Generator) -> Vehicle:
    """Return a preset with inertia, thrust and torque coefficients each times 0.5 to 2; the inertia
    stays one that a body can have.
    """
    vehicle = load_vehicle(name)
    factor = np.exp2(rng.uniform(-1.0, 1.0, 5))
    inertia = np.diag(vehicle.inertia) * factor[:3]
    low, high = 1.02 * abs(inertia[0] - inertia[1]), 0.98 * (inertia[0] + inertia[1])
    inertia[2] = np.clip(inertia[2], low, high)
    speed = factor[3] ** -0.5  # hover is where it was, in thrust
    return replace(
        vehicle,
        inertia=np.diag(inertia),
        k=vehicle.k * factor[3],
        p=vehicle.p * factor[4],
        omega_max=vehicle.omega_max * speed,
        omega_lsb=vehicle.omega_lsb * speed,
    )


def flown(name: str, seed: int, commanded: bool) -> tuple[Vehicle, float, list[FlightLog]]:
    """Return a vehicle, its motor lag (s; 0 where the log holds measured speeds), and its logs.

    Args:
        name: of the preset.
        seed: of the vehicle and its flights.
        commanded: the logs hold commanded rotor speeds, which the rotors follow with a lag.

    Raises:
        InputError: none of a few drawn vehicles can be flown.
    """
    for attempt in range(_ATTEMPTS):
        rng = np.random.default_rng([seed, attempt, VEHICLES.index(name), int(commanded)])
        vehicle = drawn_vehicle(name, rng)
        lag = LAG[name] * float(rng.uniform(0.6, 1.6)) if commanded else 0.0
        effects = (EffectSetting("motor_lag", {"tau": lag}),) if commanded else ()
        try:
            # its own for each vehicle and each flight: flights with the same disturbances and
            # sensor noise would be the same noise twice, which no interval can know
            own = len(TRAJECTORIES) * (len(VEHICLES) * seed + VEHICLES.index(name))
            return (
                vehicle,
                lag,
                [_log(vehicle, effects, t, own + i) for i, t in enumerate(TRAJECTORIES)],
            )
        except InputError:
            continue
    raise InputError(f"{name}: none of {_ATTEMPTS} drawn vehicles flew; expected one that does")


def _log(
    vehicle: Vehicle, effects: tuple[EffectSetting, ...], trajectory: str, seed: int
) -> FlightLog:
    columns = record_flight(vehicle, effects, trajectory, SECONDS, seed)
    return FlightLog(
        columns["t"],
        columns["position"],
        columns["quaternion"],
        columns["rotor_speeds"],
        columns.get("voltage"),
        name=trajectory,
    )
