"""What one step of the wrench estimators costs from Python, beside filterpy's unscented Kalman
filter.

``python -m windwrench.speed.filter_step``

All of them take the same flight (AR.Drone 2.0, 200 Hz, yawing, pose measured at every step).
filterpy solves the same problem: 18 error states (rho, omega, x, v, torque, force) about a
reference attitude, the model (2)-(5), (11)-(14) in NumPy, and the process noise added as a matrix.
It is measured twice: with the model as one writes it down, vectors and ``numpy.cross``, and with
every product by component in plain Python numbers, which is over three times as fast. The rounds
are interleaved, so that a busy machine slows all of them alike; a ratio compares two times of one
round.
"""

import math
import os
import platform
import statistics
import sys
import time
from collections.abc import Callable
from importlib.metadata import version

import numpy as np

from ..dynamics import Vehicle, load_vehicle
from ..estimator import ConstantGainFilter, UKFTuning, WrenchUKF, WrenchUKFBatch
from ..estimator.consistency import ModelRun, simulate_model
from ..estimator.ekf import WrenchEKF
from ..estimator.estimate import Array
from ..estimator.observer import NonlinearObserver
from ..estimator.ukf import default_covariance
from ..estimator.ukf import step as ukf_step
from ..runtime.compiled import compiled_without_gil

Estimator = WrenchUKF | NonlinearObserver  # WrenchEKF and ConstantGainFilter are WrenchUKFs

PERIOD = 0.005  # s
STEPS = 2000  # a round of the compiled estimators
PEER_STEPS = 100  # a round of filterpy
ROUNDS = 9
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def _product(a: Array, b: Array) -> Array:
    """Return the Hamilton product of two quaternions (4,)."""
    aw, ax, ay, az = a.tolist()
    bw, bx, by, bz = b.tolist()
    return np.array(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ]
    )


def _vector_product(a: Array, b: Array) -> Array:
    """Return the same, written with vectors."""
    return np.concatenate(
        [[a[0] * b[0] - a[1:] @ b[1:]], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])]
    )


def _cross(a: Array, b: Array) -> Array:
    ax, ay, az = a.tolist()
    bx, by, bz = b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def _from_mrp(rho: Array) -> Array:
    x, y, z = rho.tolist()
    square = x * x + y * y + z * z
    scale = 1.0 / (1.0 + square)
    return np.array([(1.0 - square) * scale, 2.0 * x * scale, 2.0 * y * scale, 2.0 * z * scale])


def _to_mrp(q: Array) -> Array:
    q = q if q[0] >= 0.0 else -q
    return np.asarray(q[1:] / (1.0 + q[0]))


def _matrix(q: Array) -> Array:
    w, x, y, z = q.tolist()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


