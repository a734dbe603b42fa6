"""How a quadrotor moves: the prediction model of McKinnon and Schoellig, (2)-(5) and (11)-(14).

Zero-order hold: attitude, thrust, torque and wrench are taken at the start of the step.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ..runtime.compiled import Record, compiled, compiled_inline
from .effects.base import (
    POSITION,
    RATE,
    ROTATION,
    ROTOR_SPEED,
    ROTOR_THRUST,
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


@compiled_inline
def body_numbers(body: Record) -> tuple[float, ...]:
    """Return inertia (9), inverse inertia (9), the geometric centre from the centre of mass (3),
    inverse mass and gravity: read ahead of a loop, they stay in registers.
    """
    J, K, c = body.inertia, body.inverse_inertia, body.com
    return (
        *(J[0, 0], J[0, 1], J[0, 2], J[1, 0], J[1, 1], J[1, 2], J[2, 0], J[2, 1], J[2, 2]),
        *(K[0, 0], K[0, 1], K[0, 2], K[1, 0], K[1, 1], K[1, 2], K[2, 0], K[2, 1], K[2, 2]),
        *(-c[0], -c[1], -c[2], 1.0 / body.mass, body.gravity),
    )


@compiled_inline
def angular_acceleration_of(
    b: tuple[float, ...],
    R: tuple[float, ...],
    omega: tuple[float, float, float],
    rotors: tuple[float, float, float, float],
    torque: tuple[float, float, float],
    effects: tuple[float, ...],
) -> tuple[float, float, float]:
    """Return the angular acceleration, rad/s2, body: (12). The arguments are those of
    ``accelerations_of``.
    """
    wx, wy, wz = omega
    t0, t1, t2 = torque
    hx = b[0] * wx + b[1] * wy + b[2] * wz
    hy = b[3] * wx + b[4] * wy + b[5] * wz
    hz = b[6] * wx + b[7] * wy + b[8] * wz
    # the world torque enters as R' tau
    tx = rotors[1] + effects[3] + R[0] * t0 + R[3] * t1 + R[6] * t2 - (wy * hz - wz * hy)
    ty = rotors[2] + effects[4] + R[1] * t0 + R[4] * t1 + R[7] * t2 - (wz * hx - wx * hz)
    tz = rotors[3] + effects[5] + R[2] * t0 + R[5] * t1 + R[8] * t2 - (wx * hy - wy * hx)
    return (
        b[9] * tx + b[10] * ty + b[11] * tz,
        b[12] * tx + b[13] * ty + b[14] * tz,
        b[15] * tx + b[16] * ty + b[17] * tz,
    )


@compiled_inline
def acceleration_of(
    b: tuple[float, ...],
    R: tuple[float, ...],
    omega: tuple[float, float, float],
    turning: tuple[float, float, float],
    rotors: tuple[float, float, float, float],
    force: tuple[float, float, float],
    effects: tuple[float, ...],
) -> tuple[float, float, float]:
    """Return the acceleration of the geometric centre, m/s2, world: (4), and its acceleration about
    the centre of mass. ``turning`` is the angular acceleration; the others are those of
    ``accelerations_of``.
    """
    wx, wy, wz = omega
    ax, ay, az = turning
    cx, cy, cz, inverse_mass = b[18], b[19], b[20], b[21]
    nx, ny, nz = wy * cz - wz * cy, wz * cx - wx * cz, wx * cy - wy * cx
    px = ay * cz - az * cy + wy * nz - wz * ny
    py = az * cx - ax * cz + wz * nx - wx * nz
    pz = ax * cy - ay * cx + wx * ny - wy * nx
    fx = R[2] * rotors[0] + force[0] + effects[0]
    fy = R[5] * rotors[0] + force[1] + effects[1]
    fz = R[8] * rotors[0] + force[2] + effects[2]
    return (
        fx * inverse_mass + (R[0] * px + R[1] * py + R[2] * pz),
        fy * inverse_mass + (R[3] * px + R[4] * py + R[5] * pz),
        fz * inverse_mass + (R[6] * px + R[7] * py + R[8] * pz) - b[22],
    )


@compiled_inline
def accelerations_of(
    b: tuple[float, ...],
    R: tuple[float, ...],
    omega: tuple[float, float, float],
    rotors: tuple[float, float, float, float],
    torque: tuple[float, float, float],
    force: tuple[float, float, float],
    effects: tuple[float, ...],
) -> tuple[float, ...]:
    """Return the accelerations (6) of ``accelerations`` from numbers: ``body_numbers`` and the rest
    of its arguments.
    """
    turning = angular_acceleration_of(b, R, omega, rotors, torque, effects)
    x, y, z = acceleration_of(b, R, omega, turning, rotors, force, effects)
    return x, y, z, turning[0], turning[1], turning[2]


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
    R, e = rotation, effects
    out[0], out[1], out[2], out[3], out[4], out[5] = accelerations_of(
        body_numbers(body),
        (R[0, 0], R[0, 1], R[0, 2], R[1, 0], R[1, 1], R[1, 2], R[2, 0], R[2, 1], R[2, 2]),
        (omega[0], omega[1], omega[2]),
        (rotors[0], rotors[1], rotors[2], rotors[3]),
        (torque[0], torque[1], torque[2]),
        (force[0], force[1], force[2]),
        (e[0], e[1], e[2], e[3], e[4], e[5]),
    )


# rad: beyond, a step carries the angular momentum by the exact rotation
LONG_TURN = 0.25


@compiled
def gyroscopic_rest(
    inertia: Array, inverse: Array, wx: float, wy: float, wz: float, square: float, dt: float
) -> tuple[float, float, float]:
    """Return the angular acceleration, rad/s2, body, that (12) lacks of the exact turn of the
    angular momentum, ``square`` being that of the step's angle.

    (12) takes ``-omega x J omega`` at the step's start for the whole step: explicit Euler. Euler
    adds energy in each step, and without bound in long turns. In the body frame the momentum of a
    free body turns by ``exp(-[omega dt]x)``, at a constant length. Below ``LONG_TURN``, where the
    two agree within a few percent of the gyroscopic term, (12) stands as printed.
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

    ``state`` (STATE_SIZE,) is scratch but for the rotors' acceleration, an input.
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
