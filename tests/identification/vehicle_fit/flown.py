"""Flights for the tests: a rigid body with an IMU, integrated here, and the plant's."""

from functools import cache
from math import nan, pi

import numpy as np
from numpy.random import default_rng

from windwrench.identification.logs.flight_log import FlightLog

MASS = 0.5
INERTIA = np.diag([3.0e-3, 3.6e-3, 6.0e-3])
ARM = 0.12
K = 6.0e-6
REACH = 0.02
SPIN = np.array([-1.0, 1.0, -1.0, 1.0])
X = ARM * np.array([1, -1, -1, 1.0])
Y = ARM * np.array([1, 1, -1, -1.0])
FULL = 900.0  # rad/s at full command


@cache
def inertial_flights(seeds=range(4), seconds=10.0, lag=0.05, rate=250):
    """Return, for each seed, an IMU log with commands and without a pose, and its rotor speeds
    (n, 4). Commands swing on their own, so nothing is fed back; a slow yaw shows gyroscopic torque.
    """
    fine = 2  # steps a sample
    dt = 1.0 / (rate * fine)
    n = round(seconds / dt)
    t = dt * np.arange(n)
    hover = np.sqrt(MASS * 9.81 / (4 * K))
    rngs = [default_rng(seed) for seed in seeds]

    def swing(size, low, high):
        waves = []
        for rng in rngs:
            f = rng.uniform(low, high, 6)
            phase = rng.uniform(0, 2 * pi, 6)
            waves.append(size * np.sin(2 * pi * f * t[:, None] + phase).mean(axis=1))
        return np.array(waves).T[:, :, None]  # (n, flights, 1)

    share = 1.0 + swing(0.25, 0.2, 2.0) - swing(0.5, 0.8, 3.0) * SPIN
    share = share + swing(0.08, 0.8, 3.0) * np.sign(Y) - swing(0.08, 0.8, 3.0) * np.sign(X)
    command = hover * np.sqrt(np.maximum(share, 0.05)) / FULL
    command = command[:: 2 * fine].repeat(2 * fine, axis=0)[:n]  # held
    speed = FULL * command[0]
    omega = np.tile([0.0, 0.0, 1.5], (len(rngs), 1))
    keep = np.exp(-dt / lag)
    moments = np.diag(INERTIA)
    mixing = np.array([Y, -X, -REACH * SPIN]).T
    damping = np.array([0.012, 0.012, 0.004])
    rest = np.array([0.0, 0.0, 1.5])
    speeds = np.empty_like(command)
    rates = np.empty((n, len(rngs), 3))
    for i in range(n):
        speed = FULL * command[i] + keep * (speed - FULL * command[i])
        torque = K * speed**2 @ mixing - damping * (omega - rest)
        omega = omega + dt * (torque - np.cross(omega, moments * omega)) / moments
        speeds[i] = speed
        rates[i] = omega
    each = (np.moveaxis(x[fine - 1 :: fine], 1, 0) for x in (command, speeds, rates))
    return [_log(rng, t[fine - 1 :: fine], *x) for rng, *x in zip(rngs, *each, strict=True)]


def _log(rng, t, command, speeds, rates):
    m = len(t)
    accelerometer = 0.15 * rng.standard_normal((m, 3)) + rng.normal(0, 0.05, 3)
    accelerometer[:, 2] += K * np.square(speeds).sum(axis=1) / MASS
    gyro = rates + 0.005 * rng.standard_normal((m, 3)) + rng.normal(0, 0.01, 3)
    nothing = np.full((m, 4), nan)
    measured = {"accelerometer": accelerometer, "gyro": gyro, "command": command}
    return FlightLog(t, nothing[:, :3], nothing, nothing, **measured, name="inertial"), speeds
