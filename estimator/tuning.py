"""How much the filter trusts its model and its measurements."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import ArrayLike

from ..dynamics.vehicle import Vehicle
from ..runtime.arguments import check_positive
from .estimate import Array

# The vehicle and period for which the default tuning is stated: AR.Drone 2.0 at 200 Hz
PERIOD = 0.005
_WEIGHT = 0.465 * 9.81
_ARM = 0.1262


def decay_of(time: ArrayLike, dt: float, period: float) -> tuple[Array, Array]:
    """Return the decay of a wrench with a correlation time, s, over ``dt`` s: a factor, and the
    added variance, as a multiple of the squared walk of a step of ``period`` s.
    """
    rate = 1.0 / np.asarray(time, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        grown = -np.expm1(-2.0 * rate * dt) / (2.0 * rate * period)
    return np.exp(-rate * dt), np.where(rate > 0.0, grown, dt / period)


@dataclass(frozen=True)
class UKFTuning:
    """Standard deviations per step, each a scalar or (3,) for x, y, z; the defaults suit
    ``ardrone2`` at 200 Hz.

    The 10-90 % rise time of the force estimate is about ``2.2 * period * thrust_noise /
    force_walk``, and of the torque estimate likewise: about 1 s as given. With a
    ``motor_torque_noise`` far below the model's real error the filter loses the attitude when the
    torque steps. A wrong lateral force is the sign.

    The external wrench is the paper's random walk: without poses, its variance grows without bound.
    Gusts have a size and a memory. With ``force_time`` and ``torque_time`` the wrench is an
    Ornstein-Uhlenbeck process: without poses, the estimate falls to 1/e in this time, and its
    standard deviation approaches ``walk * sqrt(time / (2 period))``. The walk stays the change in a
    step (Gelb, *Applied Optimal Estimation*, 1974, section 2.3). A steady wrench is then
    underestimated: choose times well beyond the time in which measurements show a wrench, the rise
    time.

    The biases of an IMU begin with the deviations of PX4's EKF2 (``GBIAS_INIT`` 0.1 rad/s,
    ``ABIAS_INIT`` 0.2 m/s2). They walk within a factor of five of EKF2's process noise, 7e-6 rad/s
    and 2e-5 m/s2 in 5 ms. The accelerometer's walks faster, for temperature and vibration. Their
    bounds are the MPU-6000's data sheet's, for a sensor's zero: 20 deg/s and 80 mg.

    Attributes:
        motor_torque_noise: Nm, body frame: torque that the rotor model misses, new each step.
        torque_walk: Nm, world frame: change of the external torque in a step.
        thrust_noise: N, body frame: force that the rotor model misses, new each step.
        force_walk: N, world frame: change of the external force in a step.
        torque_time: s, correlation time of the external torque; infinite: a random walk.
        force_time: s, correlation time of the external force; infinite: a random walk.
        position_noise: m, one measurement.
        attitude_noise: rad, one measurement; the quarter of an MRP is handled inside.
        kappa: spread of the sigma points, (28)
        gyro_noise: rad/s, one measurement of ``correct_imu``.
        accelerometer_noise: m/s2, likewise.
        gyro_bias_walk: rad/s: change of the gyro's bias in a step.
        accelerometer_bias_walk: m/s2: change of the accelerometer's in a step.
        gyro_bias_std: rad/s: standard deviation of the gyro's bias at the start.
        accelerometer_bias_std: m/s2: the same for the accelerometer.
        gyro_bias_bound: rad/s: largest estimate of the gyro's bias.
        accelerometer_bias_bound: m/s2: the same for the accelerometer.
    """

    motor_torque_noise: ArrayLike = 0.03
    torque_walk: ArrayLike = 3.26e-4
    thrust_noise: ArrayLike = 0.3
    force_walk: ArrayLike = 3.26e-3
    torque_time: ArrayLike = math.inf
    force_time: ArrayLike = math.inf
    position_noise: ArrayLike = 0.001
    attitude_noise: ArrayLike = 0.005
    kappa: float = 2.0
    gyro_noise: ArrayLike = 0.005
    accelerometer_noise: ArrayLike = 0.05
    gyro_bias_walk: ArrayLike = 1e-5
    accelerometer_bias_walk: ArrayLike = 1e-4
    gyro_bias_std: ArrayLike = 0.1
    accelerometer_bias_std: ArrayLike = 0.2
    gyro_bias_bound: ArrayLike = 0.35
    accelerometer_bias_bound: ArrayLike = 0.8

    def __post_init__(self) -> None:
        check_positive(self, vars(self).keys() - {"kappa"}, ("torque_time", "force_time"))

    @classmethod
    def for_vehicle(
        cls, vehicle: Vehicle, period: float = PERIOD, rise_time: float = 1.0
    ) -> UKFTuning:
        """Return the default tuning scaled to a vehicle's weight and size, its motion capture and
        the period in s.

        ``rise_time`` (s, 10-90 %) is that of the estimated force and torque.
        """
        force = vehicle.weight / _WEIGHT
        torque = force * vehicle.arm_l / _ARM
        return cls(
            motor_torque_noise=0.03 * torque,
            torque_walk=3.26e-4 * torque / rise_time,
            thrust_noise=0.3 * force,
            force_walk=3.26e-3 * force / rise_time,
            position_noise=vehicle.mocap.sigma_pos_m,
            attitude_noise=vehicle.mocap.sigma_att_rad,
        ).scaled(PERIOD, period)

    def scaled(self, period: float, to: float) -> UKFTuning:
        """Return the same tuning of steps of ``to`` s, stated for steps of ``period`` s: white
        noise averages, a walk grows.
        """
        slower = np.sqrt(to / period)
        factors = {f.name: slower for f in fields(self) if f.name.endswith("_walk")}
        factors |= dict.fromkeys(("motor_torque_noise", "thrust_noise"), 1.0 / slower)
        changed = {n: np.asarray(getattr(self, n)) * factor for n, factor in factors.items()}
        return replace(self, **changed)
