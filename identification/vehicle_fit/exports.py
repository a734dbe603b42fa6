"""An identified vehicle for other programs. Unknown parameters are left out, with a comment.

The texts are ``templates/``. Wind from drag in PX4 and ArduPilot: specific force along a body axis
at airspeed v is predicted as ``MCOEF v + 0.5 rho v^2 / BCOEF`` (PX4,
src/modules/ekf2/params_drag.yaml: kg/m^2 and 1/s; ArduPilot, libraries/AP_NavEKF3/AP_NavEKF3.cpp:
kg/m/m and 1/s). Either part is left out where its coefficient is 0. PX4 starts with 100 kg/m^2 and
0.15 1/s, so a missing part is set to 0: its start value would act beside the identified part.
Thrust curve: relative thrust ``T = f u^2 + (1 - f) u`` of a relative motor command u (PX4,
THR_MDL_FAC; ArduPilot, MOT_THST_EXPO). Hover thrust is the weight as a share of the full thrust
(MPC_THR_HOVER, MOT_THST_HOVER).

RotorPy (``Multirotor`` and its vehicles' files) has rotors at positions from the centre of mass.
``rotor_directions`` is the sign of a rotor's torque on the body about +z, ``k_d`` N/(rad/s m/s) of
each rotor, ``c_D`` N/(m/s)^2 of the frame. drone-models (0.1.0, ``first_principles``) has rotors in
the Crazyflie's order and polynomials in rpm with the index as the power. ``L`` is the distance from
either axis, ``rotor_dyn_coef`` 1/s, ``drag_matrix`` N/(m/s) along body axes, negative. Gazebo
(gz-sim, MulticopterMotorModel), once for each rotor: thrust ``motorConstant W^2``, torque
``momentConstant`` (m) times thrust, drag ``rotorDragCoefficient W v`` across the rotor's axis.
"""

import math
from functools import partial

import numpy as np

from ...dynamics.effects import Role
from ..logs.table import Values
from .effect_settings import LAG, coefficient_of, linear_drag
from .geometry import AIR_DENSITY
from .result import Identified, text_of

_PER_RPM = (2.0 * math.pi / 60.0) ** 2  # (rad/s)^2 in one rpm^2


def _autopilot(line: str, most: Values, identified: Identified) -> str:
    """Return an autopilot's parameters, each in a ``line``: momentum drag (1/s), ballistic
    coefficients along x and y (kg/m2), hover thrust (share of the full one), and the square's share
    in the curve. ``most`` has the ends of their ranges, in this order.
    """
    vehicle, values = identified.vehicle, np.full(5, np.nan)
    linear = [drag / vehicle.mass for drag in linear_drag(vehicle)[:2]]
    quadratic = [coefficient_of(vehicle, Role.BODY_DRAG, 3 + i) for i in range(2)]
    if max(*linear, *quadratic) > 0.0:
        # both autopilots leave the part of 0 out
        ballistic = [0.5 * AIR_DENSITY * vehicle.mass / c if c > 0.0 else 0.0 for c in quadratic]
        values[:3] = max(0.5 * sum(linear), 0.0), *ballistic
    if vehicle.motor_curve is not None:
        u = np.linspace(0.0, 1.0, 41)
        thrust = np.polynomial.polynomial.polyval(u, vehicle.motor_curve.thrust)
        # least squares of T - u = f (u^2 - u)
        bent = u**2 - u
        share = np.clip(bent @ (thrust / thrust[-1] - u) / (bent @ bent), 0.0, 1.0)
        values[3:] = vehicle.weight / (4.0 * thrust[-1]), share
    known = {p: x for p, x in zip(most, values, strict=True) if np.isfinite(x)}
    return text_of("autopilot", line=line, values=known, most=most, estimates=identified.estimates)


def _simulator(name: str, identified: Identified) -> str:
    """Return a simulator's parameters."""
    v, known = identified.vehicle, identified.estimates
    lag, drag = known[LAG].value, linear_drag(v)
    return text_of(
        name,
        v=v,
        notes=text_of("notes", v=v, estimates=known, commands=identified.fit.model.commands),
        lag=lag if lag > 0.0 else None,
        drag=-np.diag(drag) if any(drag) else None,
        effect=partial(coefficient_of, v),
        mixing=np.sign(v.mixing[1:, ::-1]),  # the Crazyflie counts from front-right to front-left
        per_rpm=_PER_RPM,
        Role=Role,
    )


_PX4 = {
    "EKF2_MCOEF": 1.0,
    "EKF2_BCOEF_X": 200.0,
    "EKF2_BCOEF_Y": 200.0,
    "MPC_THR_HOVER": math.inf,
    "THR_MDL_FAC": math.inf,
}
_ARDUPILOT = {
    "EK3_DRAG_MCOEF": 1.0,
    "EK3_DRAG_BCOEF_X": 1000.0,
    "EK3_DRAG_BCOEF_Y": 1000.0,
    "MOT_THST_HOVER": math.inf,
    "MOT_THST_EXPO": math.inf,
}
EXPORTS = {
    "px4": partial(_autopilot, "param set %s %.4g", _PX4),
    "ardupilot": partial(_autopilot, "%s,%.4g", _ARDUPILOT),
    "rotorpy": partial(_simulator, "rotorpy"),
    "drone-models": partial(_simulator, "drone_models"),
    "gazebo": partial(_simulator, "gazebo"),
}
