"""Flights for the tests: a rigid body with an IMU, integrated here, and the plant's."""

import numpy as np

from windwrench.identification.logs.flight_log import FlightLog

MASS = 0.5
INERTIA = np.diag([3.0e-3, 3.6e-3, 6.0e-3])
ARM = 0.12
K, REACH = 6.0e-6, 0.02
SPIN = np.array([-1.0, 1.0, -1.0, 1.0])
X, Y = ARM * np.array([1, -1, -1, 1.0]), ARM * np.array([1, 1, -1, -1.0])
FULL = 900.0  # rad/s at full command


def inertial_flight(seed, seconds=20.0, lag=0.05, rate=250.0, noise=1.0, calm=False):
    """Return an IMU log with commands, without a pose, and the rotor speeds (n, 4): commands swing
    on their own, so nothing is fed back, and a slow yaw keeps gyroscopic torque up.
    """
    rng = np.random.default_rng(seed)
    fine = 4
    dt = 1.0 / (rate * fine)
    n = int(seconds / dt)
    t = dt * np.arange(n)
    hover = np.sqrt(MASS * 9.81 / (4 * K))

    def swing(size, low, high):
        f, phase = rng.uniform(low, high, 6), rng.uniform(0, 2 * np.pi, 6)
        return size * np.sin(2 * np.pi * f * t[:, None] + phase).mean(axis=1)

    def twice(size):  # no constant torque: the body must not spin away
        return swing(0.02 * size, 0.8, 3.0) if calm else swing(size, 0.8, 3.0)

    roll, pitch, yaw, climb = twice(0.08), twice(0.08), twice(0.5), swing(0.25, 0.2, 2.0)
    share = 1.0 + climb[:, None] + np.outer(roll, np.sign(Y)) - np.outer(pitch, np.sign(X))
    share = share - np.outer(yaw, SPIN)
    command = hover * np.sqrt(np.maximum(share, 0.05)) / FULL
    held = command[:: 2 * fine].repeat(2 * fine, axis=0)[:n]
    speed, omega = FULL * held[0], np.array([0.0, 0.0, 0.0 if calm else 1.5])
    keep = np.exp(-dt / lag)
    rows = []
    for i in range(n):
        speed = FULL * held[i] + keep * (speed - FULL * held[i])
        thrust = K * speed**2
        torque = np.array([Y @ thrust, -X @ thrust, -REACH * (SPIN @ thrust)])
        torque -= np.array([0.012, 0.012, 0.004]) * omega * (0.0 if calm else 1.0)
        torque += np.array([0.0, 0.0, 0.004 * 1.5 * (0.0 if calm else 1.0)])
        omega = omega + dt * np.linalg.solve(INERTIA, torque - np.cross(omega, INERTIA @ omega))
        if i % fine == fine - 1:
            rows.append([t[i], *held[i], *speed, *omega, thrust.sum() / MASS])
    rows = np.array(rows)
    m = len(rows)
    accelerometer = np.column_stack([np.zeros(m), np.zeros(m), rows[:, 12]])
    accelerometer += noise * 0.15 * rng.standard_normal((m, 3)) + rng.normal(0, 0.05, 3)
    gyro = rows[:, 9:12] + noise * 0.005 * rng.standard_normal((m, 3)) + rng.normal(0, 0.01, 3)
    nothing = np.full((m, 4), np.nan)
    log = FlightLog(
        rows[:, 0],
        nothing[:, :3],
        nothing,
        nothing,
        accelerometer=accelerometer,
        gyro=gyro,
        command=rows[:, 1:5],
        name=f"inertial {seed}",
    )
    return log, rows[:, 5:9]
