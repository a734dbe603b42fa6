"""Inertia: the moments of inertia about the body's axes are larger or smaller than declared, by the
factors 1 + j.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.errors import InputError
from .base import Coefficient, Effect
from .declaration import Family, Need, Role

if TYPE_CHECKING:
    from ..vehicle import Vehicle


def amend(vehicle: "Vehicle", coefficients: Mapping[str, float]) -> "Vehicle":
    """Return the vehicle with the diagonal of its inertia scaled by 1 + (jx, jy, jz)."""
    changes = np.array([coefficients.get(f"j{axis}", 0.0) for axis in "xyz"])
    inertia = vehicle.inertia + np.diag(changes * np.diagonal(vehicle.inertia))
    if np.linalg.eigvalsh(inertia)[0] <= 0:
        raise InputError(
            f"effect inertia: {vehicle.name} would have an inertia that is not positive definite"
        )
    return replace(vehicle, inertia=inertia)


EFFECT = Effect(
    name="inertia",
    kind="body",
    coefficients=tuple(
        Coefficient(
            f"j{axis}",
            "1",
            (0.2, 0.2),
            f"relative change about body {axis}",
            minimum=-0.9,
            maximum=5.0,
        )
        for axis in "xyz"
    ),
    source="definition; moments from a CAD model or a bifilar pendulum are off by a tenth or two",
    excitation="quick roll, pitch and yaw: its torque follows the angular acceleration; in slow "
    "flight it does nothing",
    amend=amend,
    family=Family.RIGID_BODY,
    role=Role.INERTIA,
    needs=(Need.FAST_MOTION, Need.FINE_ROTOR_SPEEDS, Need.MOMENTS),
)
