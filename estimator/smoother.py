"""The fixed-interval smoother: the wrench at every time from all of a log, before and after it.

The filter runs forwards; ``rauch_tung_striebel`` says how one goes back. A step's link needs 8 kB,
so only a block of steps is in memory at a time: the filter's memory is kept at the start of each
block, and the block is run again, to the same bits, on the way back.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..dynamics.vehicle import Vehicle
from ..runtime.compiled import compiled
from ..runtime.errors import InputError
from .estimate import (
    FORCE,
    NIS,
    POSITION,
    QUATERNION,
    RATE,
    STATE_SIZE,
    TORQUE,
    VELOCITY,
    Array,
    WrenchEstimate,
)
from .filter_record import N
from .rauch_tung_striebel import LINK, WORK, step_back, step_with_link
from .recovery import Recovery
from .tuning import UKFTuning
from .ukf import WrenchUKF, step

_BLOCK = 1024  # steps in memory at a time: 10 MB
_SLACK = 0.1  # of a period: a step so little too long is still one step


@dataclass(frozen=True, eq=False)
class SmoothedSeries:
    """The smoothed estimate at M times. Standard deviations are the smoother's own.

    Attributes:
        state: (M, 20), laid out by the constants of ``estimator.estimate``.
        std: (M, 18) of the error state (rho, omega, x, v, torque, force)
        covariance: (M, 18, 18) of the same, where it was asked for.
    """

    state: Array
    std: Array
    covariance: Array | None = None

    def __repr__(self) -> str:
        return f"<{type(self).__name__} at {len(self.state)} times>"

    @property
    def position(self) -> Array:
        """Position (M, 3) of the geometric centre, m, world."""
        return self.state[:, POSITION]

    @property
    def quaternion(self) -> Array:
        """Attitude (M, 4), body to world, scalar first."""
        return self.state[:, QUATERNION]

    @property
    def velocity(self) -> Array:
        """Velocity (M, 3), m/s, world."""
        return self.state[:, VELOCITY]

    @property
    def angular_velocity(self) -> Array:
        """Angular velocity (M, 3), rad/s, body."""
        return self.state[:, RATE]

    @property
    def torque(self) -> Array:
        """External torque (M, 3) about the centre of mass, Nm, world."""
        return self.state[:, TORQUE]

    @property
    def force(self) -> Array:
        """External force (M, 3), N, world."""
        return self.state[:, FORCE]

    @property
    def std_torque(self) -> Array:
        """Standard deviation (M, 3) of the torque, Nm."""
        return self.std[:, 12:15]

    @property
    def std_force(self) -> Array:
        """Standard deviation (M, 3) of the force, N."""
        return self.std[:, 15:18]

    @property
    def nis(self) -> Array:
        """NIS (M,) of the filter's pass forwards; NaN where nothing was measured."""
        return self.state[:, NIS]

    def __len__(self) -> int:
        """Return the number of times."""
        return len(self.state)

    def estimate(self, i: int) -> WrenchEstimate:
        """Return the estimate at time number ``i``.

        Raises:
            InputError: the covariance was not asked for.
        """
        if self.covariance is None:
            raise InputError("SmoothedSeries: no covariance here; call smooth(covariance=True)")
        return WrenchEstimate(np.concatenate([self.state[i], self.covariance[i].ravel()]))


@dataclass(eq=False)
class FilterInputs:
    """All that a filter was given, call by call, so that it can be run again: E events.

    An event that is a start puts ``starts[e]``, the memory of a filter that was just reset, in the
    place of the filter's own; its inputs mean nothing. No smoothing crosses it. Any other event is
    a call of ``ukf.step``: a prediction over ``dt`` where that is positive, then a correction by
    ``parts`` of a pose.
    """

    z: NDArray[np.float64]  # (E, 11) rotor speeds, position, quaternion
    parts: NDArray[np.int64]  # (E,) 1 position, 2 attitude, 3 both, 0 neither
    dt: Array  # (E,) s
    voltage: Array  # (E,) V
    starts: dict[int, np.ndarray] = field(default_factory=dict)  # event: record (1,)

    def smooth(self, at: ArrayLike | None = None, covariance: bool = False) -> SmoothedSeries:
        """Return the smoothed estimate after each event, or after the events ``at`` (M,).

        Args:
            at: numbers of events, in any order, also several times; default: all.
            covariance: whether the whole covariances (18, 18) are wanted.

        Raises:
            InputError: the first event is no start, or a number stops being finite.
        """
        events = len(self.z)
        wanted = np.arange(events) if at is None else np.asarray(at, dtype=np.int64)
        begins = sorted(self.starts)
        if not begins or begins[0] != 0:
            raise InputError("FilterInputs: the first event must be a start of the filter")
        states, std = np.empty((events, STATE_SIZE)), np.empty((events, N))
        full = np.empty((events if covariance else 0, N, N))
        for begin, end in zip(begins, [*begins[1:], events], strict=True):
            self._smooth_segment(begin, end, states, std, full)
        bad = ~np.isfinite(states[:, :NIS]).all(axis=1) | ~np.isfinite(std).all(axis=1)
        if bad.any():
            raise InputError(
                f"smooth: the estimate stops being finite at step {int(np.flatnonzero(bad)[0])}; "
                "expected rotor speeds and poses that the vehicle can fly"
            )
        return SmoothedSeries(states[wanted], std[wanted], full[wanted] if covariance else None)

    def _smooth_segment(self, begin: int, end: int, states: Array, std: Array, full: Array) -> None:
        """Smooth the events from a start to before the next one into the arrays of all."""
        record = self.starts[begin].copy()
        z, parts, dt, voltage = self.z, self.parts, self.dt, self.voltage
        blocks = []
        for first in range(begin + 1, end, _BLOCK):
            last = min(first + _BLOCK, end)
            blocks.append((first, last, record.copy()))
            here = slice(first, last)
            _forward(record, z[here], parts[here], dt[here], voltage[here])
        x, P, work = record["x"][0].copy(), record["P"][0].copy(), np.empty(WORK)
        links = np.zeros(1 + min(_BLOCK, end - begin), dtype=LINK)
        for first, last, memory in reversed(blocks):
            links["x"][0] = memory["x"][0]
            here = slice(first, last)
            _forward_with_links(memory, z[here], parts[here], dt[here], voltage[here], links, work)
            _backward(links, x, P, work, states[here], std[here], full[here])
        _write(x, P, states, std, full, begin)


