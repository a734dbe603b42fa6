"""The residual wrench of a log: the wrench of the measured motion less the wrench of a vehicle's
model.

Plant and estimator run the same model, with the vehicle's declared effects.
"""

from functools import lru_cache

import numpy as np

from ... import _core
from ...dynamics.effects.own import raise_errors
from ...dynamics.model import MODEL_FIELDS, load_model
from ...dynamics.vehicle import Vehicle
from ..logs.table import Array
from .signals import Signals


def acting_wrench(
    signals: Signals, vehicle: Vehicle, body: Vehicle | None = None
) -> tuple[Array, Vehicle]:
    """Return the force (N, world) and torque (Nm, body) of a model (n, 6), without the weight, and
    their body.

    Both are for the mass and inertia of ``body``: the model's accelerations are right. By default
    it is the vehicle's own, with its body effects applied.
    """
    models, own = loaded_model(vehicle)
    body, models = body or own, models.copy()
    out = np.empty((len(signals.t), 6))
    _core.acting_wrench(
        models.ctypes.data,
        signals.period,
        signals.rotor_speeds,
        np.zeros(len(signals.t)) if signals.voltage is None else signals.voltage,
        signals.position,
        signals.rotation,
        signals.velocity,
        signals.angular_velocity,
        signals.angular_acceleration,
        body.mass,
        body.inertia,
        out,
    )
    raise_errors()
    return out, body


@lru_cache(maxsize=1)  # one vehicle acts on several pieces
def loaded_model(vehicle: Vehicle) -> tuple[np.ndarray, Vehicle]:
    """Return the record (1,) of a vehicle's model, to be copied, and the vehicle with its body
    effects applied.
    """
    models = np.zeros(1, dtype=np.dtype(MODEL_FIELDS))
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
