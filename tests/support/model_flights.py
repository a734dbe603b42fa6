"""Flights drawn from the filter's own model: each of its assumptions holds to the letter."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.linalg import inv, norm
from numpy.random import default_rng

from tests.support.reference_filters import KIT_ORDER
from windwrench import _core
from windwrench.dynamics import EffectSetting, load_vehicle
from windwrench.estimator import UKFTuning
from windwrench.estimator.estimate import FORCE, POSITION, QUATERNION, RATE, TORQUE, VELOCITY, Array
from windwrench.estimator.filter_record import BIASES, filter_record
from windwrench.estimator.recovery import N
from windwrench.estimator.reference import displaced, multiply, rotation_matrix, to_quaternion
from windwrench.estimator.tuning import decay_of
from windwrench.estimator.ukf import default_covariance

YAWED = {"quaternion": (0.5, 0.0, 0.0, 0.75**0.5), "angular_velocity": (0.0, 0.0, 3.0)}
ANISOTROPIC = UKFTuning(
    motor_torque_noise=(0.02, 0.03, 0.04),
    torque_walk=(2e-4, 3e-4, 4e-4),
    thrust_noise=(0.2, 0.3, 0.4),
    force_walk=(2e-3, 3e-3, 4e-3),
    position_noise=(0.001, 0.002, 0.003),
    attitude_noise=(0.003, 0.005, 0.008),
)
# force and torque as gusts, which have a memory; along y a walk
GUSTS = replace(ANISOTROPIC, force_time=(0.3, np.inf, 0.05), torque_time=(0.2, np.inf, 0.02))
WITH_EFFECTS = load_vehicle("ardrone2").with_effects(
    EffectSetting("com_offset", {"cx": 0.01, "cz": -0.02}),
    EffectSetting("rotor_drag", {"kdx": 1e-4, "kdy": 1e-4}),
)


@dataclass(frozen=True, eq=False)
class ModelRun:
    """Truth and measurement at the end of each of K steps, in the units of the filter."""

    start: tuple[Array, ...]  # of a filter's ``reset``; the truth is drawn around it
    rotor_speeds: Array  # (K, 4), and so on
    measured_position: Array
    measured_quaternion: Array
    state: Array  # (K, 20) the truth, laid out as the filter's; parts of it follow
    torque: Array
    force: Array
    gyro: Array  # (K, 3) as measured
    accelerometer: Array
    gyro_bias: Array  # (K, 3) in them
    accelerometer_bias: Array

    def begin(self, estimator):
        """Start an estimator where the truth is drawn around."""
        estimator.reset(*self.start)

    def fly(self, estimator, missing=()):
        """Step an estimator along, some poses missing; return its estimates."""
        self.begin(estimator)
        poses = zip(self.measured_position, self.measured_quaternion, strict=True)
        return [
            estimator.step(speeds, *((None, None) if k in missing else pose))
            for k, (speeds, pose) in enumerate(zip(self.rotor_speeds, poses, strict=True))
        ]

    def log(self, period=0.005):
        """Return times, rotor speeds, positions and quaternions, which a test may spoil."""
        pose = self.measured_position.copy(), self.measured_quaternion.copy()
        return period * np.arange(1, len(self.rotor_speeds) + 1), self.rotor_speeds, *pose


def simulate_model(
    vehicle,
    tuning,
    rotor_speeds,
    period=0.005,
    seed=0,
    quaternion=(1.0, 0.0, 0.0, 0.0),
    velocity=(0.0, 0.0, 0.0),
    angular_velocity=(0.0, 0.0, 0.0),
    rate_gain=20.0,
    push=None,
):
    """Return a flight in which the filter's assumptions hold to the letter.

    Every step draws a rotor torque error and a rotor force error (body frame), moves the external
    torque and force (world) by their walks, and measures the pose, all normal with the deviations
    of ``tuning``. The start is drawn from the filter's covariance about 1 m up and the given
    attitude and twist, with no external wrench in the mean. ``rate_gain`` (1/s) is of a loop on the
    true body rate, without which a walk of the torque spins the vehicle up. ``push`` (K, 6), Nm and
    N, is added to the external torque and force after each step.
    """
    speeds = np.array(rotor_speeds, dtype=np.float64)
    P = default_covariance(vehicle, tuning)
    start = np.zeros(20)
    start[POSITION], start[QUATERNION] = (0.0, 0.0, 1.0), quaternion
    start[VELOCITY], start[RATE] = velocity, angular_velocity
    rng = default_rng(seed)
    steps = len(speeds)
    # of a step: rotor torque and force, the walks of torque and force, attitude (16) and position
    noise = np.hstack([rng.standard_normal((steps, 12)), rng.standard_normal((steps, 6))])
    torque_walk, force_walk = (
        np.broadcast_to(walk, 3) * np.sqrt(decay_of(np.broadcast_to(time, 3), period, period)[1])
        for walk, time in (
            (tuning.torque_walk, tuning.torque_time),
            (tuning.force_walk, tuning.force_time),
        )
    )
    noise *= _deviations(
        *(tuning.motor_torque_noise, tuning.thrust_noise, torque_walk, force_walk),
        *(np.asarray(tuning.attitude_noise) / 4.0, tuning.position_noise),
    )
    if push is not None:
        noise[:, 6:12] += push
    out = np.empty((steps, 33))
    out[:, 27:], biases = _inertial_noise(tuning, steps, seed)
    record = filter_record(vehicle, tuning, period)
    drawn = rng.multivariate_normal(np.zeros(N), P, method="cholesky")
    unmix = np.ascontiguousarray(inv(vehicle.mixing)[:, 1:]) @ vehicle.inertia * rate_gain
    _simulate(
        *(record, start, drawn, speeds, unmix, vehicle.omega_max, noise, period),
        *(vehicle.voltage_ref, out),
    )
    states = out[:, :20].copy()
    return ModelRun(
        start=(start[POSITION], start[QUATERNION], P, start[VELOCITY], start[RATE]),
        rotor_speeds=speeds,
        measured_position=out[:, 20:23].copy(),
        measured_quaternion=out[:, 23:27].copy(),
        state=states,
        torque=states[:, TORQUE],
        force=states[:, FORCE],
        gyro=out[:, 27:30].copy(),
        accelerometer=out[:, 30:].copy(),
        gyro_bias=biases[:, :3],
        accelerometer_bias=biases[:, 3:],
    )


def _deviations(*each):
    """Return deviations of three axes each, stated as one number or three, side by side."""
    return np.concatenate([np.broadcast_to(deviation, 3) for deviation in each])


def _inertial_noise(tuning, steps, seed):
    """Return what gyro and accelerometer (K, 6) measure beside the truth, and the biases in it."""
    rng = default_rng([seed, 1])
    walk = rng.standard_normal((steps, BIASES))
    walk *= _deviations(tuning.gyro_bias_walk, tuning.accelerometer_bias_walk)
    walk[0] += rng.standard_normal(BIASES) * _deviations(
        tuning.gyro_bias_std, tuning.accelerometer_bias_std
    )
    biases = np.cumsum(walk, axis=0)
    white = rng.standard_normal((steps, BIASES))
    return biases + white * _deviations(tuning.gyro_noise, tuning.accelerometer_noise), biases


def _simulate(record, start, error, speeds, rate_loop, fastest, noises, dt, voltage, out):
    """Write state, measured pose and IMU, which holds its own noise, of each step: (K, 20 + 7 + 6).
    ``noises`` (K, 12 + 6) are those of the step and of the pose.
    """
    f, address = record[0], record.ctypes.data
    x, after, inertial = np.zeros(20), np.zeros(20), np.empty(6)
    x[KIT_ORDER] = displaced(start[KIT_ORDER], error)
    for k, noise in enumerate(noises):
        square = np.square(speeds[k]) + rate_loop @ (start[RATE] - x[RATE])
        speeds[k] = np.minimum(np.sqrt(np.maximum(square, 0.0)), fastest)
        _core.drive(address, speeds[k], dt, voltage)
        f["rotor_wrench"][1:] += noise[:3]
        _core.move(address, x, dt, after)
        # the force error is in the body frame and acts through the mass alone
        push = rotation_matrix(x[QUATERNION]) @ noise[3:6] * (dt / f["body"]["mass"])
        after[POSITION] += 0.5 * dt * push
        after[VELOCITY] += push
        after[TORQUE] += noise[6:9]
        after[FORCE] += noise[9:12]
        after[QUATERNION] /= norm(after[QUATERNION])
        x[:19] = after[:19]
        f["time"] += dt
        out[k, :20] = x
        out[k, 20:23] = x[POSITION] + noise[15:18]
        out[k, 23:27] = multiply(to_quaternion(noise[12:15]), x[QUATERNION])
        # the accelerometer feels the step's noise: the torque's is in the rotors' wrench already
        _core.expected_imu(address, x, inertial)
        out[k, 27:] += inertial
        out[k, 30:] += noise[3:6] / f["body"]["mass"]
