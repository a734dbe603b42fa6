"""One step of the wrench estimators from Python, beside filterpy's unscented Kalman filter.

All take the same flight: AR.Drone 2.0 at 200 Hz, hovering and yawing at 3 rad/s, with a pose at
every step. filterpy solves the same problem: 18 error states about a reference attitude, 37 sigma
points, the process noise added as a matrix, and this kit's own compiled rigid body as its model.
"""

import importlib.util
import math
import time
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

import numpy as np

from ..dynamics import Vehicle, load_vehicle
from ..dynamics.motion import Array, accelerations, body_record
from ..dynamics.rotation import (
    attitude_error,
    matrix_of,
    quaternion_from_mrp,
    quaternion_multiply,
    turn_body,
)
from ..estimator import ConstantGainFilter, UKFTuning, WrenchEKF, WrenchUKF, WrenchUKFBatch
from .contenders import Contender

PERIOD = 0.005  # s
STEPS = 2000  # of a run of a compiled filter
PEER_STEPS = 60  # of a run of filterpy
_YAW_RATE = 3.0  # rad/s
_UNIT = "us a step"

Sample = tuple[Array, Array, Array]  # rotor speeds (4,), position (3,), quaternion (4,)


def flight(steps: int = STEPS) -> list[Sample]:
    """Return the rotor speeds and measured poses of the flight that all filters take."""
    vehicle, rng = load_vehicle("ardrone2"), np.random.default_rng(1)
    speeds = np.full(4, vehicle.hover_rate)
    samples = []
    for k in range(steps):
        yaw = 2.0 * math.pi / 3.0 + _YAW_RATE * PERIOD * (k + 1)
        quaternion = np.array([math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)])
        samples.append((speeds, rng.normal(0.0, 0.001, 3), quaternion))
    return samples


class PeerFilter:
    """The wrench filter on filterpy's ``UnscentedKalmanFilter``."""

    def __init__(self, vehicle: Vehicle, tuning: UKFTuning, period: float) -> None:
        from filterpy.kalman import JulierSigmaPoints, UnscentedKalmanFilter

        self.vehicle, self.period, self.body = vehicle, period, body_record(vehicle)[0]
        self.reference = np.array([1.0, 0.0, 0.0, 0.0])
        points = JulierSigmaPoints(18, kappa=tuning.kappa)
        self.filter: Any = UnscentedKalmanFilter(
            18, 6, period, hx=lambda x: np.r_[x[:3], x[6:9]], fx=self._move, points=points
        )
        B = np.zeros((18, 12))
        B[3:6, 0:3] = period * np.linalg.inv(vehicle.inertia)
        B[6:9, 6:9] = 0.5 * period**2 / vehicle.mass * np.eye(3)
        B[9:12, 6:9] = period / vehicle.mass * np.eye(3)
        B[12:15, 3:6] = B[15:18, 9:12] = np.eye(3)
        walks = (tuning.torque_walk, tuning.thrust_noise, tuning.force_walk)
        Q = _variances(tuning.motor_torque_noise, *walks)
        self.filter.Q = B @ Q @ B.T
        self.filter.R = _variances(np.asarray(tuning.attitude_noise) / 4.0, tuning.position_noise)

    def reset(self, position: Array, quaternion: Array, covariance: Array) -> None:
        """Start at rest at a pose, without an external wrench."""
        self.reference = np.array(quaternion)
        self.filter.x = np.r_[np.zeros(6), position, np.zeros(9)]
        self.filter.P = np.array(covariance)

    def _move(self, x: Array, dt: float, rotors: Array, back: Array) -> Array:
        q, turned, rate = np.empty(4), np.empty(4), np.empty(6)
        quaternion_from_mrp(x[:3], turned)
        quaternion_multiply(turned, self.reference, q)
        none = np.zeros(6)
        accelerations(self.body, matrix_of(q), x[3:6], rotors, x[12:15], x[15:18], none, rate)
        turn_body(q, x[3], x[4], x[5], dt, turned)
        attitude_error(turned, back, none[:3])
        v, a = x[9:12], rate[:3]
        moved = x[6:9] + dt * (v + 0.5 * dt * a)
        return np.concatenate([none[:3], x[3:6] + dt * rate[3:], moved, v + dt * a, x[12:]])

    def step(self, rotor_speeds: Array, position: Array, quaternion: Array) -> Array:
        """Predict over one period and take in the pose; return the state (18,)."""
        after, rho, turn = np.empty(4), np.empty(3), np.empty(4)
        x, y, z = self.filter.x[3:6]
        turn_body(self.reference, x, y, z, self.period, after)
        self.filter.predict(rotors=self.vehicle.rotor_wrench(rotor_speeds), back=after)
        attitude_error(quaternion, after, rho)
        self.filter.update(np.r_[rho, position])
        quaternion_from_mrp(self.filter.x[:3], turn)
        quaternion_multiply(turn, after, self.reference)
        self.reference /= np.linalg.norm(self.reference)
        self.filter.x[:3] = 0.0
        return np.asarray(self.filter.x)


