"""The inner flight loop: from a position, velocity and yaw set point to rotor speeds.

A cascade on the estimated state: position, velocity and integral to a thrust vector; its direction
to body rates and torques; torques and thrust through the inverse of the rotor mixing. The defaults
halved the fan-tracking error of softer gains on the AR.Drone model.
"""

import math
from dataclasses import dataclass

import numpy as np

from ..dynamics.effects.base import ROTORS_SIZE, STATE_SIZE
from ..dynamics.model import MAX_EFFECTS, MEMORY
from ..dynamics.motion import BODY, Array, body_record
from ..dynamics.rotation import product, quaternion_to_matrix
from ..dynamics.vehicle import Vehicle
from ..runtime.compiled import Record, compiled
from ..runtime.vector_lanes import any_of, choose

LEAST_THRUST = 0.3  # of the weight
# what a command is: an acceleration beside the flight loop's own, of the set point, or one of the
# loop's lower stages
BESIDE, OF_SETPOINT, ATTITUDE, RATES, ROTORS = range(5)
_SETPOINT_SPEED = 2.0  # m/s, of a set point that commands accelerate
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
        # of ``model_inverse``; all zero where no model is in the loop
        ("foreseen", "f8", (6,)),  # wrench of the model's effects: force world, torque body
        ("wanted", "f8", (4,)),  # rotor speeds to deliver
        ("still", "f8", (3,)),
        ("effect_state", "f8", (STATE_SIZE,)),
        ("rotors", "f8", (ROTORS_SIZE,)),
        ("missing", "f8", (4,)),
        ("probe", "f8", (4,)),
        ("memory", "f8", (MAX_EFFECTS, MEMORY)),
    ]
)


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


@compiled
def move_setpoint(c: Record, position: Array, dt: float) -> None:
    """Move the set point with its own velocity for ``dt`` s; on an axis where it runs too far ahead
    it waits.
    """
    for i in range(3):
        step = dt * c.setpoint[3 + i]
        ahead = c.setpoint[i] + step - position[i]
        moves = (abs(ahead) <= c.leash) | (ahead * step <= 0.0)
        c.setpoint[i] = choose(moves, c.setpoint[i] + step, c.setpoint[i])
    c.setpoint[9] += dt * c.setpoint[10]


@compiled
def _wanted(c: Record, x: Array, dt: float, i: int) -> float:
    """Return the acceleration, m/s2, that the rotors must make along an axis of the world."""
    s = c.setpoint
    error = s[i] - x[i]
    c.sum[i] = min(max(c.sum[i] + dt * error, -2.0), 2.0)
    wanted = (
        s[6 + i] + c.position * error + c.velocity * (s[3 + i] - x[7 + i]) + c.integral * c.sum[i]
    )
    # the model's effects take their part from the rotors
    left: float = wanted - c.foreseen[i] / c.body.mass
    return left


@compiled
def fly(c: Record, x: Array, dt: float) -> None:
    """Write the rotor speeds (4,) rad/s that steer the estimated state ``x`` to the set point into
    ``c.command``.

    ``x`` is laid out as in ``estimator.estimate``: position 0-2, quaternion 3-6, velocity 7-9, body
    rate 10-12.
    """
    R = c.rotation
    quaternion_to_matrix(x[3:7], R)
    a0, a1 = _wanted(c, x, dt, 0), _wanted(c, x, dt, 1)
    a2 = max(_wanted(c, x, dt, 2) + c.body.gravity, LEAST_THRUST * c.body.gravity)
    lateral = math.sqrt(a0 * a0 + a1 * a1)
    limit = a2 * math.tan(c.tilt_limit)
    steep = lateral > limit
    if any_of(steep):
        share = choose(steep, limit / choose(steep, lateral, 1.0), 1.0)
        a0 *= share
        a1 *= share
    thrust = c.body.mass * (a0 * R[0, 2] + a1 * R[1, 2] + a2 * R[2, 2])
    length = math.sqrt(a0 * a0 + a1 * a1 + a2 * a2)
    _point(c, x, dt, thrust, a0 / length, a1 / length, a2 / length)


