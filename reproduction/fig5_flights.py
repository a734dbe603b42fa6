"""The flights of Fig. 5: a hovering and a yawing vehicle that an external force and torque hit, at
two noise levels.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..dynamics import Vehicle, load_vehicle
from ..dynamics.vehicle import Mocap
from ..envs.closed_loop import ClosedLoop
from ..envs.plant import NOISE, TICK, PlantSettings
from ..envs.recording import setpoints_along
from ..runtime.errors import InputError

Array = NDArray[np.float64]

SECONDS = 16.0
STEP_TIME = 7.0  # s, at which the wrench sets in
FORCE = (0.0, 0.0, -0.52)  # N, world: the paper's step
TORQUE = (0.067, 0.0, 0.0)  # Nm, world
TRANSIENT, STEADY = (7.0, 9.5), (11.0, SECONDS)  # s

FLIGHTS = ("hover", "yawing")
NOISES = {"low": Mocap(200.0, 0.001, 0.005), "high": Mocap(200.0, 0.01, 0.05)}
PLANTS = {
    "exact": PlantSettings(disturbance_force=0.0, disturbance_torque=0.0),
    "disturbed": PlantSettings(),
}
_FADE = 2.0  # s, over which the yawing flight gets going
_LOWEST = 0.2  # m
_START_YAW = np.deg2rad(120.0)


@dataclass(frozen=True, eq=False)
class Flight:
    """What was measured in one flight, and the truth; row k is at k times 5 ms."""

    # (n, 11) rotor speeds (rad/s) of the interval that ends at the row, position (m), quaternion
    samples: Array
    wrench: Array  # (n, 6) true external force (N) and torque (Nm) over that interval, world


def window(limits: tuple[float, float]) -> slice:
    """Return the rows of a flight between two times in s."""
    return slice(round(limits[0] / TICK) + 1, round(limits[1] / TICK) + 1)


def vehicle_at(noise: str) -> Vehicle:
    """Return the AR.Drone 2.0 as declared for a noise level, its rotor speeds in 8 bits."""
    return replace(load_vehicle("ardrone2"), mocap=NOISES[noise])


def setpoints(flight: str, t: Array) -> Array:
    """Return the set points (n, 11) of a flight at times ``t`` (n,) s.

    The yawing flight starts at 120 degrees, turns at 1.5 to 4.5 rad/s and translates at up to about
    1.5 m/s.
    """
    path = np.tile([0.0, 0.0, 1.5, 0.0], (len(t), 1))
    if flight == "yawing":
        fade = np.clip(t / _FADE, 0.0, 1.0)
        fade = fade * fade * (3.0 - 2.0 * fade)
        path[:, 0] += fade * np.sin(1.3 * t)
        path[:, 1] += fade * 0.8 * np.sin(0.9 * t + 1.0)
        path[:, 2] += fade * 0.2 * np.sin(0.7 * t)
        path[:, 3] = _START_YAW + TICK * np.cumsum(fade * (3.0 + 1.5 * np.sin(1.1 * t)))
    return setpoints_along(path, t)


def fly(flight: str, noise: str, plant: str, seeds: Sequence[int]) -> list[Flight]:
    """Fly once for each seed, in closed loop with the wrench filter as it is by default.

    Args:
        flight: one of ``FLIGHTS``.
        noise: one of ``NOISES``.
        plant: one of ``PLANTS``.
        seeds: of everything random.

    Raises:
        InputError: the vehicle crashed.
    """
    count = round(SECONDS / TICK) + 1
    targets = setpoints(flight, TICK * np.arange(count, dtype=np.float64))
    loop = ClosedLoop(vehicle_at(noise), settings=PLANTS[plant])
    flights = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        loop.reset(rng, targets[0, :3], float(targets[0, 9]))
        unit = rng.standard_normal((count, NOISE))
        samples, wrench = np.empty((count, 11)), np.zeros((count, 6))
        for k in range(count):
            loop.setpoint[:] = targets[k]
            if k == round(STEP_TIME / TICK):
                loop.applied[:3], loop.applied[3:] = FORCE, TORQUE
            samples[k, :4], wrench[k] = loop.sample[:4], loop.external
            loop.run(unit[k : k + 1])
            samples[k, 4:] = loop.sample[4:]
        # far from the set point is no harm, the step may push it metres away; the floor would be a
        # wrench that nobody counts
        if not loop.healthy() or float(samples[:, 6].min()) < _LOWEST:
            raise InputError(f"fig5: the {flight} flight of seed {seed} at {noise} noise crashed")
        flights.append(Flight(samples, wrench))
    return flights
