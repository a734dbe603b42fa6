"""The vehicle made of estimates."""

import math
from dataclasses import replace

import numpy as np

from ...dynamics.effects import Role, get
from ...dynamics.vehicle import (
    QUADRANT,
    EffectSetting,
    Mocap,
    MotorCurve,
    Uncertainty,
    Vehicle,
)
from ..logs.flight_log import Logs
from ..logs.table import median_step
from ..motion.sensor_noise import sensor_noise
from .effect_settings import LAG, effect_of
from .geometry import (
    COMMAND_SPREAD,
    HOVER_SPEED,
    ROTOR_RADIUS,
    THRUST_SPREAD,
)
from .model import inertia_of
from .motors import MotorResponse
from .parameters import FURTHER
from .result import IDENTIFIED, NOTHING, Estimated
from .solve import VehicleFit


def vehicle_of(
    name: str,
    fit: VehicleFit,
    estimates: Estimated,
    logs: Logs,
    step: float,
    motors: MotorResponse | None,
) -> Vehicle:
    """Return the vehicle, ready for estimate, diagnose and the environment. Measured rotor speeds
    have the lag behind them already: then no effect of the model has one.
    """
    model, geometry, arm, curve = fit.model, fit.model.geometry, estimates["arm_l"].value, None
    # identified values with 0 outside the interval
    shown = {
        name: e.value
        for name, e in estimates.items()
        if e.status == IDENTIFIED and not e.low < 0.0 < e.high
    }
    if model.commands:
        thrust = tuple(fit.values.get(f"a{e}", 0.0) for e in range(3))
        voltage = estimates["voltage_exponent"]
        curve = MotorCurve(thrust, voltage.value if voltage.status == IDENTIFIED else 0.0)
        k = model.weight / (4.0 * HOVER_SPEED**2)
    else:
        k = estimates["k"].value
        if motors is not None:  # thrust against command by way of the speed
            curve = MotorCurve(tuple(k * np.polynomial.polynomial.polypow(motors.speed, 2)))
    late = "lag" in model.free
    effects = {}
    for effect in [effect_of(further.role) for further in FURTHER.values() if further.role]:
        values = {c: shown.get(f"{effect} {c.name}", 0.0) for c in get(effect).coefficients}
        # without impossible signs
        effects[effect] = {c.name: x for c, x in values.items() if x > 0.0 or x < 0.0 > c.minimum}
    if effects[effect_of(Role.ROTOR_DRAG)]:  # a drag at the rotors damps by itself
        del effects[effect_of(Role.RATE_DAMPING)]
    if late:
        effects[LAG] = {get(LAG).coefficients[0].name: estimates[LAG].value}
    if (behind := shown.get("time_offset", 0.0)) > 0.0:
        effects["latency"] = {"d": behind}
    inertia = {f"J{a}": estimates[f"J{a}{a}"].value for a in "xyz"}
    even = np.allclose(geometry.positions, geometry.arm * QUADRANT)
    vehicle = Vehicle(
        name=name,
        mass=model.mass,
        inertia=inertia_of(shown | inertia),
        arm_l=arm,
        k=np.full(4, k),
        p=np.full(4, estimates["p/k"].value * k),
        rotor_radius=ROTOR_RADIUS * arm,
        omega_lsb=step,
        omega_source="commanded" if late else "measured",
        voltage_ref=model.voltage_ref,
        spin=model.spin.copy(),
        rotor_positions=None if even else geometry.positions,
        com=np.array([shown.get(f"com {a}", 0.0) for a in "xyz"]),
        effects=tuple(EffectSetting(*e) for e in effects.items() if e[1]),
        motor_curve=curve,
        uncertainty=_uncertainty(estimates, arm, curve is not None),
    )
    for log in logs:
        if log.has_pose:
            noise, rate = sensor_noise(log, vehicle), 1.0 / median_step(log.t[log.valid])
            mocap = Mocap(rate, max(noise.position, 1e-5), max(noise.attitude, 1e-4))
            return replace(vehicle, mocap=mocap)
    return vehicle


def _uncertainty(estimates: Estimated, arm: float, commands: bool) -> Uncertainty:
    """Return the standard deviations of the 95 % intervals. The deviation of the given mass is not
    known.
    """

    def share(*names: str) -> list[float]:
        known = [estimates[n] for n in names if n in estimates and estimates[n].low > 0.0]
        return [min(math.log(e.high / e.low) / (2.0 * 1.96), 0.99) for e in known]

    centre = [e for n in ("com x", "com y") if (e := estimates[n]).status != NOTHING]
    return Uncertainty(
        thrust=min(share("k"), default=THRUST_SPREAD),
        rotor=max((min((e.high - e.low) / 1.96 / arm, 0.99) for e in centre), default=0.0),
        torque=max(share("p/k"), default=0.0),
        inertia=max(share("Jxx", "Jyy", "Jzz"), default=0.0),
        arm_l=max(share("arm_l"), default=0.0),
        command=min(
            share("thrust(0.25)", "thrust(0.5)", "thrust(0.75)"),
            default=COMMAND_SPREAD if commands else 0.0,
        ),
    )
