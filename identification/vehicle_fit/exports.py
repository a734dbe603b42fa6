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
from collections.abc import Callable
from functools import partial

import numpy as np

from ...dynamics.effects import Role
from ...runtime.page_files import page_template
from ..logs.table import NamedNumbers, Names
from .effect_settings import coefficient_of, effect_of, linear_drag
from .result import ASSUMED, Identified

AIR_DENSITY = 1.225  # kg/m3, at sea level, as in both autopilots
_PER_RPM = (2.0 * math.pi / 60.0) ** 2  # (rad/s)^2 in one rpm^2
_CRAZYFLIE = [3, 2, 1, 0]  # front-right, rear-right, rear-left, front-left


def _autopilot(line: str, parameters: Names, most_ballistic: float, identified: Identified) -> str:
    """Return an autopilot's parameters, each in a ``line``: momentum drag (1/s), ballistic
    coefficients along x and y (kg/m2), hover thrust (share of the full one), and the square's share
    in the curve.
    """
    vehicle = identified.vehicle
    linear = [drag / vehicle.mass for drag in linear_drag(vehicle)[:2]]
    quadratic = [coefficient_of(vehicle, Role.BODY_DRAG, 3 + i) for i in range(2)]
    momentum, *ballistic, hover, bend = parameters
    values: NamedNumbers = {}
    if max(*linear, *quadratic) > 0.0:
        values[momentum] = max(0.5 * sum(linear), 0.0)
        for p, c in zip(ballistic, quadratic, strict=True):
            # both autopilots leave the part of 0 out
            values[p] = 0.5 * AIR_DENSITY * vehicle.mass / c if c > 0.0 else 0.0
    if vehicle.motor_curve is not None:
        u = np.linspace(0.0, 1.0, 41)
        thrust = np.polynomial.polynomial.polyval(u, vehicle.motor_curve.thrust)
        values[hover] = vehicle.weight / (4.0 * thrust[-1])
        # least squares of T - u = f (u^2 - u)
        bent = u**2 - u
        values[bend] = np.clip(bent @ (thrust / thrust[-1] - u) / (bent @ bent), 0.0, 1.0)
    text = page_template(__package__, "templates/autopilot.j2", html=False)
    return text.render(
        line=line,
        values=values,
        parameters=parameters,
        limits={momentum: 1.0, **dict.fromkeys(ballistic, most_ballistic)},  # as both state
        full=identified.estimates.get("thrust(1)"),
    ).removesuffix("\n")


def _simulator(name: str, identified: Identified) -> str:
    """Return a simulator's parameters."""
    v = identified.vehicle
    lag, drag = identified.estimates[effect_of(Role.LAG)], linear_drag(v)
    x, y, _ = np.sign(v.positions[_CRAZYFLIE].T)
    notes = ""
    if identified.fit.model.commands:
        notes = (
            "# these logs hold commands, no rotor speeds: k and p are scaled so that rotors hover "
            f"at {v.hover_rate:.0f} rad/s; thrust and torque are right, speeds are not\n"
        )
    assumed = [e.name for e in identified.estimates.values() if e.status == ASSUMED]
    notes += f"# assumed, not identified: {', '.join(assumed)}\n" if assumed else ""
    text = page_template(__package__, f"templates/{name}.j2", html=False)
    return text.render(
        v=v,
        notes=notes,
        positions=(v.positions - v.com).tolist(),
        lag=lag.value if lag.value > 0.0 else None,
        drag=-np.diag(drag) if any(drag) else None,
        linear_drag=0.5 * sum(coefficient_of(v, Role.ROTOR_DRAG, i) for i in range(2)),
        effect=partial(coefficient_of, v),
        mixing=(y, -x, -v.spin[_CRAZYFLIE]),
        per_rpm=_PER_RPM,
        Role=Role,
    ).removesuffix("\n")


_PX4 = ("EKF2_MCOEF", "EKF2_BCOEF_X", "EKF2_BCOEF_Y", "MPC_THR_HOVER", "THR_MDL_FAC")
_ARDUPILOT = (
    "EK3_DRAG_MCOEF",
    "EK3_DRAG_BCOEF_X",
    "EK3_DRAG_BCOEF_Y",
    "MOT_THST_HOVER",
    "MOT_THST_EXPO",
)
EXPORTS: dict[str, Callable[[Identified], str]] = {
    "px4": partial(_autopilot, "param set %s %.4g", _PX4, 200.0),
    "ardupilot": partial(_autopilot, "%s,%.4g", _ARDUPILOT, 1000.0),
    "rotorpy": partial(_simulator, "rotorpy"),
    "drone-models": partial(_simulator, "drone_models"),
    "gazebo": partial(_simulator, "gazebo"),
}