@compiled
def _forward(
    record: np.ndarray, z: Array, parts: NDArray[np.int64], dt: Array, voltage: Array
) -> None:
    f = record[0]
    for k in range(len(z)):
        f.z[:] = z[k]  # a step brings its quaternion to length 1 in place
        step(f, f.z, parts[k], dt[k], voltage[k])


@compiled
def _forward_with_links(
    record: np.ndarray,
    z: Array,
    parts: NDArray[np.int64],
    dt: Array,
    voltage: Array,
    links: np.ndarray,
    work: Array,
) -> None:
    f = record[0]
    for k in range(len(z)):
        f.z[:] = z[k]
        step_with_link(f, f.z, parts[k], dt[k], voltage[k], links[1 + k], work)


@compiled
def _write(x: Array, P: Array, states: Array, std: Array, full: Array, k: int) -> None:
    for i in range(STATE_SIZE):
        states[k, i] = x[i]
    for i in range(N):
        std[k, i] = math.sqrt(P[i, i])
    if len(full) > 0:
        for i in range(N):
            for j in range(N):
                full[k, i, j] = P[i, j]


@compiled
def _backward(
    links: np.ndarray,
    x: Array,
    P: Array,
    work: Array,
    states: Array,
    std: Array,
    full: Array,
) -> None:
    """Write the smoothed estimates of a block, from the last, which is ``x`` and ``P``; leave in
    these the one before the block, whose link is the first.
    """
    for k in range(len(states) - 1, -1, -1):
        _write(x, P, states, std, full, k)
        step_back(x, P, links[k + 1], links[k].x, work)


