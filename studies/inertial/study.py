"""Rise time against spread of the estimated wrench, consistency, faults and biases, with an IMU and
without.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from windwrench import __version__
from windwrench.dynamics.vehicle import Vehicle
from windwrench.dynamics.vehicle_file import load_vehicle
from windwrench.estimator import UKFTuning, WrenchUKF
from windwrench.estimator.consistency import check_consistency, simulate_model, state_error
from windwrench.runtime.provenance import commit
from windwrench.studies.inertial.flights import (
    FINE_HZ,
    POSE_HZ,
    filter_tuning,
    fly,
    run_filter,
)

Array = NDArray[np.float64]
Indices = NDArray[np.integer[Any]]
Result = dict[str, Any]

VEHICLE = "ardrone2"
NOISES = {"1 mm": (0.001, 0.005), "10 mm": (0.01, 0.05)}  # m and rad
RATES = (0, 200, 500, 1000)  # Hz, of the IMU; 0: the pose alone
TRUSTS = (0.1, 1.0)  # of the default noise of the rotors: as it is, and ten times that
RISES = (0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64)  # s, as tuned
FORCE, TORQUE = np.array([0.6, 0.0, -0.4]), np.array([0.0, 0.03, 0.0])
PUSH_AT, SECONDS = 3.0, 5.0
SETTLED_FROM = 1.5  # s, to the push
AT_FORCE, AT_TORQUE = 0.02, 0.001  # N and Nm: the spread at which rise times are compared
_DRAWS = 1000  # of the bootstrap


def push() -> Array:
    """Return what each step adds to torque and force (K, 6)."""
    out = np.zeros((round(SECONDS * FINE_HZ), 6))
    out[round(PUSH_AT * FINE_HZ)] = np.concatenate([TORQUE, FORCE])
    return out


def rise_time(curve: Array, rate: int) -> float:
    """Return the 10-90 % rise time (s) of a mean response (n,) at a rate (Hz) to a step of one; NaN
    if it never rises.
    """
    rising = curve[round(PUSH_AT * rate) - 1 :]

    def crossing(level: float) -> float:
        after = np.flatnonzero(rising >= level)
        if not after.size:
            return float("nan")
        k = int(after[0])
        if k == 0:
            return 0.0
        return k - 1 + float((level - rising[k - 1]) / (rising[k] - rising[k - 1]))

    return float((crossing(0.9) - crossing(0.1)) / rate)


def at_spread(spread: Array, rise: Array, level: float) -> float:
    """Return the rise time at a spread, between the tunings beside it on logarithmic scales; NaN
    where no tuning comes there.
    """
    known = np.isfinite(rise) & (rise > 0.0)
    order = np.argsort(spread[known])
    x, y = np.log(spread[known][order]), np.log(rise[known][order])
    if not x.size or not x[0] <= np.log(level) <= x[-1]:
        return float("nan")
    return float(np.exp(np.interp(np.log(level), x, y)))


def interval(values: Array) -> list[float]:
    """Return the 95 % interval of bootstrapped values, those that are not finite left out."""
    values = values[np.isfinite(values)]
    if len(values) < _DRAWS // 2:
        return [float("nan")] * 2
    return [float(v) for v in np.percentile(values, [2.5, 97.5])]


def sweep(
    vehicle: Vehicle, runs: int, seed: int, progress: Callable[[float], None]
) -> list[Result]:
    """Return rise time and spread of force and torque for every pose noise, trust and IMU rate."""
    rows, done = [], 0
    draws = np.random.default_rng(seed).integers(0, runs, size=(_DRAWS, runs))
    for label, noise in NOISES.items():
        flights = [fly(vehicle, noise, SECONDS, push(), seed + i) for i in range(runs)]
        for trust in TRUSTS:
            for hz in RATES:
                curves, squares = [], []
                rate = hz or POSE_HZ
                settled = slice(round(SETTLED_FROM * rate), round(PUSH_AT * rate))
                for rise in RISES:
                    tuning = filter_tuning(vehicle, noise, 1.0 / rate, rise, trust)
                    found = [run_filter(vehicle, f, tuning, hz)[:2] for f in flights]
                    done += 1
                    progress(done / (len(NOISES) * len(TRUSTS) * len(RATES) * len(RISES)))
                    curves.append(
                        [
                            [f @ FORCE / (FORCE @ FORCE), t @ TORQUE / (TORQUE @ TORQUE)]
                            for f, t in found
                        ]
                    )
                    squares.append([[np.mean(w[settled] ** 2) for w in pair] for pair in found])
                rows.append(
                    {"pose": label, "trust": trust, "imu_hz": hz}
                    | _judge(np.array(curves), np.array(squares), draws, rate)
                )
    return rows


def _judge(curves: Array, squares: Array, draws: Indices, rate: int) -> Result:
    """Return figures and intervals from responses (rises, runs, 2, n) and mean squares (rises,
    runs, 2) of force and torque.
    """
    out: Result = {}
    for i, (kind, level) in enumerate((("force", AT_FORCE), ("torque", AT_TORQUE))):

        def figures(chosen: Indices, i: int = i) -> tuple[Array, Array]:
            spread = np.sqrt(squares[:, chosen, i].mean(axis=1))
            rise = np.array([rise_time(c, rate) for c in curves[:, chosen, i].mean(axis=1)])
            return spread, rise

        spread, rise = figures(np.arange(squares.shape[1]))
        drawn = [figures(chosen) for chosen in draws]
        out[kind] = {
            "spread": spread.tolist(),
            "spread_ci95": [
                interval(np.array([d[0][r] for d in drawn])) for r in range(len(RISES))
            ],
            "rise_s": rise.tolist(),
            "rise_s_ci95": [
                interval(np.array([d[1][r] for d in drawn])) for r in range(len(RISES))
            ],
            "at_s": at_spread(spread, rise, level),
            "at_s_ci95": interval(np.array([at_spread(*d, level) for d in drawn])),
        }
    return out


def consistency(
    vehicle: Vehicle, runs: int, seed: int, seconds: float, progress: Callable[[float], None]
) -> list[Result]:
    """Return NIS and NEES of filters whose model is true, biases drawn too."""
    rows = []
    cases = [(hz, pose) for hz in RATES[1:] for pose in (100, 50)]
    for done, (hz, pose_hz) in enumerate(cases):
        tuning = UKFTuning.for_vehicle(vehicle, 1.0 / hz)
        steps = round(seconds * hz)
        found = {name: np.empty((runs, steps)) for name in DOF}
        for r in range(runs):
            run = simulate_model(
                vehicle,
                tuning,
                np.full((steps, 4), vehicle.hover_rate),
                1.0 / hz,
                seed + r,
                angular_velocity=(0.0, 0.0, 1.0),
            )
            ukf = WrenchUKF(vehicle, tuning, 1.0 / hz)
            ukf.reset(
                run.initial_position,
                run.initial_quaternion,
                run.initial_covariance,
                run.initial_velocity,
                run.initial_angular_velocity,
            )
            for k in range(steps):
                ukf.predict(run.rotor_speeds[k])
                found["NIS of the IMU"][r, k] = ukf.correct_imu(
                    run.gyro[k], run.accelerometer[k]
                ).nis
                if (k + 1) % (hz // pose_hz) == 0:
                    ukf.correct(run.measured_position[k], run.measured_quaternion[k])
                error = state_error(ukf.estimate, *run.truth(k))
                bias = run.gyro_bias[k], run.accelerometer_bias[k]
                error = np.concatenate(
                    [error, bias[0] - ukf.gyro_bias, bias[1] - ukf.accelerometer_bias]
                )
                P = ukf.covariance_with_biases
                for name, rows_of in PARTS.items():
                    e = error[rows_of]
                    found[name][r, k] = e @ np.linalg.solve(P[rows_of, rows_of], e)
        row: Result = {"imu_hz": hz, "pose_hz": pose_hz, "runs": runs, "steps": steps}
        for name, dof in DOF.items():
            report = check_consistency(found[name], found[name], dof=(dof, dof))
            row[name] = {"mean": report.mean_nees, "band": report.nees_band}
        rows.append(row)
        progress((done + 1) / len(cases))
    return rows


PARTS = {
    "NEES of the force": slice(15, 18),
    "NEES without biases": slice(0, 18),
    "NEES with biases": slice(0, 24),
}
DOF = {
    "NIS of the IMU": 6,
    "NEES of the force": 3,
    "NEES without biases": 18,
    "NEES with biases": 24,
}

FAULT_HZ, FAULT_AT = 500, 2.0
# s; m/s2 along x; standard deviations in m/s2 and rad/s; N along x, of a push that is real
FAULTS = {
    "none": (0.5, 0.0, 0.0, 0.0, 0.0),
    "vibration of 30 m/s2 and 5 rad/s, 0.3 s": (0.3, 0.0, 30.0, 5.0, 0.0),
    "vibration of 5 m/s2 and 1 rad/s, 0.3 s": (0.3, 0.0, 5.0, 1.0, 0.0),
    "accelerometer saturated at 16 g, 0.5 s": (0.5, 157.0, 0.0, 0.0, 0.0),
    "none, but a push of 1 N": (0.5, 0.0, 0.0, 0.0, 1.0),
    "none, but a push of 4 N": (0.5, 0.0, 0.0, 0.0, 4.0),
}


def faults(
    vehicle: Vehicle, runs: int, seed: int, progress: Callable[[float], None]
) -> list[Result]:
    """Return the error of the force during faults of the IMU and half a second after, gate on and
    off, and of the pose alone.
    """
    noise, rows = NOISES["1 mm"], []
    filters: tuple[tuple[str, int, float | None], ...] = (
        ("pose alone", 0, None),
        ("no gate", FAULT_HZ, None),
        ("gate", FAULT_HZ, 0.999),
    )
    for name, (seconds, constant, shaking, turning, real) in FAULTS.items():
        change = np.zeros((round(SECONDS * FINE_HZ), 6))
        change[round(FAULT_AT * FINE_HZ), 3] = real
        flights = [fly(vehicle, noise, SECONDS, change, seed + i) for i in range(runs)]
        row: Result = {"fault": name}
        for label, hz, gate in filters:
            rate = hz or POSE_HZ
            tuning = filter_tuning(vehicle, noise, 1.0 / rate, 0.3, 1.0)
            window = slice(round(FAULT_AT * rate), round((FAULT_AT + seconds + 0.5) * rate))
            errors = []
            for flight in flights:
                spoil = None
                if hz:
                    begin, count = round(FAULT_AT * hz), round(seconds * hz)
                    more = np.random.default_rng([flight.seed, 3]).standard_normal((count, 6))
                    more *= np.repeat([turning, shaking], 3)
                    more[:, 3] += constant
                    spoil = slice(begin, begin + count), more
                force = run_filter(vehicle, flight, tuning, hz, gate, spoil)[0][window]
                errors.append(force - np.array([real, 0.0, 0.0]))
            row[label] = {
                "rms_N": float(np.sqrt(np.mean(np.square(errors)))),
                "largest_N": float(np.max(np.abs(errors))),
            }
        rows.append(row)
        progress(len(rows) / len(FAULTS))
    return rows


TIMES = (0.5, 2.0, 10.0)  # s


def observability(vehicle: Vehicle, seed: int) -> list[Result]:
    """Return what the filter knows of biases and force after some seconds at one attitude: with a
    measured position, with attitude alone, and with biases that are known beforehand.
    """
    hz = 200
    tuning = filter_tuning(vehicle, NOISES["1 mm"], 1.0 / hz, 1.0, 1.0)
    known = replace(tuning, gyro_bias_std=1e-6, accelerometer_bias_std=1e-6)
    known = replace(known, gyro_bias_walk=1e-9, accelerometer_bias_walk=1e-9)
    rows = []
    for name, used, with_position in (
        ("position and attitude", tuning, True),
        ("attitude alone", tuning, False),
        ("position and attitude, biases known", known, True),
    ):
        ukf = WrenchUKF(vehicle, used, 1.0 / hz)
        ukf.reset((0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0))
        speeds, up = np.full(4, vehicle.hover_rate), np.array([0.0, 0.0, vehicle.gravity])
        for k in range(round(TIMES[-1] * hz)):
            ukf.predict(speeds)
            ukf.correct_imu(np.zeros(3), up)
            ukf.correct((0.0, 0.0, 1.0) if with_position else None, (1.0, 0.0, 0.0, 0.0))
            if any(k + 1 == round(t * hz) for t in TIMES):
                force = np.sqrt(np.diagonal(ukf.covariance)[15:18])
                rows.append(
                    {
                        "measured": name,
                        "after_s": (k + 1) / hz,
                        "gyro_bias_std": float(ukf.gyro_bias_std[0]),
                        "accelerometer_bias_std": float(ukf.accelerometer_bias_std[0]),
                        "force_std_N": float(force[0]),
                    }
                )
    return rows


def costs(vehicle: Vehicle) -> Result:
    """Return the least time (us) of a step, of one that carries biases, and of ``correct_imu``."""
    ukf = WrenchUKF(vehicle)
    ukf.reset((0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0))
    speeds, up = np.full(4, vehicle.hover_rate), np.array([0.0, 0.0, vehicle.gravity])
    position, quaternion = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0, 0.0])

    def least(work: Callable[[], Any], count: int = 1000) -> float:
        times = []
        for _ in range(10):
            begin = time.perf_counter()
            for _ in range(count):
                work()
            times.append((time.perf_counter() - begin) / count)
        return 1e6 * min(times)

    plain = least(lambda: ukf.step(speeds, position, quaternion))
    ukf.correct_imu(np.zeros(3), up)
    return {
        "step_us": plain,
        "step_with_biases_us": least(lambda: ukf.step(speeds, position, quaternion)),
        "correct_imu_us": least(lambda: ukf.correct_imu(np.zeros(3), up)),
    }


def run(runs: int, seed: int, progress: Callable[[str, float], None]) -> Result:
    """Return everything that the page says."""
    vehicle = load_vehicle(VEHICLE)
    made = commit()
    return {
        "commit": made,
        "version": __version__,
        "runs": runs,
        "seed": seed,
        "sweep": sweep(vehicle, runs, seed, lambda share: progress("sweep", share)),
        "consistency": consistency(
            vehicle, 5 * runs, seed, 2.0, lambda share: progress("consistency", share)
        ),
        "faults": faults(vehicle, runs, seed, lambda share: progress("faults", share)),
        "observability": observability(vehicle, seed),
        "costs": costs(vehicle),
    }
