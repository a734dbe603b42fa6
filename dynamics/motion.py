"""How a quadrotor moves: the prediction model of McKinnon and Schoellig, (2)-(5) and (11)-(14).

Zero-order hold: attitude, thrust, torque and wrench are those of the start of the step.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ..runtime.compiled import Record, compiled
from .effects.base import (
    POSITION,
    RATE,
    ROTATION,
    ROTOR_SPEED,
    ROTOR_THRUST,
    STATE_SIZE,
    TIME,
    VELOCITY,
    VOLTAGE,
    WIND,
)
from .effects.call import add_wrenches
from .vehicle import Vehicle

Array = NDArray[np.float64]

BODY = np.dtype(
    [
        ("mass", "f8"),
        ("gravity", "f8"),
        ("com", "f8", (3,)),
        ("inertia", "f8", (3, 3)),
        ("inverse_inertia", "f8", (3, 3)),
        ("k", "f8", (4,)),
        ("mixing", "f8", (4, 4)),
    ]
)


def body_record(vehicle: Vehicle) -> np.ndarray:
    """Return a vehicle's rigid body and rotors as an array (1,) of ``BODY``, for compiled code."""
    record = np.zeros(1, dtype=BODY)
    body = record[0]
    body["mass"], body["gravity"], body["com"] = vehicle.mass, vehicle.gravity, vehicle.com
    body["inertia"], body["inverse_inertia"] = vehicle.inertia, np.linalg.inv(vehicle.inertia)
    body["k"], body["mixing"] = vehicle.k, vehicle.mixing
    return record


@compiled
def rotor_wrench(body: Record, rotor_speeds: Array, out: Array) -> None:
    """Write total thrust (N) and body torques about the centre of mass (Nm) into ``out`` (4,): (1),
    (8)-(10).
    """
    for i in range(4):
        total = 0.0
        for j in range(4):
            total += body.mixing[i, j] * rotor_speeds[j] * rotor_speeds[j]
        out[i] = total
    out[1] -= body.com[1] * out[0]
    out[2] += body.com[0] * out[0]


@compiled
def accelerations(
    body: Record,
    rotation: Array,
    omega: Array,
    rotors: Array,
    torque: Array,
    force: Array,
    effects: Array,
    out: Array,
) -> None:
    """Write the accelerations of the geometric centre (world) and of the attitude (body) into
    ``out`` (6,): (4), (12).

    ``rotors`` is (4,) thrust and torques, ``torque`` and ``force`` (3,) the external wrench in the
    world frame, ``effects`` (6,) the wrench of the declared effects: force in the world, torque in
    the body frame.
    """
    J = body.inertia
    wx, wy, wz = omega[0], omega[1], omega[2]
    hx = J[0, 0] * wx + J[0, 1] * wy + J[0, 2] * wz
    hy = J[1, 0] * wx + J[1, 1] * wy + J[1, 2] * wz
    hz = J[2, 0] * wx + J[2, 1] * wy + J[2, 2] * wz
    # the world torque enters as R' tau
    tx = (
        rotors[1]
        + effects[3]
        + rotation[0, 0] * torque[0]
        + rotation[1, 0] * torque[1]
        + rotation[2, 0] * torque[2]
    )
    ty = (
        rotors[2]
        + effects[4]
        + rotation[0, 1] * torque[0]
        + rotation[1, 1] * torque[1]
        + rotation[2, 1] * torque[2]
    )
    tz = (
        rotors[3]
        + effects[5]
        + rotation[0, 2] * torque[0]
        + rotation[1, 2] * torque[1]
        + rotation[2, 2] * torque[2]
    )
    tx -= wy * hz - wz * hy
    ty -= wz * hx - wx * hz
    tz -= wx * hy - wy * hx
    inverse = body.inverse_inertia
    ax = inverse[0, 0] * tx + inverse[0, 1] * ty + inverse[0, 2] * tz
    ay = inverse[1, 0] * tx + inverse[1, 1] * ty + inverse[1, 2] * tz
    az = inverse[2, 0] * tx + inverse[2, 1] * ty + inverse[2, 2] * tz
    out[3], out[4], out[5] = ax, ay, az
    # the geometric centre lies at -com from the centre of mass: a rigid-body point's acceleration
    cx, cy, cz = -body.com[0], -body.com[1], -body.com[2]
    nx, ny, nz = wy * cz - wz * cy, wz * cx - wx * cz, wx * cy - wy * cx
    px = ay * cz - az * cy + wy * nz - wz * ny
    py = az * cx - ax * cz + wz * nx - wx * nz
    pz = ax * cy - ay * cx + wx * ny - wy * nx
    inverse_mass = 1.0 / body.mass
    for i in range(3):
        out[i] = (rotation[i, 2] * rotors[0] + force[i] + effects[i]) * inverse_mass
        out[i] += rotation[i, 0] * px + rotation[i, 1] * py + rotation[i, 2] * pz
    out[2] -= body.gravity


