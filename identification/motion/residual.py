"""The residual wrench of a log: the wrench of the measured motion less the wrench of a vehicle's
model.

Plant and estimator run the same model, with the vehicle's declared effects.
"""

from functools import lru_cache

import numpy as np

from ...dynamics.model import MODEL_FIELDS, apply_effects, drive, load_model
from ...dynamics.motion import acceleration_of, angular_acceleration_of, body_numbers
from ...dynamics.vehicle import Vehicle
from ...runtime.compiled import Record, compiled, compiled_for_vectors
from ..logs.table import Array
from .signals import Signals

_MODEL = np.dtype(MODEL_FIELDS)


@compiled
def model_numbers(
    f: Record, R: Array
) -> tuple[tuple[float, ...], tuple[float, float, float, float], tuple[float, ...]]:
    """Return an attitude (9), and the wrenches of rotors (4) and effects (6) of a model, as numbers
    of ``acceleration_of``.
    """
    r, e = f.rotor_wrench, f.effect_wrench
    return (
        (R[0, 0], R[0, 1], R[0, 2], R[1, 0], R[1, 1], R[1, 2], R[2, 0], R[2, 1], R[2, 2]),
        (r[0], r[1], r[2], r[3]),
        (e[0], e[1], e[2], e[3], e[4], e[5]),
    )


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
    """Write the force (N, world) and the torque (Nm, body) of a model's accelerations, for a body
    of this mass and inertia, at each sample (n, 6). The measured angular acceleration ``turning``
    moves the pose's point about a centre of mass off this point.
    """
    f = models[0]
    b, nothing = body_numbers(f.body), (0.0, 0.0, 0.0)
    for k in range(len(speeds)):
        drive(f, speeds[k], period, voltage[k])
        apply_effects(f, position[k], rotation[k], velocity[k], rate[k])
        f.time += period
        turn, rotors, effects = model_numbers(f, rotation[k])
        w, a = rate[k], turning[k]
        omega, measured = (w[0], w[1], w[2]), (a[0], a[1], a[2])
        x, y, z = acceleration_of(b, turn, omega, measured, rotors, nothing, effects)
        out[k, 0], out[k, 1], out[k, 2] = mass * x, mass * y, mass * (z + b[22])
        x, y, z = angular_acceleration_of(b, turn, omega, rotors, nothing, effects)
        for i in range(3):
            out[k, 3 + i] = J[i, 0] * x + J[i, 1] * y + J[i, 2] * z


def acting_wrench(
    signals: Signals, vehicle: Vehicle, body: Vehicle | None = None
) -> tuple[Array, Vehicle]:
    """Return the force (N, world) and torque (Nm, body) of a model (n, 6), without the weight, and
    their body.

    Both are for the mass and inertia of ``body``: the model's accelerations are right. By default
    it is the vehicle's own, with its body effects applied.
    """
    models, own = loaded_model(vehicle)
    body = body or own
    out = np.empty((len(signals.t), 6))
    turning = np.ascontiguousarray(signals.angular_acceleration)
    _act(models.copy(), signals.period, *signals.columns(), turning, body.mass, body.inertia, out)
    return out, body


@lru_cache(maxsize=1)  # one vehicle acts on several pieces
def loaded_model(vehicle: Vehicle) -> tuple[np.ndarray, Vehicle]:
    """Return the record (1,) of a vehicle's model, to be copied, and the vehicle with its body
    effects applied.
    """
    models = np.zeros(1, dtype=_MODEL)
    return models, load_model(models[0], vehicle)


def needed_wrench(signals: Signals, body: Vehicle) -> Array:
    """Return the force (N, world) without the weight and the torque (Nm, body) of a body's measured
    motion (n, 6).

    The gyroscopic torque and a centre of mass off the pose's point are left to the model.
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
