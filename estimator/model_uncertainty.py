"""Variances of torque and force by the vehicle's own uncertainty.

A wrong mass or thrust coefficient stays wrong for all of a flight. No measurement of the motion
tells the error from a wrench. So the error adds to the output and leaves the filter alone: as
process noise the error would average out over time, and the stated deviation would shrink.

A wrong vehicle acts on the filter as a wrench ``sum_j e_j L_j``. In the world frame, by its
relative errors e, the loads L are:

    mass              force   m (a + g) = thrust z + force + effects
    thrust, command   force   thrust z;  torque  that of the rotors
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
from ..runtime.compiled import Record, compiled_for_vectors
from ..runtime.vector_lanes import choose
from .estimate import Array

# Loads, one a row: thrust along body x and y (times its arm a torque) and along z (N). Then the
# force that moves the mass (N), and torques of the rotors about body x and y, about z, and all
# torques (Nm). The third and fourth are followed as the force is, the others as the torque
LOAD = (7, 3)
# Variances by which squares of the loads count: of mass, thrust, command, arm, reaction torque,
# inertia, then (m2) of the rotors' places y y, x x, x y
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
    known = vehicle.uncertainty
    x, y = (vehicle.positions - vehicle.com)[:, :2].T / 4.0
    rotor = known.rotor**2
    return np.array(
        [
            known.mass**2,
            known.thrust**2 + rotor / 4.0,
            known.command**2 if vehicle.omega_source == "commanded" else 0.0,
            known.thrust**2 + known.arm_l**2,
            known.torque**2,
            known.inertia**2,
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


@compiled_for_vectors
def variances(factors: Array, load: Array, out: Array) -> None:
    """Write the variances (6,) of torque and force at followed loads (7, 3) into ``out``."""
    mass, thrust, command, arm = factors[0], factors[1], factors[2], factors[3]
    reaction, inertia, yy, xx, xy = factors[4], factors[5], factors[6], factors[7], factors[8]
    for i in range(3):
        ax, ay, t, w = load[0, i], load[1, i], load[2, i], load[3, i]
        a, z, turning = load[4, i], load[5, i], load[6, i]
        out[i] = (
            arm * a * a
            + reaction * z * z
            + command * (a + z) * (a + z)
            + inertia * turning * turning
            + (yy * ax * ax + xx * ay * ay - 2.0 * xy * ax * ay)
        )
        out[3 + i] = mass * w * w + (thrust + command) * t * t


def variances_along(factors: Array, loads: Array) -> Array:
    """Return the variances (n, 6) of torque and force at a series of loads (n, 7, 3)."""
    out = np.empty((len(loads), 6))
    _core.variances_along(factors, np.ascontiguousarray(loads), out)
    return out


@compiled_for_vectors
def follow_loads(f: Record, R: Array, dt: float) -> None:
    """Follow the loads of a prediction over ``dt`` s at the attitude ``R`` (3, 3), and write the
    model's variances into ``f.model``. Expects the rotors' and the effects' wrench, and ``f.P``
    before the prediction.
    """
    load, w, e, x = f.load, f.rotor_wrench, f.effect_wrench, f.x
    periods = dt / f.period
    for i in range(3):
        turn = _taken_in(f, i, periods * f.torque_walk[i])
        push = _taken_in(f, 3 + i, periods * f.force_walk[i])
        thrust = R[i, 2] * w[0]
        across = R[i, 0] * w[1] + R[i, 1] * w[2]
        around = R[i, 2] * w[3]
        of_effects = R[i, 0] * e[3] + R[i, 1] * e[4] + R[i, 2] * e[5]
        load[0, i] += turn * (R[i, 0] * w[0] - load[0, i])
        load[1, i] += turn * (R[i, 1] * w[0] - load[1, i])
        load[2, i] += push * (thrust - load[2, i])
        load[3, i] += push * (thrust + x[16 + i] + e[i] - load[3, i])
        load[4, i] += turn * (across - load[4, i])
        load[5, i] += turn * (around - load[5, i])
        load[6, i] += turn * (across + around + of_effects + x[13 + i] - load[6, i])
    variances(f.uncertain, load, f.model)


@compiled_for_vectors
def _taken_in(f: Record, i: int, walk: float) -> float:
    """Return which share of the variance of torque or force number ``i`` the corrections since the
    last prediction took away.
    """
    before, now = f.predicted[i], wrench_variance(f, i)
    f.predicted[i] = now + walk
    share: float = choose(now < before, 1.0 - now / before, 0.0)
    return share


@compiled_for_vectors
def wrench_variance(f: Record, i: int) -> float:
    """Return the filter's variance of torque or force number ``i``."""
    variance: float = f.P[12 + i, 12 + i]
    return variance