def _variances(*deviations: Any) -> Array:
    return np.diag(np.concatenate([np.broadcast_to(d, 3) for d in deviations]) ** 2)


def start(estimator: Any, samples: list[Sample], covariance: Array) -> None:
    """Reset a filter to the pose with which a flight begins."""
    estimator.reset(samples[0][1], samples[0][2], covariance)


def _timed(estimator: Any, samples: list[Sample], covariance: Array) -> Callable[[], float]:
    """Return a run of a filter over a flight; the run returns the mean time of a step in us."""

    def run() -> float:
        start(estimator, samples, covariance)
        begin = time.perf_counter()
        for sample in samples:
            estimator.step(*sample)
        return 1e6 * (time.perf_counter() - begin) / len(samples)

    start(estimator, samples, covariance)
    estimator.step(*samples[0])  # compiles
    return run


def _timed_batch(samples: list[Sample], count: int) -> Callable[[], float]:
    """Return a run of filters side by side; the run returns the time of one filter's step in us."""
    batch = WrenchUKFBatch(load_vehicle("ardrone2"), count, UKFTuning(), PERIOD)
    steps = max(1, 4096 // count)
    given = [tuple(np.tile(part, (count, 1)) for part in sample) for sample in samples[:8]]
    batch.reset(samples[0][1], samples[0][2])
    batch.step(*given[0])  # compiles

    def run() -> float:
        begin = time.perf_counter()
        for k in range(steps):
            batch.step(*given[k % len(given)])
        return 1e6 * (time.perf_counter() - begin) / (steps * count)

    return run


def filters() -> list[Contender]:
    """Return the filters, and filterpy's where it is installed."""
    vehicle, tuning, samples = load_vehicle("ardrone2"), UKFTuning(), flight()
    ukf = WrenchUKF(vehicle, tuning, PERIOD)
    ukf.reset(samples[0][1], samples[0][2])
    covariance = 0.01 * ukf.covariance
    found = [
        Contender(type(one).__name__, _UNIT, includes, _timed(one, samples, covariance))
        for one, includes in (
            (ukf, "predict, correct, copy of state and covariance"),
            (ConstantGainFilter(vehicle, tuning, PERIOD), "the same with a constant covariance"),
            (WrenchEKF(vehicle, tuning, PERIOD), "as WrenchUKF"),
        )
    ]
    found += [
        Contender(
            f"WrenchUKFBatch, {count} filters",
            _UNIT,
            "predict, correct, copy of state",
            _timed_batch(samples, count),
        )
        for count in (16, 256)
    ]
    if importlib.util.find_spec("filterpy"):
        peer = PeerFilter(vehicle, tuning, PERIOD)
        run = _timed(peer, samples[:PEER_STEPS], covariance)
        name = f"filterpy {version('filterpy')} UKF"
        found.append(Contender(name, _UNIT, "the same state and model, 37 sigma points", run))
    return found
