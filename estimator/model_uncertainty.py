"""Variances of torque and force by the vehicle's own uncertainty.

A wrong mass or thrust coefficient stays wrong for all of a flight. No measurement of the motion
tells the error from a wrench. So the error adds to the output and leaves the filter alone: as
process noise the error would average out over time, and the stated deviation would shrink.

A wrong vehicle acts on the filter as a wrench ``sum_j e_j L_j``. In the world frame, by its
relative errors e, the loads L are:

    mass              force   m (a + g) = thrust z + force + effects
    thrust, command   force   thrust z;  torque  the rotors'
    one rotor of four force   thrust z / 4;  torque  thrust / 4 at the rotor's place
    torque, arm_l     torque  the rotors' about z, and about x and y
    inertia           torque  all that turns the body

The filter shows a wrench by and by: each correction shows the share of the variance removed, 1 - P
/ P-. The loads are followed in the same shares. With independent errors the variance of the output
is ``sum_j var(e_j) L_j^2``.
"""

from dataclasses import replace

import numpy as np

from .. import _core
from ..dynamics.vehicle import Uncertainty, Vehicle
from .estimate import Array

# Loads, one a row: thrust along body x and y (times its arm a torque) and along z (N). Then the
# force that moves the mass (N), and torques of the rotors about body x and y, about z, and all
# torques (Nm). The third and fourth are followed as the force is, the others as the torque
LOAD = (7, 3)
# Variances that multiply squares of the loads: mass, thrust, command, arm, reaction torque,
# inertia, then (m2) the rotors' places y y, x x, x y
FACTORS = 9

# the stated numbers' names in a sentence
NAMES = {
    "mass": "the mass",
    "thrust": "the thrust coefficient",
    "rotor": "the difference between rotors",
    "torque": "the torque coefficient",
    "inertia": "the inertia",
    "arm_l": "the arm length",
    "command": "the thrust of a command",
}


def factors_of(vehicle: Vehicle) -> Array:
    """Return the factors (FACTORS,) of a vehicle's stated uncertainty."""
    uncertainty = vehicle.uncertainty
    x, y = (vehicle.positions - vehicle.com)[:, :2].T / 4.0
    rotor = uncertainty.rotor**2
    return np.array(
        [
            uncertainty.mass**2,
            uncertainty.thrust**2 + rotor / 4.0,
            uncertainty.command**2 if vehicle.omega_source == "commanded" else 0.0,
            uncertainty.thrust**2 + uncertainty.arm_l**2,
            uncertainty.torque**2,
            uncertainty.inertia**2,
            *(rotor * y @ y, rotor * x @ x, rotor * x @ y),
        ]
    )


def factors_alone(vehicle: Vehicle) -> dict[str, Array]:
    """Return the factors of each stated number alone; their sum is ``factors_of``."""
    return {
        name: factors_of(replace(vehicle, uncertainty=Uncertainty(**{name: size})))
        for name in NAMES
        if (size := getattr(vehicle.uncertainty, name)) > 0.0
    }


def variances_along(factors: Array, loads: Array) -> Array:
    """Return the variances (n, 6) of torque and force at a series of loads (n, 7, 3)."""
    out = np.empty((len(loads), 6))
    _core.variances_along(factors, np.ascontiguousarray(loads), out)
    return out
