"""The external wrench over a flight log: the wrench filter run from its first row to its last."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from itertools import chain
from pathlib import Path
from typing import TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from ..dynamics.vehicle import Vehicle
from ..estimator import (
    NoiseFit,
    NoiseFitSettings,
    RecordingUKF,
    UKFTuning,
    WrenchEstimate,
    WrenchUKF,
    fit_noise,
)
from ..estimator.consistency import Consistency
from ..estimator.estimate import (
    COASTING,
    MODEL,
    NIS,
    REJECTED,
    STATUS,
    STATUSES,
    TORQUE,
    WITHOUT_COVARIANCE,
)
from ..estimator.model_uncertainty import LOAD, NAMES, factors_alone, variances_along
from ..estimator.noise_fit import consistency_of
from ..estimator.row_steps import steps_between
from ..estimator.sample import Sample, convert
from ..estimator.ukf import CALL, IMU_PARTS, make_calls
from ..runtime.errors import InputError
from ..runtime.threads import one_thread
from .inertial_wrench import inertial_wrench
from .logs.flight_log import FORCE_HZ, TORQUE_HZ, FlightLog, between_samples, serves
from .logs.screening import screen_log
from .logs.table import Array, Names, Rows, finite_rows
from .logs.tables import write_csv
from .motion.inertial_signals import reads_imu
from .motion.smoothing import mean_square

T = TypeVar("T")

# probability beyond which a jump of a pose is checked: for one good pose in 10,000, at 200 Hz every
# 50 s; the pose is refused only if it also lies away from the pose before
GATE = 0.9999
# columns of wrench.csv, here and of a stream
COLUMNS = (
    "t",
    *(f"{kind}{axis}" for kind in ("f", "t", "std_f", "std_t") for axis in "xyz"),
    "nis",
    "status",
)
_REPORTED = 10_000  # rows between two reports of progress


class WrenchSeries(WrenchEstimate):
    """The estimate at every row (N,) of a log.

    Standard deviations include the noise, the vehicle's stated uncertainty, and seldom measured
    rotors. With too few measurements of these, torque is NaN. NIS, status and restarts are the
    filter's, smoothed or not; NIS is NaN without a pose to compare with.

    Attributes:
        t: (N,) s.
        vehicle: as declared to the filter.
        tuning: of the filter.
        notes: sentences for the user.
        loads: (N, 7, 3) scaled by the vehicle's uncertainty, as the filter followed them.
    """

    def __init__(
        self,
        estimate: WrenchEstimate,
        t: Array,
        vehicle: Vehicle,
        tuning: UKFTuning,
        notes: Names,
        loads: Array,
    ) -> None:
        super().__init__(estimate.numbers, estimate.std)
        self.t, self.vehicle, self.tuning, self.notes = t, vehicle, tuning, notes
        self.loads = loads


@one_thread()
def estimate_log(
    log: FlightLog,
    vehicle: Vehicle,
    tuning: UKFTuning | None = None,
    report: Callable[[float], None] | None = None,
    smooth: bool = False,
    gate: float | None = GATE,
) -> WrenchSeries:
    """Estimate the external force and torque at every row of a log.

    The filter starts at the first pose. Each row's prediction uses the mean of its rotor speeds and
    the row's before, in steps of at most one median period. A row without a pose is prediction
    alone, corrected by its readings of gyro and accelerometer. A log without a pose, or with one
    too slow for the motion, is smoothed from its gyro and accelerometer. Poses that jump are
    refused; after gaps and lasting jumps the filter restarts (``estimator.recovery``). Rows before
    the first pose hold the filter's estimate at this pose: no wrench, and its standard deviation.

    Args:
        log: the flight.
        vehicle: the declared vehicle; the wrench is the part of the motion not explained by it and
            its declared effects.
        tuning: default ``UKFTuning.for_vehicle(vehicle, log.period)``.
        report: called now and then with the finished share.
        smooth: whether each row's estimate also uses the rows after it (``estimator.smoother``):
            the best one of a whole log. Default: the rows before alone, like a filter on the
            vehicle. ``nis`` is the filter's either way, and nothing is smoothed across a restart.
            Gyro and accelerometer are smoothed with the poses (``inertial_wrench``) if the log has
            both.
        gate: probability; poses with a NIS beyond it and a jump from the pose before are refused.
            None: none are, and each jump restarts the filter.

    Raises:
        InputError: the log has no pose at all, has other units or conventions than declared
            (``screen_log``), or its rotor speeds make the filter's numbers overflow.
    """
    log, doubts = screen_log(log, vehicle, None)
    if log.commanded:
        vehicle = replace(vehicle, omega_source="commanded")
    tuning = tuning or UKFTuning.for_vehicle(vehicle, log.period)
    if reads_imu(log) or (smooth and log.gyro is not None and log.accelerometer is not None):
        estimate, loads, notes = inertial_wrench(log, vehicle, tuning)
    else:
        ukf = (RecordingUKF if smooth else WrenchUKF)(vehicle, tuning, log.period, gate)
        estimate, loads = _filtered(log, ukf, report)
        notes = tuple(_notes(log, estimate, smooth))
    notes = (*log.notes, *doubts, *notes, *_slow_motors(log, vehicle, estimate))
    return WrenchSeries(estimate, log.t, vehicle, tuning, notes, loads)


def _filtered(
    log: FlightLog, ukf: WrenchUKF, report: Callable[[float], None] | None = None
) -> tuple[WrenchEstimate, Array]:
    """Return a filter's estimate of a screened log (``screen_log``), smoothed by a recording
    filter, and the loads (N, 7, 3).
    """
    first, count = np.argmax(log.valid), len(log.t)
    numbers, std = np.empty((count, WITHOUT_COVARIANCE)), np.empty((count, 18))
    loads = np.zeros((count, *LOAD))
    events = np.zeros(count, dtype=np.int64)  # last event of each row, of a recording filter
    ukf.reset(log.position[first], log.quaternion[first])
    numbers[: first + 1] = ukf.estimate.numbers[:WITHOUT_COVARIANCE]
    std[: first + 1] = ukf.estimate.std
    for begin in range(first + 1, count, _REPORTED):
        if report is not None:
            report(begin / count)
        rows = np.arange(begin, min(begin + _REPORTED, count))
        calls, to = calls_of(log, rows, ukf, not isinstance(ukf, RecordingUKF))
        made = make_calls(ukf.record, calls, to, numbers, std, loads)
        if made < len(calls):
            raise Sample(calls["z"][made]).bad_quaternion()
        if isinstance(ukf, RecordingUKF):
            events[to] = ukf.keep(calls)
    broken = ~finite_rows(np.column_stack([numbers[:, :NIS], std]))
    if broken.any():
        raise InputError(
            f"{log.source or log.name}: the estimate overflows at t = {log.t[broken][0]:.6g} s; "
            f"expected rotor speeds and poses that {ukf.vehicle.name} can fly"
        )
    estimate = ukf.smooth(events) if isinstance(ukf, RecordingUKF) else WrenchEstimate(numbers, std)
    estimate.numbers[~log.valid, NIS] = np.nan
    estimate.numbers[:first, STATUS] = COASTING
    return estimate, loads


def _slow_motors(log: FlightLog, vehicle: Vehicle, estimate: WrenchEstimate) -> Names:
    """Take the torque out of an estimate with seldom measured rotors, and widen the force with even
    fewer measurements; return the notes on both.
    """
    rate = log.motor_rate
    if serves(rate, TORQUE_HZ):
        return ()
    estimate.numbers[:, TORQUE] = np.nan
    estimate.numbers[:, MODEL][:, :3] = np.nan
    said = f"{'motor commands' if log.commanded else 'rotor speeds'} come {rate:.3g} times a second"
    if serves(rate, FORCE_HZ):
        return (f"warning: {said}: no torque is estimated. It takes {TORQUE_HZ:g}",)
    slopes = 2.0 * log.rotor_speeds * vehicle.k  # of thrust, N/(rad/s)
    std = np.linalg.norm(slopes * between_samples(log.t, log.rotor_speeds, rate), axis=1)
    up = Rotation.from_quat(estimate.quaternion, scalar_first=True).apply([0.0, 0.0, 1.0])
    estimate.numbers[:, MODEL][:, 3:] += np.square(up * std[:, None])
    return (
        f"warning: {said}: no torque is estimated, and what the thrust does between them, "
        f"{np.sqrt(np.mean(np.square(std))):.2g} N, is in the force's deviation. A force takes "
        f"{FORCE_HZ:g} a second, a torque {TORQUE_HZ:g}",
    )


def pose_notes(log: FlightLog, vehicle: Vehicle) -> Names:
    """Return the notes of ``estimate_log`` on a screened log's poses: jumps, and restarts of the
    filter. They are for other results of the same log; none if its motion is read from an IMU.

    Raises:
        InputError: rotor speeds make the filter's numbers overflow.
    """
    if reads_imu(log):
        return ()
    if log.commanded:
        vehicle = replace(vehicle, omega_source="commanded")
    return tuple(_notes(log, _filtered(log, WrenchUKF(vehicle, None, log.period, GATE))[0], False))


def counts(series: WrenchSeries) -> dict[str, int]:
    """Return the number of rows of each status: tracking, coasting, rejected, restarted."""
    return {name: int(np.sum(series.status_code == i)) for i, name in enumerate(STATUSES)}


def uncertainty_note(series: WrenchSeries) -> str:
    """Return the accuracy of force and torque in words, with the largest part of it."""
    force = f"Standard deviation per axis: force {_largest_part(series, slice(3, 6), 'N')}"
    if not np.isfinite(series.std_torque).any():
        return force
    return f"{force}, torque {_largest_part(series, slice(3), 'Nm')}"


def _largest_part(series: WrenchSeries, axes: slice, unit: str) -> str:
    """Return the deviation of three ``axes`` of torque and force in words."""
    parts = {
        f"{NAMES[name]}, +-{100.0 * getattr(series.vehicle.uncertainty, name):.3g} %"
        f"{' between days' if name == 'command' else ''}": np.mean(
            variances_along(factors, series.loads)[:, axes]
        )
        for name, factors in factors_alone(series.vehicle).items()
    }
    parts["noise"] = np.mean(np.square(series.std[:, 12:][:, axes]))
    total = np.mean(np.square(series.std_wrench[:, axes]))
    parts["the rotors between samples"] = total - sum(parts.values())
    name = max(parts, key=parts.__getitem__)
    return f"{1e3 * np.sqrt(total):.3g} m{unit} (mostly {name})"


def _notes(log: FlightLog, estimate: WrenchEstimate, smooth: bool) -> Iterator[str]:
    """Yield the fate of measurements that were not simply taken in."""
    refused = np.flatnonzero(estimate.status_code == REJECTED)
    restarts = np.repeat(log.t[1:], np.diff(estimate.restarts))  # s
    if refused.size:
        yield (
            f"{refused.size} of {log.valid.sum()} poses jump from those before and were "
            f"refused, the first at t = {log.t[refused[0]]:.6g} s"
        )
    if restarts.size:
        often = f", {len(restarts)} times in all" if len(restarts) > 1 else ""
        yield (
            f"the filter restarted at t = {restarts[0]:.6g} s{often}: after a gap in the poses, or "
            "where they went on from elsewhere; there the wrench is uncertain for a while"
        )
    if smooth and (log.gyro is not None or log.accelerometer is not None):
        yield ("the log has one of gyro and accelerometer only: the poses were smoothed without it")


def tune_to_log(
    log: FlightLog, vehicle: Vehicle, tuning: UKFTuning | None = None, gusts: bool = False
) -> NoiseFit:
    """Return the fitted tuning of a log, beside the given one, by default
    ``UKFTuning.for_vehicle(vehicle, log.period)``; ``gusts``: with correlation times of force and
    torque. See ``estimator.noise_fit``.

    Raises:
        InputError: the log does not suit a wrench estimate (``screen_log``), has too few poses for
            a tuning, or has a filtered pose that hides both its noise and a walk.
    """
    fit = _of_poses(
        partial(fit_noise, settings=NoiseFitSettings(gusts=gusts)), log, vehicle, tuning
    )
    on_bound = np.isnan(fit.deviation)
    if on_bound[:4].any() and on_bound[6:8].any():
        raise InputError(
            f"{log.source or log.name}: neither the noise of its pose nor the walk of its wrench "
            "can be fitted: the pose was filtered before it was written"
        )
    return fit


def consistency_with_log(
    log: FlightLog, vehicle: Vehicle, tuning: UKFTuning | None = None
) -> Consistency:
    """Return the consistency of a tuning with a log's innovations, without a fit; otherwise as
    ``tune_to_log``.
    """
    return _of_poses(consistency_of, log, vehicle, tuning)


def _of_poses(
    judge: Callable[..., T], log: FlightLog, vehicle: Vehicle, tuning: UKFTuning | None
) -> T:
    """Return the judgement of a tuning by the columns of a log."""
    log, _ = screen_log(log, vehicle, None)
    position = np.where(log.valid[:, None], log.position, np.nan)
    try:
        if reads_imu(log):
            raise InputError(
                "has no pose, or one that is too slow, to fit a tuning to; expected 50 poses a "
                "second"
            )
        return judge(
            vehicle, log.t, log.rotor_speeds, position, log.quaternion, log.voltage, tuning
        )
    except InputError as error:
        raise InputError(f"{log.source or log.name}: {error}") from error


def calls_of(log: FlightLog, rows: Rows, ukf: WrenchUKF, with_imu: bool) -> tuple[np.ndarray, Rows]:
    """Return a filter's calls for some rows: each row from the row before in equal steps of at most
    one period, and a correction by its measurements; and the row of each call.
    """
    parted = cache(steps_between)  # few time steps differ
    steps = [parted(dt, ukf.period) for dt in (log.t[rows] - log.t[rows - 1]).tolist()]
    sensors = [log.gyro, log.accelerometer] if with_imu else [None, None]
    felt = [np.full((len(rows), 3), np.nan) if x is None else x[rows] for x in sensors]
    read = np.transpose([finite_rows(x) for x in felt]) @ IMU_PARTS
    carried, posed = np.repeat(rows, list(map(len, steps))), rows[log.valid[rows]]
    to = np.concatenate([carried, rows[read > 0], posed])
    calls = np.zeros(len(to), dtype=CALL)
    speeds = 0.5 * (log.rotor_speeds[to - 1] + log.rotor_speeds[to])
    convert(calls["z"], speeds, log.position[to], log.quaternion[to])
    imu = slice(len(carried), len(to) - len(posed))
    calls["z"][imu, :6] = np.nan_to_num(np.hstack(felt)[read > 0])
    calls["parts"][imu], calls["parts"][imu.stop :] = read[read > 0], 3
    calls["dt"][: imu.start] = [*chain.from_iterable(steps)]
    calls["voltage"] = ukf.vehicle.voltage_ref
    if log.voltage is not None:
        calls["voltage"] = 0.5 * (log.voltage[to - 1] + log.voltage[to])
    order = np.argsort(to, kind="stable")
    return calls[order], to[order]


def write_wrench(series: WrenchSeries, path: Path) -> None:
    """Write a CSV file: t, force, torque, their standard deviations, nis, and status (0 tracking, 1
    coasting, 2 rejected, 3 restarted).

    Raises:
        InputError: the file cannot be written.
    """
    values = np.column_stack(
        [
            series.t,
            series.force,
            series.torque,
            series.std_force,
            series.std_torque,
            series.nis,
            series.status_code,
        ]
    )
    write_csv(dict(zip(COLUMNS, values.T, strict=True)), path)


def truth_rmse(series: WrenchSeries, log: FlightLog) -> Array | None:
    """Return the RMSE (2, 3) of force in N and of torque in Nm against the log's truth, or None
    without one.
    """
    if log.force is None or log.torque is None:
        return None
    errors = series.force - log.force, series.torque - log.torque
    return np.sqrt(mean_square(np.stack(errors, axis=1)))
