"""Parameters of simulators: RotorPy, drone-models, Gazebo."""

import math

import numpy as np

from ....dynamics.effects import Role
from ..effect_settings import coefficient_of, effect_of, linear_drag
from ..result import IDENTIFIED, Identified

_PER_RPM = (2.0 * math.pi / 60.0) ** 2  # (rad/s)^2 in one rpm^2
_CRAZYFLIE = (3, 2, 1, 0)  # front-right, rear-right, rear-left, front-left


def _no_speeds(found: Identified) -> list[str]:
    if not found.fit.drive.commands:
        return []
    return [
        "# these logs hold commands, no rotor speeds: k and p are scaled so that rotors hover at "
        f"{found.vehicle.hover_rate:.0f} rad/s; thrust and torque are right, speeds are not"
    ]


def _assumed(found: Identified) -> list[str]:
    names = [e.name for e in found.estimates if e.status == "assumed"]
    return [f"# assumed, not identified: {', '.join(names)}"] if names else []


def rotorpy(found: Identified) -> str:
    """Return a parameter dictionary for RotorPy's ``Multirotor``: rotors at positions from the
    centre of mass; ``rotor_directions`` is the sign of a rotor's torque on the body about +z;
    ``k_d`` N/(rad/s m/s) of each rotor, ``c_D`` N/(m/s)^2 of the frame (as its vehicles' files,
    such as hummingbird_params.py, and ``Multirotor`` define them).
    """
    v = found.vehicle

    def effect(role: Role, index: int) -> float:
        return coefficient_of(v, role, index)

    drag = 0.5 * (effect(Role.ROTOR_DRAG, 0) + effect(Role.ROTOR_DRAG, 1))
    positions = v.positions - v.com
    lag = found[effect_of(Role.LAG)]
    lines = [
        *_no_speeds(found),
        *_assumed(found),
        "quad_params = {",
        f"    'mass': {v.mass:.6g},",
        *(
            f"    'I{a}{b}': {v.inertia[i, j]:.6g},"
            for a, b, i, j in (
                ("x", "x", 0, 0),
                ("y", "y", 1, 1),
                ("z", "z", 2, 2),
                ("x", "y", 0, 1),
                ("y", "z", 1, 2),
                ("x", "z", 0, 2),
            )
        ),
        "    'num_rotors': 4,",
        f"    'rotor_radius': {v.rotor_radius:.6g},",
        "    'rotor_pos': {",
        *(
            f"        'r{i + 1}': np.array([{x:.6g}, {y:.6g}, {z:.6g}]),"
            for i, (x, y, z) in enumerate(positions)
        ),
        "    },",
        f"    'rotor_directions': np.array({[int(-s) for s in v.spin]}),",
        "    'rI': np.array([0, 0, 0]),",
        *(f"    'c_D{a}': {effect(Role.BODY_DRAG, 3 + i):.6g}," for i, a in enumerate("xyz")),
        f"    'k_eta': {v.k[0]:.6g},",
        f"    'k_m': {v.p[0]:.6g},",
        f"    'k_d': {drag:.6g},",
        f"    'k_z': {effect(Role.INFLOW_THRUST, 0):.6g},",
        f"    'k_h': {effect(Role.TRANSLATIONAL_LIFT, 0):.6g},",
        "    'k_flap': 0.0,",
        *([f"    'tau_m': {lag.value:.6g},"] if lag.status == IDENTIFIED else []),
        "}",
        "# not known from these logs: rotor_speed_min, rotor_speed_max, motor_noise_std"
        + ("" if lag.status == IDENTIFIED else ", tau_m"),
    ]
    return "\n".join(lines)


def drone_models(found: Identified) -> str:
    """Return a table for drone-models' ``data/params.toml`` (0.1.0, ``first_principles``).

    Rotors are in the Crazyflie's order, polynomials in rpm with the index as the power, ``L`` is
    the distance from either axis, ``rotor_dyn_coef`` 1/s (and of squares, speeding up and slowing
    down), ``drag_matrix`` N/(m/s) along body axes, negative.
    """
    v = found.vehicle
    order = list(_CRAZYFLIE)
    rows = np.array(
        [
            np.sign(v.positions[order, 1]),
            -np.sign(v.positions[order, 0]),
            -v.spin[order],
        ]
    )
    lag, drag = found[effect_of(Role.LAG)], linear_drag(v)
    missing = ["pwm_min", "pwm_max", "thrust_min", "thrust_max", "prop_inertia"]
    missing += [] if lag.status == IDENTIFIED else ["rotor_dyn_coef"]
    missing += [] if any(drag) else ["drag_matrix"]
    lines = [
        *_no_speeds(found),
        *_assumed(found),
        f"[{v.name}]",
        f"gravity_vec = [0.0, 0.0, {-v.gravity:g}]",
        f"mass = {v.mass:.6g}",
        f"L = {v.arm_l:.6g}",
        *_matrix("J", v.inertia),
        f"rpm2thrust = [0.0, 0.0, {v.k[0] * _PER_RPM:.6g}]",
        f"rpm2torque = [0.0, 0.0, {v.p[0] * _PER_RPM:.6g}]",
        *(
            [f"rotor_dyn_coef = [{1.0 / lag.value:.6g}, 0.0, {1.0 / lag.value:.6g}, 0.0]"]
            if lag.status == IDENTIFIED
            else []
        ),
        *(_matrix("drag_matrix", -np.diag(drag)) if any(drag) else []),
        *_matrix("mixing_matrix", rows),
        f"# not known from these logs: {', '.join(missing)}",
    ]
    return "\n".join(lines)


def _matrix(name: str, values: np.ndarray) -> list[str]:
    """Return a matrix as lines of TOML, of floats alone."""
    rows = (", ".join(repr(float(f"{x:.6g}") + 0.0) for x in row) for row in values)
    return [f"{name} = [", *(f"    [{row}]," for row in rows), "]"]


def gazebo(found: Identified) -> str:
    """Return the elements of Gazebo's multicopter motor model, once for each rotor's plugin:
    thrust ``motorConstant W^2``; torque ``momentConstant`` (m) times thrust; drag
    ``rotorDragCoefficient W v`` across the rotor's axis (gz-sim, MulticopterMotorModel).
    """
    v = found.vehicle
    drag = 0.5 * sum(coefficient_of(v, Role.ROTOR_DRAG, i) for i in range(2))
    lag = found[effect_of(Role.LAG)]
    common = [
        f"  <motorConstant>{v.k[0]:.6g}</motorConstant>",
        f"  <momentConstant>{v.p[0] / v.k[0]:.6g}</momentConstant>",
        f"  <rotorDragCoefficient>{drag:.6g}</rotorDragCoefficient>",
    ]
    missing = ["maxRotVelocity", "rollingMomentCoefficient"]
    if lag.status == IDENTIFIED:
        common += [
            f"  <timeConstantUp>{lag.value:.6g}</timeConstantUp>",
            f"  <timeConstantDown>{lag.value:.6g}</timeConstantDown>",
        ]
    else:
        missing += ["timeConstantUp", "timeConstantDown"]
    lines = []
    for comment in (*_no_speeds(found), *_assumed(found)):
        lines.append(f"<!-- {comment[2:]} -->")
    for i, (x, y, z) in enumerate(v.positions - v.com):
        lines += [
            f"<!-- rotor {i + 1} at {x:.6g} {y:.6g} {z:.6g} -->",
            f"  <turningDirection>{'ccw' if v.spin[i] > 0 else 'cw'}</turningDirection>",
            *common,
        ]
    lines.append(f"<!-- not known from these logs: {', '.join(missing)} -->")
    return "\n".join(lines)