# rad: a step that turns the body further carries its angular momentum by the exact rotation
LONG_TURN = 0.25


@compiled
def gyroscopic_rest(
    inertia: Array, inverse: Array, wx: float, wy: float, wz: float, square: float, dt: float
) -> tuple[float, float, float]:
    """Return the angular acceleration, rad/s2, body, that (12) lacks of the exact turn of the
    angular momentum, ``square`` being that of the step's angle.

    (12) takes ``-omega x J omega`` of the step's start for all of it: explicit Euler, which adds
    energy in each step, and without bound where a step turns far. In the body frame the momentum
    of a free body turns by ``exp(-[omega dt]x)``, which keeps its length. Below ``LONG_TURN``,
    where the two agree within a few percent of the gyroscopic term, (12) stands as printed.
    """
    hx = inertia[0, 0] * wx + inertia[0, 1] * wy + inertia[0, 2] * wz
    hy = inertia[1, 0] * wx + inertia[1, 1] * wy + inertia[1, 2] * wz
    hz = inertia[2, 0] * wx + inertia[2, 1] * wy + inertia[2, 2] * wz
    gx, gy, gz = wy * hz - wz * hy, wz * hx - wx * hz, wx * hy - wy * hx
    angle = math.sqrt(square)
    first = 1.0 - math.sin(angle) / angle
    second = dt * (1.0 - math.cos(angle)) / square
    tx = first * gx + second * (wy * gz - wz * gy)
    ty = first * gy + second * (wz * gx - wx * gz)
    tz = first * gz + second * (wx * gy - wy * gx)
    return (
        inverse[0, 0] * tx + inverse[0, 1] * ty + inverse[0, 2] * tz,
        inverse[1, 0] * tx + inverse[1, 1] * ty + inverse[1, 2] * tz,
        inverse[2, 0] * tx + inverse[2, 1] * ty + inverse[2, 2] * tz,
    )


@compiled
def effect_wrench(
    models: np.ndarray,
    coefficients: Array,
    constants: Array,
    body: Record,
    position: Array,
    rotation: Array,
    velocity: Array,
    omega: Array,
    rotor_speeds: Array,
    wind: Array,
    voltage: float,
    time: float,
    state: Array,
    out: Array,
) -> None:
    """Write the summed wrench (6,) of the effects into ``out``: force in the world, torque in the
    body frame.

    ``state`` (STATE_SIZE,) is scratch but for the rotors' acceleration, which must be there.
    """
    fill_state(body, position, rotation, velocity, omega, rotor_speeds, wind, voltage, time, state)
    for i in range(6):
        out[i] = 0.0
    add_wrenches(models, coefficients, constants, state, out)


@compiled
def fill_state(
    body: Record,
    position: Array,
    rotation: Array,
    velocity: Array,
    omega: Array,
    rotor_speeds: Array,
    wind: Array,
    voltage: float,
    time: float,
    state: Array,
) -> None:
    """Lay a state of the flight out for the effect models in ``state`` (STATE_SIZE,), all but the
    rotors' acceleration.
    """
    for i in range(3):
        state[POSITION + i] = position[i]
        state[VELOCITY + i] = velocity[i]
        state[RATE + i] = omega[i]
        state[WIND + i] = wind[i]
        for j in range(3):
            state[ROTATION + 3 * i + j] = rotation[i, j]
    for i in range(4):
        state[ROTOR_SPEED + i] = rotor_speeds[i]
        state[ROTOR_THRUST + i] = body.k[i] * rotor_speeds[i] * rotor_speeds[i]
    state[VOLTAGE] = voltage
    state[TIME] = time


__all__ = [
    "BODY",
    "LONG_TURN",
    "STATE_SIZE",
    "accelerations",
    "body_record",
    "effect_wrench",
    "fill_state",
    "gyroscopic_rest",
    "rotor_wrench",
]
