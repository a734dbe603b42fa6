"""Flights for the tests, drawn from equations of motion that share no code with the package."""

import numpy as np
from numpy.linalg import inv, norm
from numpy.random import default_rng
from scipy.spatial.transform import Rotation

PERIOD = 0.005


def cross(a, b):
    """As ``numpy.cross``, bit for bit, without what that takes to accept any shape."""
    ax, ay, az = a
    bx, by, bz = b
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def yawing_flight(
    vehicle,
    steps,
    seed=0,
    sigma_position=0.001,
    sigma_attitude=0.005,
    torque=(0.0, 0.0, 0.02),
    force=(0.3, -0.2, -0.1),
    substeps=10,
    yaw_rate=3.0,
):
    """Start yawed by 120 degrees, turn at several rad/s and translate, under a constant wrench.

    A feedback on the true state gives the rotor speeds; truth is integrated in fine substeps.
    Returns a dict of arrays.
    """
    rng = default_rng(seed)
    force = np.asarray(force, float)
    torque = np.asarray(torque, float)
    x = np.array([0.0, 0.0, 1.5])
    v = np.zeros(3)
    turned = Rotation.from_euler("z", 120.0, degrees=True)
    w = np.array([0.0, 0.0, yaw_rate])
    turns = vehicle.arm_l * vehicle.k * [[1, 1, -1, -1], [-1, 1, 1, -1]]
    mixing = np.array([vehicle.k, *turns, vehicle.p * [1, -1, 1, -1]])
    unmixing = inv(mixing)
    inverse = inv(vehicle.inertia)
    names = ("rotors", "position", "quaternion", "velocity", "omega", "true_q", "true_x")
    out = {name: [] for name in names}
    for k in range(steps):
        t = k * PERIOD
        target = np.array([np.sin(1.3 * t), 0.8 * np.sin(0.9 * t + 1), 1.5 + 0.2 * np.sin(0.7 * t)])
        speed = [1.3 * np.cos(1.3 * t), 0.72 * np.cos(0.9 * t + 1), 0.14 * np.cos(0.7 * t)]
        a = 4 * (target - x) + 3.5 * (speed - v) + [0, 0, vehicle.gravity] - force / vehicle.mass
        R = turned.as_matrix()
        up = a / norm(a)
        tilt = R.T @ cross(R[:, 2], up)
        rate = np.array([0, 0, yaw_rate * (1 + 0.5 * np.sin(1.1 * t))])
        alpha = 110 * tilt * [1, 1, 0] - 18 * (w - rate) * [1, 1, 0.4]
        moment = vehicle.inertia @ alpha + cross(w, vehicle.inertia @ w) - R.T @ torque
        squares = np.maximum(unmixing @ np.array([vehicle.mass * a @ R[:, 2], *moment]), 1e3)
        (thrust, *moment), h = mixing @ squares, PERIOD / substeps
        for _ in range(substeps):
            R = turned.as_matrix()
            acc = (R @ [0, 0, thrust] + force) / vehicle.mass - [0, 0, vehicle.gravity]
            alpha = inverse @ (moment + R.T @ torque - cross(w, vehicle.inertia @ w))
            x = x + h * v + h * h / 2 * acc
            v = v + h * acc
            turned = turned * Rotation.from_rotvec(h * (w + h / 2 * alpha))
            w = w + h * alpha
        error = Rotation.from_rotvec(sigma_attitude * rng.standard_normal(3))
        out["rotors"].append(np.sqrt(squares))
        out["true_x"].append(x)
        out["true_q"].append(turned.as_quat(scalar_first=True))
        out["position"].append(x + sigma_position * rng.standard_normal(3))
        out["quaternion"].append((error * turned).as_quat(scalar_first=True))
        out["velocity"].append(v)
        out["omega"].append(w)
    return {name: np.array(values) for name, values in out.items()}


def begin(estimator, flight, covariance=None):
    """Start an estimator at the true state of a flight."""
    start = (flight[name][0] for name in ("true_x", "true_q"))
    estimator.reset(*start, covariance, flight["velocity"][0], flight["omega"][0])


def fly(estimator, flight, missing=(), covariance=None):
    """Start an estimator and step it through a flight, some poses missing; return its estimates
    after each step.
    """
    begin(estimator, flight, covariance)
    poses = zip(flight["position"], flight["quaternion"], strict=True)
    return [
        estimator.step(speeds, *((None, None) if k in missing else pose))
        for k, (speeds, pose) in enumerate(zip(flight["rotors"], poses, strict=True))
        if k
    ]
