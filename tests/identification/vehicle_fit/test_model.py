"""The columns' coefficients against rigid-body mechanics written out, and the lag."""

import numpy as np
import pytest

from windwrench.identification.vehicle_fit.channels import MotionPiece
from windwrench.identification.vehicle_fit.columns import (
    Drive,
    air_columns,
    rotor_columns,
)
from windwrench.identification.vehicle_fit.geometry import SPIN, parse_geometry
from windwrench.identification.vehicle_fit.model import coefficients


def test_coefficients_are_newton_and_euler():
    rng = np.random.default_rng(0)
    t = 0.005 * np.arange(400)
    omega = np.column_stack([np.sin(3 * t + 1), np.cos(2 * t), 0.5 * np.sin(t)])
    turning = np.column_stack([3 * np.cos(3 * t + 1), -2 * np.sin(2 * t), 0.5 * np.cos(t)])
    speeds = 400.0 + 60.0 * np.sin(2 * t[:, None] + np.arange(4))
    velocity = np.column_stack([np.sin(t), np.cos(t), 0.3 * np.sin(2 * t)])
    piece = MotionPiece(0, t, 0.005, velocity, turning, omega, velocity, speeds, None, None)
    geometry = parse_geometry("0.11,0.13;-0.12,0.1;-0.1,-0.14;0.12,-0.12")
    drive = Drive(geometry.positions, SPIN)
    columns = {**rotor_columns(piece, drive), **air_columns(piece)}
    p = {
        "a0": 7e-6,
        "Jx": 2e-3,
        "Jy": 3e-3,
        "Jz": 5e-3,
        "Jxy": 1e-4,
        "Jxz": -2e-4,
        "Jyz": 5e-5,
        "reach": 0.02,
        "cx": 0.003,
        "cy": -0.002,
        "Jr": 2e-5,
        "rx": 0.01,
        "ry": -0.02,
        "rz": 0.03,
        "rotor drag x": 1e-4,
        "quadratic drag y": 0.02,
        "damping z": 1e-3,
        "turn bias y": 0.1,
        "force bias x": 0.2,
    }
    names = tuple(columns)
    got = np.column_stack(list(columns.values())) @ coefficients(p, names, 0.5, 1).T
    inertia = np.array([[2e-3, 1e-4, -2e-4], [1e-4, 3e-3, 5e-5], [-2e-4, 5e-5, 5e-3]])
    for i in rng.integers(20, 380, 20):  # away from the ends, where derivatives are one-sided
        w, a, thrust = omega[i], turning[i], 7e-6 * speeds[i] ** 2
        lever = np.array([0.01, -0.02, 0.03])
        force = np.array([0, 0, thrust.sum() / 0.5])
        force += np.cross(a, lever) + np.cross(w, np.cross(w, lever)) + np.array([0.2, 0, 0])
        force[0] -= 1e-4 * speeds[i].sum() * velocity[i, 0] / 0.5
        force[1] -= 0.02 * np.linalg.norm(velocity[i]) * velocity[i, 1] / 0.5
        place = geometry.positions - [0.003, -0.002, 0.0]
        torque = sum(np.cross(r, [0, 0, f]) for r, f in zip(place, thrust, strict=True))
        torque = torque - [0, 0, 0.02 * (SPIN @ thrust)]
        spin_up = 2e-5 * SPIN @ (120.0 * np.cos(2 * t[i] + np.arange(4)))
        momentum = np.array([0, 0, 2e-5 * SPIN @ speeds[i]])
        torque = torque - [0, 0, spin_up + 1e-3 * w[2]] - np.cross(w, momentum)
        want = np.linalg.solve(inertia, torque - np.cross(w, inertia @ w)) + np.array([0, 0.1, 0])
        assert got[i, :3] == pytest.approx(force, rel=1e-6, abs=1e-4)
        assert got[i, 3:] == pytest.approx(want, rel=1e-6, abs=2e-3)
