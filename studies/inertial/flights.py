"""Flights with gyro and accelerometer: truth from the filter's model at 1 kHz, sensors at their own
rates, and a filter run over them.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from windwrench.dynamics.vehicle import Vehicle
from windwrench.estimator import UKFTuning, WrenchUKF
from windwrench.estimator.consistency import ModelRun, simulate_model

Array = NDArray[np.float64]

FINE_HZ, POSE_HZ = 1000, 100
FINE = 1.0 / FINE_HZ
PERIOD = 0.005  # s, of the default tuning
TRUE_NOISE = 0.1  # the rotors' noise, of the default tuning's: 0.03 N and 0.003 Nm in 5 ms
_NONE = 1e-9  # a deviation that is nothing


@dataclass(frozen=True, eq=False)
class Flight:
    """One flight at 1 kHz: what happened, what the pose says, and what an IMU feels."""

    run: ModelRun  # its sensors have no noise of their own, but for the biases
    seed: int


def fly(
    vehicle: Vehicle, noise: tuple[float, float], seconds: float, push: Array | None, seed: int
) -> Flight:
    """Hover with a slow yaw, without a wrench but the ``push`` (K, 6) that each step adds.

    ``noise`` is that of the pose, m and rad.
    """
    base = UKFTuning.for_vehicle(vehicle, FINE)
    quiet = replace(
        base,
        motor_torque_noise=TRUE_NOISE * np.asarray(base.motor_torque_noise),
        thrust_noise=TRUE_NOISE * np.asarray(base.thrust_noise),
        torque_walk=_NONE,
        force_walk=_NONE,
        position_noise=noise[0],
        attitude_noise=noise[1],
        gyro_noise=_NONE,
        accelerometer_noise=_NONE,
    )
    steps = round(seconds * FINE_HZ)
    start = np.diag(np.repeat([1e-6, _NONE**2], [12, 6]))  # at rest, without a wrench
    hover = np.full((steps, 4), vehicle.hover_rate)
    return Flight(
        simulate_model(
            vehicle,
            quiet,
            hover,
            FINE,
            seed,
            angular_velocity=(0.0, 0.0, 0.5),
            covariance=start,
            push=push,
        ),
        seed,
    )


def filter_tuning(
    vehicle: Vehicle, noise: tuple[float, float], period: float, rise: float, trust: float
) -> UKFTuning:
    """Return the tuning at a period (s) for a rise time (s) and a share ``trust`` of the default
    noise of the rotors; the ratio of walk and noise sets the rise time.
    """
    base = UKFTuning.for_vehicle(vehicle, period, rise)
    scaled: dict[str, Any] = {
        name: trust * np.asarray(getattr(base, name))
        for name in ("motor_torque_noise", "thrust_noise", "torque_walk", "force_walk")
    }
    return replace(base, position_noise=noise[0], attitude_noise=noise[1], **scaled)


def sensed(flight: Flight, every: int, tuning: UKFTuning) -> tuple[Array, Array]:
    """Return gyro and accelerometer (n, 3) read every so many steps: the specific force is its mean
    since the last reading, as a sensor's own filter makes it.
    """
    run = flight.run
    rng = np.random.default_rng([flight.seed, 2])
    gyro = run.gyro[every - 1 :: every]
    felt = run.accelerometer.reshape(-1, every, 3).mean(axis=1)
    return (
        gyro + np.asarray(tuning.gyro_noise) * rng.standard_normal(gyro.shape),
        felt + np.asarray(tuning.accelerometer_noise) * rng.standard_normal(felt.shape),
    )


def run_filter(
    vehicle: Vehicle,
    flight: Flight,
    tuning: UKFTuning,
    imu_hz: int,
    gate: float | None = None,
    spoil: tuple[slice, Array] | None = None,
) -> tuple[Array, Array, WrenchUKF]:
    """Return the estimated force and torque, (n, 3) each, after every step, and the filter.

    Args:
        vehicle: as it is.
        flight: at 1 kHz.
        tuning: stated for the period of the IMU, or of the pose where there is none.
        imu_hz: 0: the pose alone.
        gate: of the filter.
        spoil: which readings of the IMU are wrong, and what (n, 6) they have more.
    """
    run = flight.run
    rate = imu_hz or POSE_HZ
    every, between = FINE_HZ // rate, rate // POSE_HZ
    period = 1.0 / rate
    # one rotor speed for each step of the filter, with the same mean thrust
    speeds = np.sqrt(np.mean(run.rotor_speeds.reshape(-1, every, 4) ** 2, axis=1))
    gyro, accelerometer = sensed(flight, every, tuning)
    if spoil is not None:
        gyro[spoil[0]] += spoil[1][:, :3]
        accelerometer[spoil[0]] += spoil[1][:, 3:]
    ukf = WrenchUKF(vehicle, tuning, period, gate)
    ukf.reset(
        run.initial_position,
        run.initial_quaternion,
        velocity=run.initial_velocity,
        angular_velocity=run.initial_angular_velocity,
    )
    rows = []
    for k in range(len(speeds)):
        ukf.predict(speeds[k])
        if imu_hz:
            ukf.correct_imu(gyro[k], accelerometer[k])
        if (k + 1) % between == 0:
            now = (k + 1) * every - 1
            ukf.correct(run.measured_position[now], run.measured_quaternion[now])
        rows.append(ukf.estimate.state[13:19])
    wrench = np.array(rows)
    return wrench[:, 3:], wrench[:, :3], ukf
