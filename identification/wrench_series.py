"""The external wrench over a flight log: the wrench filter run from its first row to its last."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..dynamics.vehicle import Vehicle
from ..estimator import UKFTuning, WrenchUKF
from ..runtime.errors import InputError
from .logs.flight_log import FlightLog
from .logs.screening import screen_for_estimate
from .logs.tables import write_csv

Array = NDArray[np.float64]

_LOST = 2.0  # s without a pose, after which the filter starts anew at the next one
_REPORTED = 10_000  # rows between two reports of progress
_SLACK = 0.1  # of a period: a step so little too long is still one step


@dataclass(frozen=True, eq=False)
class WrenchSeries:
    """The estimate at every row of a log. Standard deviations are the filter's own."""

    t: Array  # (N,) s
    force: Array  # (N, 3) N, world
    torque: Array  # (N, 3) Nm, world
    std_force: Array  # (N, 3) N
    std_torque: Array  # (N, 3) Nm
    nis: Array  # (N,) normalised innovation squared; NaN where there was no pose to compare with
    position: Array  # (N, 3) m, world
    quaternion: Array  # (N, 4) body to world, scalar first
    velocity: Array  # (N, 3) m/s, world
    angular_velocity: Array  # (N, 3) rad/s, body
    vehicle: Vehicle  # as it was declared to the filter
    notes: tuple[str, ...] = ()


def estimate_log(
    log: FlightLog,
    vehicle: Vehicle,
    tuning: UKFTuning | None = None,
    report: Callable[[float], None] = lambda share: None,
) -> WrenchSeries:
    """Estimate the external force and torque at every row of a log.

    The filter starts at the first pose. Each row's prediction uses the mean of its rotor speeds and
    those of the row before, in steps of at most one median period; a row without a pose is
    prediction alone, and what gyro and accelerometer measured, if they did. After 2 s without a
    pose the estimate is held, and the filter starts anew at the next pose. Rows before the first
    pose hold the filter's estimate at that pose: no wrench, and its standard deviation.

    Args:
        log: the flight.
        vehicle: the declared vehicle; the wrench is what it and its declared effects do not
            explain.
        tuning: default ``UKFTuning.for_vehicle(vehicle, log.period)``.
        report: called now and then with the share that is done.

    Raises:
        InputError: the log has no pose at all, is of other units or conventions than it declares
            (``screen_for_estimate``), or its rotor speeds make the filter's numbers overflow.
    """
    log, doubts = screen_for_estimate(log, vehicle)
    seen = np.flatnonzero(log.valid)
    period = log.period
    ukf = WrenchUKF(vehicle, tuning, period=period)
    count = len(log.t)
    state, deviation = np.empty((count, 19)), np.empty((count, 6))
    nis = np.full(count, np.nan)
    restarts: list[tuple[float, float]] = []  # s, the last pose before and the next

    first = int(seen[0])
    ukf.reset(log.position[first], log.quaternion[first])
    last_pose = float(log.t[first])
    with np.errstate(
        over="ignore", invalid="ignore"
    ):  # an estimate that overflows is refused below
        for k in range(first, count):
            t = float(log.t[k])
            if k % _REPORTED == 0:
                report(k / count)
            if k > first:
                if t - last_pose <= _LOST:
                    _predict(ukf, log, k, period)
                    _take_in_imu(ukf, log, k)
                    if log.valid[k]:
                        nis[k] = ukf.correct(log.position[k], log.quaternion[k]).nis
                elif log.valid[k]:
                    ukf.reset(log.position[k], log.quaternion[k])
                    restarts.append((last_pose, t))
            if log.valid[k]:
                last_pose = t
            estimate = ukf.estimate
            state[k] = estimate.state[:19]
            deviation[k] = np.sqrt(np.diagonal(estimate.covariance)[12:18])
    state[:first], deviation[:first] = state[first], deviation[first]
    if not (np.isfinite(state).all() and np.isfinite(deviation).all()):
        bad = int(np.flatnonzero(~np.isfinite(np.column_stack([state, deviation])).all(axis=1))[0])
        raise InputError(
            f"{log.source or log.name}: the estimate overflows at t = {log.t[bad]:.6g} s; expected "
            f"rotor speeds and poses that {vehicle.name} can fly"
        )
    return WrenchSeries(
        t=log.t,
        force=state[:, 16:19],
        torque=state[:, 13:16],
        std_force=deviation[:, 3:6],
        std_torque=deviation[:, 0:3],
        nis=nis,
        position=state[:, 0:3],
        quaternion=state[:, 3:7],
        velocity=state[:, 7:10],
        angular_velocity=state[:, 10:13],
        vehicle=vehicle,
        notes=(*log.notes, *doubts, *_restart_notes(restarts)),
    )


def _restart_notes(restarts: list[tuple[float, float]]) -> tuple[str, ...]:
    """Return one note on all gaps (s) after which the filter restarted."""
    if not restarts:
        return ()
    begin, end = max(restarts, key=lambda gap: gap[1] - gap[0])
    often = "" if len(restarts) == 1 else f" ({len(restarts)} such gaps, this is the longest)"
    return (f"no pose from t = {begin:.6g} s to {end:.6g} s: the filter restarts there{often}",)


def _predict(ukf: WrenchUKF, log: FlightLog, k: int, period: float) -> None:
    """Carry the filter from row ``k - 1`` to row ``k`` in equal steps of at most one period."""
    dt = float(log.t[k] - log.t[k - 1])
    speeds = 0.5 * (log.rotor_speeds[k - 1] + log.rotor_speeds[k])
    voltage = None if log.voltage is None else 0.5 * float(log.voltage[k - 1] + log.voltage[k])
    steps = max(1, math.ceil(dt / period - _SLACK))
    for _ in range(steps):
        ukf.predict(speeds, dt / steps, voltage)


def _take_in_imu(ukf: WrenchUKF, log: FlightLog, k: int) -> None:
    """Correct with what gyro and accelerometer measured in row ``k``, if they did."""
    gyro, accelerometer = (
        None if sensor is None or not np.isfinite(sensor[k, 0]) else sensor[k]
        for sensor in (log.gyro, log.accelerometer)
    )
    if gyro is not None or accelerometer is not None:
        ukf.correct_imu(gyro, accelerometer)


def write_wrench(series: WrenchSeries, out_dir: str | Path) -> Path:
    """Write ``wrench.csv`` (t, force, torque, their standard deviations, nis) into a folder and
    return its path.

    Raises:
        InputError: the file cannot be written.
    """
    columns = {"t": series.t}
    for prefix, force, torque in (
        ("", series.force, series.torque),
        ("std_", series.std_force, series.std_torque),
    ):
        columns |= {f"{prefix}f{axis}": force[:, i] for i, axis in enumerate("xyz")}
        columns |= {f"{prefix}t{axis}": torque[:, i] for i, axis in enumerate("xyz")}
    columns["nis"] = series.nis
    path = Path(out_dir) / "wrench.csv"
    write_csv(columns, path)
    return path


def truth_rmse(series: WrenchSeries, log: FlightLog) -> tuple[Array, Array] | None:
    """Return the RMSE (3,) of force in N and (3,) of torque in Nm against the log's truth, or None
    without one.
    """
    if log.force is None or log.torque is None:
        return None
    return (
        np.sqrt(np.mean(np.square(series.force - log.force), axis=0)),
        np.sqrt(np.mean(np.square(series.torque - log.torque), axis=0)),
    )
