"""Inertia: the moments of inertia about the body's axes are larger or smaller than declared, by the
factors 1 + j.
"""

from dataclasses import replace

import numpy as np

from ...runtime.errors import InputError
from ..vehicle import Vehicle
from .base import Effect, along
from .declaration import Coefficients, Family, Need, Role


def amend(vehicle: Vehicle, coefficients: Coefficients) -> Vehicle:
    """Return the vehicle with the diagonal of its inertia scaled by 1 + (jx, jy, jz)."""
    changes = EFFECT.vector(coefficients)
    inertia = vehicle.inertia + np.diag(changes * np.diagonal(vehicle.inertia))
    if np.linalg.eigvalsh(inertia)[0] <= 0:
        raise InputError(
            f"effect inertia: {vehicle.name} would have an inertia that is not positive definite"
        )
    return replace(vehicle, inertia=inertia)


EFFECT = Effect(
    name="inertia",
    kind="body",
    coefficients=along(
        "j{}", "1", (0.2, 0.2), "relative change about body {}", minimum=-0.9, maximum=5.0
    ),
    source="definition; moments from a CAD model or a bifilar pendulum are off by a tenth or two",
    excitation="quick roll, pitch and yaw: its torque follows the angular acceleration; in slow "
    "flight it does nothing",
    amend=amend,
    family=Family.RIGID_BODY,
    role=Role.INERTIA,
    needs=(Need.FAST_MOTION, Need.FINE_ROTOR_SPEEDS, Need.MOMENTS),
)
