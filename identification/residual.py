"""The residual wrench of a log: what the measured motion needs beyond what a vehicle's model gives.

The model, with the effects that the vehicle declares, is the one that plant and estimator run.
"""

import numpy as np
from numpy.typing import NDArray

from ..dynamics.compiled import Record, compiled
from ..dynamics.model import MODEL_FIELDS, apply_effects, drive, load_model
from ..dynamics.vehicle import Vehicle
from .signals import Signals

Array = NDArray[np.float64]

_MODEL = np.dtype(MODEL_FIELDS)


@compiled
def _run_model(models: Record, period: float, speeds: Array, voltage: Array, position: Array, rotation: Array,
               velocity: Array, rate: Array, rotors: Array, effects: Array) -> None:
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
    """Return what a model says of a flight: thrust (N) and torques (Nm) of the rotors (n, 4), and the effects' wrench (n, 6).

    Thrust is along body z; torques are about the centre of mass in the body frame, the effects' force (N) is in the world
    frame. The vehicle that is returned with them has its body effects applied.
    """
    models = np.zeros(1, dtype=_MODEL)
    body = load_model(models[0], vehicle)
    count = len(signals.t)
    rotors, effects = np.empty((count, 4)), np.empty((count, 6))
    voltage = np.zeros(count) if signals.voltage is None else signals.voltage
    speeds, volts, position, rotation, velocity, rate = (np.ascontiguousarray(x) for x in (
        signals.rotor_speeds, voltage, signals.position, signals.rotation, signals.velocity, signals.rate))
    _run_model(models, signals.period, speeds, volts, position, rotation, velocity, rate, rotors, effects)
    return rotors, effects, body


def residual_wrench(signals: Signals, vehicle: Vehicle) -> Array:
    """Return the residual (n, 6): force in the world frame (N), torque about the centre of mass in the body frame (Nm)."""
    rotors, effects, body = model_wrench(signals, vehicle)
    R, omega, alpha = signals.rotation, signals.rate, signals.angular_acceleration
    acceleration = signals.acceleration + np.array([0.0, 0.0, vehicle.gravity])
    if np.any(body.com):
        acceleration = acceleration + centre_acceleration(signals, body)
    force = body.mass * acceleration - R[:, :, 2] * rotors[:, :1] - effects[:, :3]
    torque = alpha @ body.inertia.T + np.cross(omega, omega @ body.inertia.T) - rotors[:, 1:] - effects[:, 3:]
    return np.column_stack([force, torque])


def centre_acceleration(signals: Signals, body: Vehicle) -> Array:
    """Return the acceleration (n, 3) in m/s2, world, of the centre of mass beyond that of the geometric centre."""
    omega = signals.rate
    turning = np.cross(signals.angular_acceleration, body.com) + np.cross(omega, np.cross(omega, body.com))
    return np.asarray(np.einsum("nij,nj->ni", signals.rotation, turning))
