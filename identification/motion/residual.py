"""The residual wrench of a log: what the measured motion needs beyond what a vehicle's model gives.

The model, with the effects that the vehicle declares, is the one that plant and estimator run.
"""

import numpy as np
from numpy.typing import NDArray

from ...dynamics.model import MODEL_FIELDS, apply_effects, drive, load_model
from ...dynamics.vehicle import Vehicle
from ...runtime.compiled import Record, compiled
from .signals import Signals

Array = NDArray[np.float64]

_MODEL = np.dtype(MODEL_FIELDS)


@compiled
def _run_model(
    models: Record,
    period: float,
    speeds: Array,
    voltage: Array,
    position: Array,
    rotation: Array,
    velocity: Array,
    rate: Array,
    rotors: Array,
    effects: Array,
) -> None:
    """Write thrust and torques (n, 4) and the effects' wrench (n, 6) of a whole flight."""
    f = models[0]
    for k in range(len(speeds)):
        drive(f, speeds[k], period, voltage[k])
        apply_effects(f, position[k], rotation[k], velocity[k], rate[k])
        f.time += period
        for i in range(4):
            rotors[k, i] = f.rotor_wrench[i]
        for i in range(6):
            effects[k, i] = f.effect_wrench[i]


def model_wrench(signals: Signals, vehicle: Vehicle) -> tuple[Array, Array, Vehicle]:
    """Return what a model says of a flight: thrust (N) and torques (Nm) of the rotors (n, 4), and
    the effects' wrench (n, 6).

    Thrust is along body z; torques are about the centre of mass in the body frame, the effects'
    force (N) is in the world frame. The vehicle that is returned with them has its body effects
    applied.
    """
    models = np.zeros(1, dtype=_MODEL)
    body = load_model(models[0], vehicle)
    count = len(signals.t)
    rotors, effects = np.empty((count, 4)), np.empty((count, 6))
    _run_model(models, signals.period, *signals.columns(), rotors, effects)
    return rotors, effects, body


@compiled
def _balance(
    rotors: Array,
    effects: Array,
    rotation: Array,
    rate: Array,
    turning: Array,
    com: Array,
    inertia: Array,
    mass: float,
    share: float,
    turn: Array,
    out: Array,
) -> None:
    """Write what rotors and effects give, and a centre of mass off the pose's point needs, as by
    another mass and inertia.
    """
    needed, moment, spin = np.empty(3), np.empty(3), np.empty(3)
    for k in range(len(rotors)):
        w, a = rate[k], turning[k]
        along = w[0] * com[0] + w[1] * com[1] + w[2] * com[2]
        square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
        for i in range(3):
            spin[i] = inertia[i, 0] * w[0] + inertia[i, 1] * w[1] + inertia[i, 2] * w[2]
        for i in range(3):
            x, y = (i + 1) % 3, (i + 2) % 3  # of a cross product
            needed[i] = a[x] * com[y] - a[y] * com[x] + along * w[i] - square * com[i]
            moment[i] = rotors[k, 1 + i] + effects[k, 3 + i] - (w[x] * spin[y] - w[y] * spin[x])
        for i in range(3):
            r = rotation[k, i]
            out[k, i] = share * (r[2] * rotors[k, 0] + effects[k, i]) - mass * (
                r[0] * needed[0] + r[1] * needed[1] + r[2] * needed[2]
            )
            out[k, 3 + i] = turn[i, 0] * moment[0] + turn[i, 1] * moment[1] + turn[i, 2] * moment[2]


def acting_wrench(
    signals: Signals, vehicle: Vehicle, body: Vehicle | None = None
) -> tuple[Array, Vehicle]:
    """Return the force (N, world) and torque (Nm, body) that a model says act (n, 6), without the
    weight, and by which body.

    Both are as if the vehicle had the mass and inertia of ``body``: the accelerations that the
    model says are right. By default it is the vehicle's own, with its body effects applied.
    """
    rotors, effects, model_body = model_wrench(signals, vehicle)
    body = body or model_body
    out = np.empty_like(effects)
    _balance(
        rotors,
        effects,
        np.ascontiguousarray(signals.rotation),
        np.ascontiguousarray(signals.angular_velocity),
        np.ascontiguousarray(signals.angular_acceleration),
        model_body.com,
        model_body.inertia,
        body.mass,
        body.mass / model_body.mass,
        body.inertia @ np.linalg.inv(model_body.inertia),
        out,
    )
    return out, body


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
