"""Parameters of PX4 and ArduPilot.

Wind from drag: specific force along a body axis at airspeed v is predicted as
``MCOEF v + 0.5 rho v^2 / BCOEF`` (PX4, src/modules/ekf2/params_drag.yaml: kg/m^2 and 1/s;
ArduPilot, libraries/AP_NavEKF3/AP_NavEKF3.cpp: kg/m/m and 1/s). Either part is left out where its
coefficient is 0. PX4 starts with 100 kg/m^2 and 0.15 1/s, so a part that was not found beside the
other is set to 0: left alone, the start value would act beside what was found. Thrust curve:
relative
thrust ``T = f u^2 + (1 - f) u`` of a relative motor command u (PX4, THR_MDL_FAC; ArduPilot,
MOT_THST_EXPO), and hover thrust is what of the full thrust carries the weight (MPC_THR_HOVER,
MOT_THST_HOVER), which is the mixer's throttle where the curve is undone.
"""

import math
from dataclasses import dataclass

import numpy as np

from ....dynamics.effects import Role
from ..effect_settings import coefficient_of, linear_drag
from ..result import IDENTIFIED, Identified

AIR_DENSITY = 1.225  # kg/m3, at sea level, as both autopilots take it
NO_BLUFF_BODY = 0.0  # of BCOEF: both leave that part out then


@dataclass(frozen=True)
class Autopilot:
    """What an autopilot's parameters hold; None: not known."""

    momentum_drag: float | None  # 1/s
    ballistic: tuple[float, float] | None  # kg/m2, along x and y
    hover_thrust: float | None  # of the full thrust
    curve: float | None  # share of the square in the thrust curve


def autopilot_of(found: Identified) -> Autopilot:
    """Return drag and thrust as autopilots define them."""
    vehicle = found.vehicle
    linear = [drag / vehicle.mass for drag in linear_drag(vehicle)[:2]]
    quadratic = [coefficient_of(vehicle, Role.BODY_DRAG, 3 + i) for i in range(2)]  # along x and y
    momentum = ballistic = None
    if max(*linear, *quadratic) > 0.0:
        momentum = max(float(np.mean(linear)), 0.0)
        x, y = (
            0.5 * AIR_DENSITY * vehicle.mass / c if c > 0.0 else NO_BLUFF_BODY for c in quadratic
        )
        ballistic = (x, y)
    if vehicle.motor_curve is None:
        return Autopilot(momentum, ballistic, None, None)
    u = np.linspace(0.0, 1.0, 41)
    thrust = np.polynomial.polynomial.polyval(u, vehicle.motor_curve.thrust)
    relative = thrust / thrust[-1]
    # least squares of T - u = f (u^2 - u)
    bend = u**2 - u
    curve = float(np.clip(bend @ (relative - u) / (bend @ bend), 0.0, 1.0))
    return Autopilot(momentum, ballistic, float(vehicle.weight / (4.0 * thrust[-1])), curve)


def px4(found: Identified) -> str:
    """Return PX4's parameters as lines for its shell."""
    names = ("EKF2_MCOEF", "EKF2_BCOEF_X", "EKF2_BCOEF_Y", "MPC_THR_HOVER", "THR_MDL_FAC")
    lines = _lines(found, names, "param set {} {:.4g}", most_ballistic=200.0)
    if lines[0].startswith(f"param set {names[0]}"):
        lines.append("# EKF2_DRAG_CTRL 1 turns on the wind estimate that uses drag")
    return "\n".join(lines)


def ardupilot(found: Identified) -> str:
    """Return ArduPilot's parameters as lines of a parameter file."""
    names = (
        "EK3_DRAG_MCOEF",
        "EK3_DRAG_BCOEF_X",
        "EK3_DRAG_BCOEF_Y",
        "MOT_THST_HOVER",
        "MOT_THST_EXPO",
    )
    return "\n".join(_lines(found, names, "{},{:.4g}", most_ballistic=1000.0))


def _lines(
    found: Identified, names: tuple[str, ...], form: str, most_ballistic: float
) -> list[str]:
    has = autopilot_of(found)
    x, y = has.ballistic or (None, None)
    values = (has.momentum_drag, x, y, has.hover_thrust, has.curve)
    out = [
        form.format(name, value)
        for name, value in zip(names, values, strict=True)
        if value is not None
    ]
    missing = [name for name, value in zip(names, values, strict=True) if value is None]
    if missing:
        out.append(f"# not known from these logs: {', '.join(missing)}")
    limits = (1.0, most_ballistic, most_ballistic, math.inf, math.inf)  # stated beside the names
    out += [
        f"# {name}: its stated range ends at {limit:g}"
        for name, value, limit in zip(names, values, limits, strict=True)
        if value is not None and value > limit
    ]
    full = found.by_name.get("thrust(1)")
    if has.hover_thrust is not None and full is not None and full.status != IDENTIFIED:
        out.append(f"# {names[3]} and {names[4]}: the full thrust was not flown; {full.how}")
    return out