class RecordingUKF(WrenchUKF):
    """A ``WrenchUKF`` that keeps what it is given, for the smoother. About 0.1 kB a call.

    ``events`` counts what was kept; after a call, its estimate is that of event ``events - 1``.
    Inertial measurements are not kept and therefore refused.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        tuning: UKFTuning | None = None,
        period: float = 0.005,
        gate: float | None = None,
        recovery: Recovery | None = None,
    ) -> None:
        super().__init__(vehicle, tuning, period, gate, recovery)
        self._kept: list[tuple[bytes, int, float, float]] = []
        self._starts: dict[int, np.ndarray] = {}

    @property
    def events(self) -> int:
        """How many calls were kept."""
        return len(self._kept)

    def reset(
        self,
        position: ArrayLike,
        quaternion: ArrayLike,
        covariance: ArrayLike | None = None,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        """Start at a pose as ``WrenchUKF`` does; no smoothing crosses it."""
        super().reset(position, quaternion, covariance, velocity, angular_velocity)
        self._starts[len(self._kept)] = self.record.copy()
        self._kept.append((bytes(88), 0, 0.0, 0.0))

    def _run(self, parts: int, dt: float, voltage: float | None) -> WrenchEstimate:
        z = self._sample.z.tobytes()
        estimate = super()._run(parts, dt, voltage)
        self._kept.append((z, parts, dt, self._voltage if voltage is None else voltage))
        return estimate

    def correct_imu(
        self, gyro: ArrayLike | None = None, accelerometer: ArrayLike | None = None
    ) -> WrenchEstimate:
        """Refuse: the smoother knows poses only."""
        raise InputError("RecordingUKF: the smoother takes no inertial measurements")

    def smooth(self, at: ArrayLike | None = None, covariance: bool = False) -> SmoothedSeries:
        """Return what ``FilterInputs.smooth`` does, of all calls up to now."""
        z, parts, dt, voltage = zip(*self._kept, strict=True) if self._kept else ((), (), (), ())
        return FilterInputs(
            np.frombuffer(b"".join(z)).reshape(-1, 11).copy(),
            np.array(parts, dtype=np.int64),
            np.array(dt, dtype=np.float64),
            np.array(voltage, dtype=np.float64),
            self._starts,
        ).smooth(at, covariance)


def smooth(
    vehicle: Vehicle,
    tuning: UKFTuning | None,
    t: ArrayLike,
    rotor_speeds: ArrayLike,
    position: ArrayLike,
    quaternion: ArrayLike,
    voltage: ArrayLike | None = None,
    gate: float | None = None,
    restarted: ArrayLike | None = None,
    covariance: bool = False,
) -> SmoothedSeries:
    """Return the smoothed pose, twist and wrench at the times of a log.

    The filter starts at the first whole pose and runs as over a log: each row's prediction uses
    the mean of its rotor speeds and those of the row before, in equal steps of at most one median
    period. Rows before the first whole pose hold the estimate there.

    Args:
        vehicle: the declared vehicle with its effects.
        tuning: default ``UKFTuning.for_vehicle(vehicle, period)`` at the median period.
        t: (M,) s, strictly increasing.
        rotor_speeds: (M, 4) rad/s.
        position: (M, 3) m, world; a row that is not finite was not measured.
        quaternion: (M, 4) body to world, scalar first; likewise.
        voltage: (M,) V; default ``voltage_ref``.
        gate: as of ``WrenchUKF``; what it refuses counts as not measured for the smoother too.
        restarted: (M,) rows at whose pose the filter starts anew; nothing is smoothed across one.
        covariance: whether the whole covariances (M, 18, 18) are wanted.

    Raises:
        InputError: a shape is wrong, times do not increase, no row has a whole pose or one with
            ``restarted`` has none, a quaternion's length is not 1, or a number stops being finite.
    """
    times, speeds, x, q = (
        np.array(value, dtype=np.float64) for value in (t, rotor_speeds, position, quaternion)
    )
    count = len(times) if times.ndim == 1 else 0
    for name, array, width in (
        ("rotor_speeds", speeds, 4),
        ("position", x, 3),
        ("quaternion", q, 4),
    ):
        if count < 2 or array.shape != (count, width):
            raise InputError(
                f"smooth: expected t (M,) with M of at least 2 and {name} (M, {width}), got shapes "
                f"{times.shape} and {array.shape}"
            )
    gaps = np.diff(times)
    if not np.all(gaps > 0):
        raise InputError("smooth: t must be finite and strictly increase")
    seen = np.isfinite(np.column_stack([x.sum(axis=1), q.sum(axis=1)])) @ np.array([1, 2])
    length = np.linalg.norm(q, axis=1)
    bad = np.flatnonzero((seen >= 2) & ~((length > 0.9) & (length < 1.1)))
    if bad.size:
        raise InputError(
            f"smooth: quaternions must have length 1, got {length[bad[0]]:g} in row {bad[0]}"
        )
    whole = np.flatnonzero(seen == 3)
    flags = (
        np.zeros(count, dtype=np.bool_)
        if restarted is None
        else np.array(restarted, dtype=np.bool_)
    )
    if not whole.size or flags.shape != (count,) or np.any(seen[flags] != 3):
        raise InputError(
            "smooth: expected at least one row with a position and a quaternion, and restarted "
            f"(M,) true at such rows only, got {whole.size} and shape {flags.shape}"
        )
    first = int(whole[0])
    flags[first] = True
    period = float(np.median(gaps))
    ukf = WrenchUKF(vehicle, tuning, period, gate)
    volts = (
        np.full(count, vehicle.voltage_ref)
        if voltage is None
        else np.array(voltage, dtype=np.float64)
    )
    if volts.shape != (count,):
        raise InputError(f"smooth: expected voltage (M,), got shape {volts.shape}")

    # events: one for a start, else as many steps as the row needs, the last of which has its pose
    steps = np.ones(count, dtype=np.int64)
    steps[1:] = np.maximum(1, np.ceil(gaps / period - _SLACK))
    steps[flags] = 1
    rows = np.arange(first, count)
    steps = steps[rows]
    ends = np.cumsum(steps) - 1
    row = np.repeat(rows, steps)
    z = np.full((len(row), 11), np.nan)
    before = np.maximum(row - 1, 0)
    z[:, :4] = 0.5 * (speeds[before] + speeds[row])
    z[ends, 4:7], z[ends, 7:] = x[rows], q[rows]
    parts = np.zeros(len(row), dtype=np.int64)
    parts[ends] = seen[rows]
    dt = (times[row] - times[before]) / np.repeat(steps, steps)
    starts = {}
    for k in np.flatnonzero(flags[first:]):
        ukf.reset(x[first + k], q[first + k])
        starts[int(ends[k])] = ukf.record.copy()
    inputs = FilterInputs(z, parts, dt, 0.5 * (volts[before] + volts[row]), starts)
    at = np.concatenate([np.zeros(first, dtype=np.int64), ends])
    return inputs.smooth(at, covariance)
