"""A million steps of the filter, with everything that motion capture does wrong on the way."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from windwrench.dynamics import load_vehicle
from windwrench.estimator import UKFTuning, WrenchUKF
from windwrench.estimator.estimate import STATE_SIZE

PERIOD = 0.005
STEPS = 1_000_000
LAP = 4000  # steps after which the flight repeats
FAULT_EVERY, FAULT = 2000, 100  # steps: every 10 s motion capture fails for 0.5 s
RECOVERY = 200  # steps: 1 s
FORCE, TORQUE = np.array([0.3, -0.2, -0.1]), np.array([0.01, -0.015, 0.02])


def lap(vehicle):
    """Rotor speeds, positions and quaternions of a flight that closes after 20 s, by inverse
    dynamics.

    The vehicle turns six times in a lap at a rate that swings between 1 and 3 rad/s, and
    translates, under a constant wrench.
    """
    t = 0.5 * PERIOD * np.arange(-2, 2 * LAP + 2)  # half steps
    base = 2 * np.pi / (LAP * PERIOD)
    position, acceleration = np.zeros((len(t), 3)), np.zeros((len(t), 3))
    for axis, size, harmonic, phase in ((0, 1.0, 4, 0.0), (1, 0.8, 3, 1.0), (2, 0.2, 2, 0.5)):
        rate = harmonic * base
        position[:, axis] = size * np.sin(rate * t + phase)
        acceleration[:, axis] = -size * rate**2 * np.sin(rate * t + phase)
    yaw = 6 * base * t + 3.0 * np.sin(base * t)
    thrust = vehicle.mass * (acceleration + np.array([0, 0, vehicle.gravity])) - FORCE
    size = np.linalg.norm(thrust, axis=1)
    up = thrust / size[:, None]
    left = np.cross(up, np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)], axis=1))
    left /= np.linalg.norm(left, axis=1)[:, None]
    R = Rotation.from_matrix(np.stack([np.cross(left, up), left, up], axis=2))
    # central differences over one step
    omega = (R[:-2].inv() * R[2:]).as_rotvec() / PERIOD
    alpha = np.gradient(omega, 0.5 * PERIOD, axis=0)
    J = vehicle.inertia
    torque = alpha @ J + np.cross(omega, omega @ J) - R[1:-1].inv().apply(TORQUE)
    middle = slice(2, 2 + 2 * LAP, 2)  # of the interval from one whole step to the next
    rotors = np.array(
        [
            vehicle.rotor_speeds(*pair)
            for pair in zip(size[1:-1][middle], torque[middle], strict=True)
        ]
    )
    # each row: what the rotors do in an interval, and the pose at its end
    end = slice(4, 4 + 2 * LAP, 2)
    return rotors, position[end], R[end].as_quat(scalar_first=True)


@pytest.mark.slow
def test_a_million_steps_with_faults_leave_the_filter_healthy():
    vehicle = load_vehicle("ardrone2")
    ukf = WrenchUKF(vehicle, UKFTuning(), PERIOD, gate=0.999)
    rotors, position, quaternion = lap(vehicle)
    rng = np.random.default_rng(0)
    ukf.reset(position[-1], quaternion[-1])
    nan3, nan4 = np.full(3, np.nan), np.full(4, np.nan)
    errors = np.empty((STEPS, 3))  # position, force, torque
    attitude_match = np.empty(STEPS)
    states = np.empty((LAP, STATE_SIZE))
    least_eigenvalue = np.inf
    for start in range(0, STEPS, LAP):
        shift = (
            np.where(rng.random(LAP) < 0.01, 0.5, 0.0)[:, None]
            * rng.choice([-1.0, 1.0], (LAP, 3))
            / np.sqrt(3)
        )
        measured = position + 0.001 * rng.standard_normal((LAP, 3)) + shift
        turned = Rotation.from_rotvec(0.005 * rng.standard_normal((LAP, 3))) * Rotation.from_quat(
            quaternion, scalar_first=True
        )
        signed = turned.as_quat(scalar_first=True) * rng.choice([-1.0, 1.0], (LAP, 1))
        kind = rng.choice(
            5, LAP, p=[0.95, 0.02, 0.01, 0.01, 0.01]
        )  # whole, none, NaN, position only, attitude only
        bursts = np.arange(start, start + LAP) % FAULT_EVERY >= FAULT_EVERY - FAULT
        kind[bursts] = 1 + (np.arange(start, start + LAP)[bursts] // FAULT_EVERY) % 2
        for i, what in enumerate(kind.tolist()):
            x, q = measured[i], signed[i]
            if what == 1:
                x = q = None
            elif what == 2:
                x, q = nan3, nan4
            elif what == 3:
                q = None
            elif what == 4:
                x = nan3
            states[i] = ukf.step(rotors[i], x, q).state
            if i % 2000 == 0:
                least_eigenvalue = min(least_eigenvalue, np.linalg.eigvalsh(ukf.covariance)[0])
        for column, (part, truth) in enumerate(
            ((slice(0, 3), position), (slice(16, 19), FORCE), (slice(13, 16), TORQUE))
        ):
            errors[start : start + LAP, column] = np.abs(states[:, part] - truth).max(axis=1)
        attitude_match[start : start + LAP] = np.sum(states[:, 3:7] * quaternion, axis=1)
    assert least_eigenvalue > 0.0
    assert np.all(np.isfinite(errors))
    phase = np.arange(STEPS) % FAULT_EVERY
    recovered = (np.arange(STEPS) > 800) & (phase >= RECOVERY) & (phase < FAULT_EVERY - FAULT)
    np.testing.assert_array_less(errors[recovered].max(axis=0), [0.005, 0.08, 0.006])
    np.testing.assert_array_less(
        np.sqrt(np.mean(errors[recovered] ** 2, axis=0)), [0.001, 0.02, 0.002]
    )
    assert np.abs(attitude_match[recovered]).min() > np.cos(0.5 * 0.03)  # 0.03 rad