class PeerFilter:
    """The wrench filter on filterpy's ``UnscentedKalmanFilter``."""

    def __init__(
        self, vehicle: Vehicle, tuning: UKFTuning, period: float, by_component: bool = True
    ) -> None:
        self._product = _product if by_component else _vector_product
        self._cross = _cross if by_component else np.cross
        from filterpy.kalman import JulierSigmaPoints, UnscentedKalmanFilter

        self.vehicle, self.period = vehicle, period
        self.inverse = np.linalg.inv(vehicle.inertia)
        self.reference = np.array([1.0, 0.0, 0.0, 0.0])
        self.filter = UnscentedKalmanFilter(
            18,
            6,
            period,
            hx=self._measure,
            fx=self._move,
            points=JulierSigmaPoints(18, kappa=tuning.kappa),
        )
        B = np.zeros((18, 12))
        B[3:6, 0:3] = period * self.inverse
        B[6:9, 6:9] = 0.5 * period**2 / vehicle.mass * np.eye(3)
        B[9:12, 6:9] = period / vehicle.mass * np.eye(3)
        B[12:15, 3:6] = B[15:18, 9:12] = np.eye(3)
        deviations = np.concatenate(
            [
                np.broadcast_to(np.asarray(d, dtype=np.float64), 3)
                for d in (
                    tuning.motor_torque_noise,
                    tuning.torque_walk,
                    tuning.thrust_noise,
                    tuning.force_walk,
                )
            ]
        )
        self.filter.Q = B @ np.diag(deviations**2) @ B.T
        self.filter.R = np.diag(
            np.concatenate(
                [
                    np.broadcast_to(np.asarray(d, dtype=np.float64), 3)
                    for d in (np.asarray(tuning.attitude_noise) / 4.0, tuning.position_noise)
                ]
            )
            ** 2
        )

    def reset(
        self, position: Array, quaternion: Array, covariance: Array, velocity: Array, omega: Array
    ) -> None:
        """Start at a pose and twist, without an external wrench."""
        self.reference = np.array(quaternion)
        self.filter.x = np.concatenate([np.zeros(3), omega, position, velocity, np.zeros(6)])
        self.filter.P = np.array(covariance)

    def _move(self, x: Array, dt: float, rotors: Array, back: Array) -> Array:
        q = self._product(_from_mrp(x[:3]), self.reference)
        R, omega, v = _matrix(q), x[3:6], x[9:12]
        a = (R[:, 2] * rotors[0] + x[15:18]) / self.vehicle.mass
        a[2] -= self.vehicle.gravity
        alpha = self.inverse @ (
            rotors[1:] + R.T @ x[12:15] - self._cross(omega, self.vehicle.inertia @ omega)
        )
        rho = _to_mrp(self._product(self._turned(q, omega, dt), back))
        return np.concatenate(
            [rho, omega + dt * alpha, x[6:9] + dt * (v + 0.5 * dt * a), v + dt * a, x[12:]]
        )

    def _turned(self, q: Array, omega: Array, dt: float) -> Array:
        x, y, z = omega.tolist()
        angle = 0.5 * dt * math.sqrt(x * x + y * y + z * z)
        scale = 0.5 * dt * (math.sin(angle) / angle if angle > 1e-9 else 1.0)
        return self._product(q, np.array([math.cos(angle), scale * x, scale * y, scale * z]))

    def _measure(self, x: Array) -> Array:
        return np.concatenate([x[:3], x[6:9]])

    def step(self, rotor_speeds: Array, position: Array, quaternion: Array) -> Array:
        """Predict over one period and take in the pose; return the state (18,)."""
        after = self._turned(self.reference, self.filter.x[3:6], self.period)
        back = after * np.array([1.0, -1.0, -1.0, -1.0])
        self.filter.predict(rotors=self.vehicle.rotor_wrench(rotor_speeds), back=back)
        rho = _to_mrp(self._product(quaternion, back))
        self.filter.update(np.concatenate([rho, position]))
        q = self._product(_from_mrp(self.filter.x[:3]), after)
        self.reference = q / math.sqrt(q @ q)
        self.filter.x[:3] = 0.0
        return np.asarray(self.filter.x)


def _start(estimator: Estimator | PeerFilter, run: ModelRun) -> None:
    estimator.reset(
        run.initial_position,
        run.initial_quaternion,
        run.initial_covariance,
        run.initial_velocity,
        run.initial_angular_velocity,
    )


def time_step(estimator: Estimator | PeerFilter, run: ModelRun, steps: int) -> float:
    """Return the time of a step in s, a mean over ``steps`` of them from the start
    of the flight.
    """
    _start(estimator, run)
    step: Callable[..., object] = estimator.step
    samples = list(
        zip(
            run.rotor_speeds[:steps],
            run.measured_position[:steps],
            run.measured_quaternion[:steps],
            strict=True,
        )
    )
    begin = time.perf_counter()
    for speeds, position, quaternion in samples:
        step(speeds, position, quaternion)
    return (time.perf_counter() - begin) / steps


def compiled_loop(run: ModelRun) -> Callable[[], float]:
    """Return what steps a filter through a flight in a compiled loop and returns the time of a step
    in us.
    """
    ukf = WrenchUKF(load_vehicle("ardrone2"), UKFTuning(), PERIOD)
    samples = np.concatenate(
        [run.rotor_speeds, run.measured_position, run.measured_quaternion], axis=1
    )

    def measure() -> float:
        _start(ukf, run)
        begin = time.perf_counter()
        _step_through(ukf.record, samples, PERIOD)
        return 1e6 * (time.perf_counter() - begin) / len(samples)

    _start(ukf, run)
    _step_through(ukf.record, samples[:1], PERIOD)  # compiles
    return measure


@compiled_without_gil
def _step_through(record: np.ndarray, samples: Array, dt: float) -> None:
    f = record[0]
    for k in range(len(samples)):
        ukf_step(f, samples[k], 3, dt, 0.0)


