"""The inner flight loop's gains and memory; the loop itself is ``core/flight_loop.hpp``.

The defaults halved the fan-tracking error of softer gains on the AR.Drone model.
"""

import math
from dataclasses import dataclass

import numpy as np

from .. import _core
from ..dynamics.motion import BODY, body_record
from ..dynamics.vehicle import Vehicle

LEAST_THRUST = 0.3  # share of the weight
# Kinds of commands. An acceleration (m/s2, world) beside the flight loop's own, or of the set
# point. Roll and pitch (rad), yaw rate (rad/s) and thrust (m/s2). Angular velocities (rad/s, body)
# and thrust. Rotor speeds (rad/s).
BESIDE, OF_SETPOINT, ATTITUDE, RATES, ROTORS = range(5)
# set point: position 0-2, velocity 3-5, acceleration 6-8, yaw 9, yaw rate 10
SETPOINT_SIZE = 11


@dataclass(frozen=True)
class FlightGains:
    """Gains of the flight loop; each acts on an acceleration, so they do not depend on the
    vehicle's size.
    """

    position: float = 4.0  # 1/s2
    velocity: float = 6.0  # 1/s
    integral: float = 1.0  # 1/s3
    attitude: float = 110.0  # 1/s2
    rate: float = 18.0  # 1/s
    yaw: float = 12.0  # 1/s2
    yaw_rate: float = 6.0  # 1/s
    yaw_integral: float = 4.0  # 1/s3
    tilt_limit: float = 0.5  # rad
    leash: float = 0.5  # m, how far a moving set point runs ahead of the vehicle before it waits


FLIGHT = np.dtype(
    [
        ("body", BODY),
        ("unmixing", "f8", (4, 4)),
        ("omega_max", "f8"),
        ("hover_rate", "f8"),
        *[(name, "f8") for name in FlightGains.__dataclass_fields__],
        ("setpoint", "f8", (SETPOINT_SIZE,)),
        ("sum", "f8", (3,)),
        ("yaw_sum", "f8"),
        ("rotation", "f8", (3, 3)),
        ("command", "f8", (4,)),  # rotor speeds, rad/s
        # zero where no model is in the loop
        ("foreseen", "f8", (6,)),  # wrench of the model's effects: force world, torque body
        ("wanted", "f8", (4,)),  # rotor speeds to deliver
    ]
)
assert FLIGHT.itemsize == _core.FLIGHT_SIZE, "the core was built for another layout"


def flight_record(vehicle: Vehicle, gains: FlightGains | None = None) -> np.ndarray:
    """Return the flight loop's memory (1,) for a vehicle; ``omega_max`` limits its commands."""
    gains = FlightGains() if gains is None else gains
    record = np.zeros(1, dtype=FLIGHT)
    c = record[0]
    c["body"] = body_record(vehicle)[0]
    c["unmixing"] = np.linalg.inv(vehicle.mixing)
    # a rotor that makes four times its hover thrust where nothing else is stated
    c["omega_max"] = (
        vehicle.omega_max if math.isfinite(vehicle.omega_max) else 2.0 * vehicle.hover_rate
    )
    for name in FlightGains.__dataclass_fields__:
        c[name] = getattr(gains, name)
    c["hover_rate"] = vehicle.hover_rate
    reset_flight(c)
    return record


def reset_flight(c: np.void) -> None:
    """Forget the last flight."""
    c["sum"], c["yaw_sum"], c["foreseen"] = 0.0, 0.0, 0.0
    c["command"] = c["wanted"] = c["hover_rate"]
