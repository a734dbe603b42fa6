"""Attitude, velocity and biases from an IMU, on a motion that is known in closed form."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from windwrench.identification.motion.inertial_fusion import Readings, fuse

PERIOD, GRAVITY = 0.005, 9.81
GYRO_BIAS, FORCE_BIAS = np.array([0.01, -0.02, 0.015]), np.array([0.05, -0.1, 0.08])


@pytest.fixture(scope="module")
def motion():
    """Waves in a room for 40 s, tilted towards the acceleration, from a heading of 2 rad; sensors
    with white noise and biases.
    """
    t = np.arange(0.0, 40.0, PERIOD)
    wave = np.array([0.9, 0.7, 1.3])
    position = np.sin(np.outer(t, wave)) * [1.0, 1.5, 0.2]
    velocity = np.cos(np.outer(t, wave)) * [1.0, 1.5, 0.2] * wave
    acceleration = -position * wave**2
    felt = acceleration + np.array([0.0, 0.0, GRAVITY])
    up = felt.copy()
    up /= np.linalg.norm(up, axis=1)[:, None]
    heading = 2.0 + 0.5 * np.sin(0.3 * t)
    forward = np.column_stack([np.cos(heading), np.sin(heading), np.zeros_like(t)])
    left = np.cross(up, forward)
    left /= np.linalg.norm(left, axis=1)[:, None]
    rotation = np.stack([np.cross(left, up), left, up], axis=2)
    turned = Rotation.from_matrix(rotation)
    rate = (turned[:-1].inv() * turned[1:]).as_rotvec() / PERIOD
    rate = np.vstack([rate[:1], 0.5 * (rate[1:] + rate[:-1]), rate[-1:]])
    rng = np.random.default_rng(0)
    force = turned.inv().apply(felt)
    return {
        "t": t,
        "position": position,
        "velocity": velocity,
        "rotation": rotation,
        "gyro": rate + GYRO_BIAS + 0.005 * rng.standard_normal(rate.shape),
        "force": force + FORCE_BIAS + 0.1 * rng.standard_normal(force.shape),
        "noise": rng.standard_normal(position.shape),
    }


def tilt_error(rotation, truth):
    """Angle (rad) between the verticals of two attitudes, in body axes."""
    return np.linalg.norm(rotation[:, 2] - truth[:, 2], axis=1)


def test_an_imu_alone_keeps_the_vertical(motion):
    """Tilt within some mrad, as it says; heading from zero, and velocity not known."""
    fused = fuse(motion["t"], motion["gyro"], motion["force"], GRAVITY, (0.005, 0.1))
    at = np.searchsorted(motion["t"], fused.t - 1e-9)
    error = tilt_error(fused.rotation, motion["rotation"][at])
    assert np.sqrt(np.mean(error**2)) < 0.02
    assert np.mean(error < 2.5 * np.hypot(fused.std[:, 0], fused.std[:, 1])) > 0.95
    assert abs(Rotation.from_matrix(fused.rotation[0]).as_euler("ZYX")[0]) < 0.1
    assert (fused.std[:, 3:6] > 4.0).all()


def test_ten_positions_a_second_show_heading_velocity_and_biases(motion):
    """All within a few of the standard deviations that it states."""
    every = slice(None, None, 20)
    placed = motion["position"][every] + 0.002 * motion["noise"][every]
    positions = Readings(motion["t"][every], placed, 0.002)
    fused = fuse(motion["t"], motion["gyro"], motion["force"], GRAVITY, (0.005, 0.1), positions)
    at = np.searchsorted(motion["t"], fused.t - 1e-9)
    off = Rotation.from_matrix(
        np.swapaxes(motion["rotation"][at], 1, 2) @ fused.rotation
    ).as_rotvec()
    assert np.abs(off).max() < 0.02
    z = (fused.velocity - motion["velocity"][at]) / fused.std[:, 3:6]
    assert 0.3 < np.sqrt(np.mean(z**2)) < 2.0
    assert np.abs(fused.gyro_bias[len(at) // 2] - GYRO_BIAS).max() < 0.002
    assert np.abs(fused.accelerometer_bias[len(at) // 2] - FORCE_BIAS).max() < 0.03