def time_batch(run: ModelRun, count: int, filter_steps: int = 4096) -> Callable[[], float]:
    """Return what steps ``count`` filters side by side through a flight and returns the time of one
    filter's step in us.
    """
    batch = WrenchUKFBatch(load_vehicle("ardrone2"), count, UKFTuning(), PERIOD)
    steps = max(1, filter_steps // count)
    samples = [
        tuple(
            np.tile(values[k], (count, 1))
            for values in (run.rotor_speeds, run.measured_position, run.measured_quaternion)
        )
        for k in range(min(steps, 8))
    ]
    batch.reset(
        run.initial_position,
        run.initial_quaternion,
        run.initial_covariance,
        run.initial_velocity,
        run.initial_angular_velocity,
    )
    batch.step(*samples[0])

    def measure() -> float:
        begin = time.perf_counter()
        for k in range(steps):
            batch.step(*samples[k % len(samples)])
        return 1e6 * (time.perf_counter() - begin) / (steps * count)

    return measure


def agreement(
    run: ModelRun, ours: WrenchUKF, peer: PeerFilter, steps: int = PEER_STEPS
) -> tuple[float, float]:
    """Return the largest difference in force (N) and torque (Nm) between the two over a flight."""
    _start(ours, run)
    _start(peer, run)
    force = torque = 0.0
    for k in range(steps):
        sample = run.rotor_speeds[k], run.measured_position[k], run.measured_quaternion[k]
        estimate, state = ours.step(*sample), peer.step(*sample)
        force = max(force, float(np.abs(estimate.force - state[15:18]).max()))
        torque = max(torque, float(np.abs(estimate.torque - state[12:15]).max()))
    return force, torque


def make_run(steps: int) -> ModelRun:
    """Return the flight that is stepped through: yawed by 120 degrees, turning at 3 rad/s."""
    vehicle, tuning = load_vehicle("ardrone2"), UKFTuning()
    return simulate_model(
        vehicle,
        tuning,
        np.full((steps, 4), vehicle.hover_rate),
        PERIOD,
        seed=1,
        quaternion=(math.cos(math.pi / 3), 0.0, 0.0, math.sin(math.pi / 3)),
        angular_velocity=(0.0, 0.0, 3.0),
        covariance=0.01 * default_covariance(vehicle, tuning),
    )


def main(rounds: int = ROUNDS, steps: int = STEPS, peer_steps: int = PEER_STEPS) -> None:
    """Measure and print."""
    from rich.console import Console
    from rich.table import Table

    vehicle, tuning, run = load_vehicle("ardrone2"), UKFTuning(), make_run(max(steps, peer_steps))
    ukf, peer = WrenchUKF(vehicle, tuning, PERIOD), PeerFilter(vehicle, tuning, PERIOD)
    entries: list[tuple[str, Estimator | PeerFilter, int]] = [
        ("WrenchUKF", ukf, steps),
        ("ConstantGainFilter", ConstantGainFilter(vehicle, tuning, PERIOD), steps),
        ("WrenchEKF", WrenchEKF(vehicle, tuning, PERIOD), steps),
        ("NonlinearObserver", NonlinearObserver(vehicle, None, PERIOD), steps),
        ("filterpy's UKF, by component", peer, peer_steps),
        (
            "filterpy's UKF, numpy.cross",
            PeerFilter(vehicle, tuning, PERIOD, by_component=False),
            peer_steps // 2,
        ),
    ]
    for _, estimator, _ in entries:
        time_step(estimator, run, 3)  # compiles
    times: list[list[float]] = [[] for _ in entries]
    for _ in range(rounds):
        for taken, (_, estimator, count) in zip(times, entries, strict=True):
            taken.append(time_step(estimator, run, count))
    table = Table(title=f"Time of one step from Python, medians of {rounds} interleaved rounds")
    table.add_column("estimator")
    table.add_column("us a step", justify="right")
    table.add_column("min - max", justify="right")
    for name, _, _ in entries[-2:]:
        table.add_column(f"{name}: times as long", justify="right")
    for taken, (name, _, _) in zip(times, entries, strict=True):
        ratios = [
            [theirs / mine for theirs, mine in zip(peers, taken, strict=True)]
            for peers in times[-2:]
        ]
        table.add_row(
            name,
            f"{1e6 * statistics.median(taken):.1f}",
            f"{1e6 * min(taken):.1f} - {1e6 * max(taken):.1f}",
            *(f"{statistics.median(r):.0f} ({min(r):.0f} - {max(r):.0f})" for r in ratios),
        )
    console = Console()
    console.print(table)
    force, torque = agreement(run, ukf, peer, peer_steps)
    console.print(
        f"One thread; Python {platform.python_version()}, "
        + ", ".join(f"{name} {version(name)}" for name in ("numpy", "numba", "filterpy"))
        + f". Largest difference between WrenchUKF and filterpy over {peer_steps} steps: "
        f"{1e3 * force:.2g} mN, "
        f"{1e3 * torque:.2g} mNm.",
        highlight=False,
    )


if __name__ == "__main__":
    if any(os.environ.get(name) != "1" for name in _THREADS):
        # libraries read these when they are loaded, and the package has loaded them by now: start
        # over
        os.environ.update(dict.fromkeys(_THREADS, "1"))
        os.execv(sys.executable, [sys.executable, "-m", "windwrench.speed.filter_step"])
    main()
