"""The residual wrench of a log: what the measured motion needs beyond what a vehicle's model gives.

The model, with the effects that the vehicle declares, is the one that plant and estimator run.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ...dynamics.model import MODEL_FIELDS, apply_effects, drive, load_model
from ...dynamics.motion import acceleration_of, angular_acceleration_of, body_numbers
from ...dynamics.vehicle import Vehicle
from ...runtime.compiled import Record, compiled_for_vectors
from .signals import Signals

Array = NDArray[np.float64]

_MODEL = np.dtype(MODEL_FIELDS)


@compiled_for_vectors
def _act(
    models: Record,
    period: float,
    speeds: Array,
    voltage: Array,
    position: Array,
    rotation: Array,
    velocity: Array,
    rate: Array,
    turning: Array,
    mass: float,
    J: Array,
    out: Array,
) -> None:
    """Write the force (N, world) and the torque (Nm, body) that a model's accelerations mean to a
    body of this mass and inertia at each sample (n, 6). Where the centre of mass is off the pose's
    point, the measured angular acceleration ``turning`` moves that point.
    """
    f = models[0]
    b, nothing = body_numbers(f.body), (0.0, 0.0, 0.0)
    for k in range(len(speeds)):
        drive(f, speeds[k], period, voltage[k])
        apply_effects(f, position[k], rotation[k], velocity[k], rate[k])
        f.time += period
        R, w, a, r, e = rotation[k], rate[k], turning[k], f.rotor_wrench, f.effect_wrench
        turn = (R[0, 0], R[0, 1], R[0, 2], R[1, 0], R[1, 1], R[1, 2], R[2, 0], R[2, 1], R[2, 2])
        omega, measured = (w[0], w[1], w[2]), (a[0], a[1], a[2])
        rotors, effects = (r[0], r[1], r[2], r[3]), (e[0], e[1], e[2], e[3], e[4], e[5])
        x, y, z = acceleration_of(b, turn, omega, measured, rotors, nothing, effects)
        out[k, 0], out[k, 1], out[k, 2] = mass * x, mass * y, mass * (z + b[22])
        x, y, z = angular_acceleration_of(b, turn, omega, rotors, nothing, effects)
        for i in range(3):
            out[k, 3 + i] = J[i, 0] * x + J[i, 1] * y + J[i, 2] * z


def acting_wrench(
    signals: Signals, vehicle: Vehicle, body: Vehicle | None = None
) -> tuple[Array, Vehicle]:
    """Return the force (N, world) and torque (Nm, body) that a model says act (n, 6), without the
    weight, and by which body.

    Both are as if the vehicle had the mass and inertia of ``body``: the accelerations that the
    model says are right. By default it is the vehicle's own, with its body effects applied.
    """
    models, own = _loaded(vehicle)
    body = body or own
    out = np.empty((len(signals.t), 6))
    turning = np.ascontiguousarray(signals.angular_acceleration)
    _act(models.copy(), signals.period, *signals.columns(), turning, body.mass, body.inertia, out)
    return out, body


@lru_cache(maxsize=1)  # one vehicle acts on several pieces
def _loaded(vehicle: Vehicle) -> tuple[np.ndarray, Vehicle]:
    models = np.zeros(1, dtype=_MODEL)
    return models, load_model(models[0], vehicle)


def needed_wrench(signals: Signals, body: Vehicle) -> Array:
    """Return the force (N, world) beside the weight and the torque (Nm, body) that a body's
    measured motion needs (n, 6).

    But for the inertia's torque of turning, and a centre of mass that is off: these are the model's
    to know.
    """
    return np.column_stack(
        [
            body.mass * (signals.acceleration + np.array([0.0, 0.0, body.gravity])),
            signals.angular_acceleration @ body.inertia.T,
        ]
    )


def residual_wrench(signals: Signals, vehicle: Vehicle) -> Array:
    """Return the residual (n, 6): force in the world frame (N), torque about the centre of mass in
    the body frame (Nm).
    """
    acting, body = acting_wrench(signals, vehicle)
    return needed_wrench(signals, body) - acting