@compiled
def _point(c: Record, x: Array, dt: float, thrust: float, ux: float, uy: float, uz: float) -> None:
    """Turn the body's z axis to a unit vector of the world, and the yaw to the set point's, at a
    thrust in N.
    """
    R, s = c.rotation, c.setpoint
    # body z x wanted z, in the body frame: the turn that the thrust axis needs
    bx = R[0, 0] * ux + R[1, 0] * uy + R[2, 0] * uz
    by = R[0, 1] * ux + R[1, 1] * uy + R[2, 1] * uz
    wx, wy, wz = x[10], x[11], x[12]
    yaw = math.atan2(R[1, 0], R[0, 0])
    yaw_error = s[9] - yaw
    yaw_error = math.atan2(math.sin(yaw_error), math.cos(yaw_error))
    c.yaw_sum = min(max(c.yaw_sum + dt * yaw_error, -1.0), 1.0)
    # the wanted yaw rate, a turn about the world's vertical, in the body frame
    rx, ry, rz = R[2, 0] * s[10], R[2, 1] * s[10], R[2, 2] * s[10]
    alpha_x = -c.attitude * by - c.rate * (wx - rx)
    alpha_y = c.attitude * bx - c.rate * (wy - ry)
    alpha_z = c.yaw * yaw_error + c.yaw_rate * (rz - wz) + c.yaw_integral * c.yaw_sum
    _turn(c, x, thrust, alpha_x, alpha_y, alpha_z)


@compiled
def _turn(
    c: Record, x: Array, thrust: float, alpha_x: float, alpha_y: float, alpha_z: float
) -> None:
    """Write the rotor speeds of a thrust in N and an angular acceleration in rad/s2, body."""
    wx, wy, wz, J = x[10], x[11], x[12], c.body.inertia
    hx, hy, hz = product(J, wx, wy, wz)
    tx, ty, tz = product(J, alpha_x, alpha_y, alpha_z)
    # here the thrust's torque about a declared centre of mass off the rotors' centre is balanced
    tx = tx + wy * hz - wz * hy - c.foreseen[3] + c.body.com[1] * thrust
    ty = ty + wz * hx - wx * hz - c.foreseen[4] - c.body.com[0] * thrust
    tz = tz + wx * hy - wy * hx - c.foreseen[5]
    for i in range(4):
        square = (
            c.unmixing[i, 0] * thrust
            + c.unmixing[i, 1] * tx
            + c.unmixing[i, 2] * ty
            + c.unmixing[i, 3] * tz
        )
        c.command[i] = min(math.sqrt(max(square, 0.0)), c.omega_max)


@compiled
def fly_attitude(c: Record, x: Array, wanted: Array, dt: float) -> None:
    """Fly a commanded attitude: roll and pitch (rad), yaw rate (rad/s) and thrust (m/s2).

    Roll and pitch turn about the body's x and y axes at the present yaw, in the order yaw, pitch,
    roll. ``move_setpoint`` carries the set point's yaw along at the yaw rate.
    """
    R = c.rotation
    quaternion_to_matrix(x[3:7], R)
    c.setpoint[10] = wanted[2]
    yaw = math.atan2(R[1, 0], R[0, 0])
    forward, right = math.sin(wanted[1]) * math.cos(wanted[0]), math.sin(wanted[0])
    ux = math.cos(yaw) * forward + math.sin(yaw) * right
    uy = math.sin(yaw) * forward - math.cos(yaw) * right
    uz = math.cos(wanted[1]) * math.cos(wanted[0])
    _point(c, x, dt, c.body.mass * wanted[3], ux, uy, uz)


@compiled
def fly_rates(c: Record, x: Array, wanted: Array) -> None:
    """Fly commanded angular velocities (rad/s, body) and thrust (m/s2)."""
    alpha_x = c.rate * (wanted[0] - x[10])
    alpha_y = c.rate * (wanted[1] - x[11])
    alpha_z = c.yaw_rate * (wanted[2] - x[12])
    _turn(c, x, c.body.mass * wanted[3], alpha_x, alpha_y, alpha_z)


@compiled
def steer(c: Record, x: Array, command: Array, kind: int, dt: float) -> None:
    """Fly a command (4,) of a kind, ``BESIDE`` to ``ROTORS``, and write the rotor speeds.

    ``BESIDE``, ``OF_SETPOINT``: m/s2, world, in the first three. ``ATTITUDE``: as of
    ``fly_attitude``. ``RATES``: as of ``fly_rates``. ``ROTORS``: rad/s.
    """
    if kind == ROTORS:
        for i in range(4):
            c.command[i] = command[i]
    elif kind == RATES:
        fly_rates(c, x, command)
    elif kind == ATTITUDE:
        fly_attitude(c, x, command, dt)
    else:
        if kind == OF_SETPOINT:
            for i in range(3, 6):
                speed = c.setpoint[i] + dt * command[i - 3]
                c.setpoint[i] = min(max(speed, -_SETPOINT_SPEED), _SETPOINT_SPEED)
        for i in range(3):
            c.setpoint[6 + i] += command[i]
        fly(c, x, dt)
        for i in range(3):
            c.setpoint[6 + i] -= command[i]
