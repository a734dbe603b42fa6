"""What a vehicle's model, with the effects that it declares, predicts of a logged flight, and how
well: in metres and as NIS.

All three run the model of plant and filter. ``predict`` and ``rollout_error`` give what a planner
would see: the model is let go from the flight's own state, and compared with the flight a second
later. ``nis_without_wrench_state`` is what a filter would see that has nothing but the model to
explain the motion with.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..dynamics.model import MODEL_FIELDS, apply_effects, drive, load_model
from ..dynamics.motion import accelerations
from ..dynamics.rotation import turn_body
from ..dynamics.vehicle import Vehicle
from ..estimator import UKFTuning
from ..estimator.estimate import STATE_SIZE
from ..estimator.filter_record import propagate
from ..estimator.innovations import innovations, pieces_of
from ..estimator.ukf import default_covariance
from ..runtime.compiled import Record, compiled
from ..runtime.errors import InputError
from .logs.commanded_speeds import with_commanded_speeds
from .logs.flight_log import FlightLog
from .motion.sensing_effects import undo_log_sensing
from .motion.signals import Signals, log_signals
from .motion.smoothing import CUTOFFS, continuous, low_pass

Array = NDArray[np.float64]
Segments = Sequence[tuple[float, float]]


@dataclass(frozen=True)
class PredictionSettings:
    """How a model is flown from a logged state, and how the filter without a wrench is set up."""

    longest_rotor_step: float = 0.005  # s, over which rotors are held
    # of the motion in one of those: one step alone, at its zero-order hold, adds 5 mm in a second
    motion_steps: int = 4
    # s at an end of unbroken pose, where a low-pass has but one side to go by
    start_margin: float = 0.5
    end_margin: float = 0.1  # s, the same for the position that a prediction is compared with
    horizon: float = 1.0  # s, of ``rollout_error``
    start_every: float = 0.25  # s, of an error's predictions
    most_starts: int = 2000  # of an error's predictions in a piece, spread over it
    longest_gap: float = 2.0  # s without a pose, after which the filter starts anew (estimate_log)
    step_tolerance: float = 0.1  # of a period: a step so little too long is still one step
    # of its usual standard deviation: a wrench state that cannot move
    frozen_wrench_factor: float = 1e-6


PREDICTION = PredictionSettings()
# compiled code takes plain numbers
_MOTION_STEPS, _STEP_TOLERANCE = PREDICTION.motion_steps, PREDICTION.step_tolerance


_MODEL = np.dtype([*MODEL_FIELDS, ("acceleration", "f8", (6,)), ("rotation", "f8", (3, 3))])


@dataclass(frozen=True, eq=False)
class Prediction:
    """The motion that a model predicts from each of n starts, over m steps of ``period``."""

    start: NDArray[np.intp]  # (n,) rows of the log
    period: float  # s
    position: Array  # (n, m, 3) m, world; the first is a period after the start
    velocity: Array  # (n, m, 3) m/s, world
    quaternion: Array  # (n, m, 4) body to world
    angular_velocity: Array  # (n, m, 3) rad/s, body


def predict(log: FlightLog, vehicle: Vehicle, horizon_s: float = 0.5, every: int = 1) -> Prediction:
    """Predict a flight from its own states by a vehicle's model and the logged rotor speeds alone.

    The model starts from the flight's position, velocity, attitude and angular velocity, and from
    then on is given the logged rotor speeds and voltage; a rotor speed holds over the interval that
    ends at its sample. Rotors and effects start with the memory that the flight before gave them.
    Declared sensing effects are taken out of the log.

    What limits a prediction is its start: 1 mrad of tilt is 5 mm after a second, 10 mrad/s of
    angular velocity is 16 mm. See ``start_states``.

    Args:
        log: the flight.
        vehicle: whose model predicts, with its declared effects.
        horizon_s: s.
        every: samples from start to start. Starts without a whole horizon behind them, before the
            next break of the pose, are left out.

    Raises:
        InputError: no stretch of pose is unbroken for 3 s, or the vehicle has more effects than a
            model holds.
    """
    log = undo_log_sensing(log, vehicle)
    starts, paths = [], []
    for piece in log_signals(log):
        ahead = max(1, round(horizon_s / piece.period))
        begun = np.arange(0, len(piece.t) - ahead, every)
        _, path = _rolled_out(piece, vehicle, begun, ahead, float(log.t[0]))
        rows = np.interp(piece.t[begun], log.t, np.arange(len(log.t)))
        starts.append(np.rint(rows).astype(np.intp))
        paths.append(path)
    x = np.concatenate(paths)
    return Prediction(
        np.concatenate(starts), piece.period, x[..., :3], x[..., 7:10], x[..., 3:7], x[..., 10:13]
    )


def rollout_error(log: FlightLog, vehicle: Vehicle, segments: Segments) -> float:
    """Return the RMS distance (m) between flight and model after a second of prediction, as
    ``predict`` makes them.

    Args:
        log: the flight.
        vehicle: whose model predicts, with its declared effects.
        segments: times (s) from and to; a prediction counts if it lies in one of them from its
            start to its end.

    Returns:
        NaN where no segment holds an unbroken stretch of pose that is long enough.

    Raises:
        InputError: the vehicle has more effects than a model holds.
    """
    try:
        parts = list(_predictions(log, vehicle, segments, PREDICTION.horizon))
    except InputError:
        return math.nan
    off = [path[:, -1, :3] - states[rows[:, -1], :3] for _, states, rows, path in parts]
    squares = [np.sum(np.square(x), axis=1) for x in off]
    return math.sqrt(float(np.mean(np.concatenate(squares)))) if squares else math.nan


QUANTITIES = {"position": "m", "velocity": "m/s", "attitude": "rad", "body rate": "rad/s"}


@dataclass(frozen=True, eq=False)
class PredictionErrors:
    """How far predictions are from a flight, on average over their starts: a row for each of
    ``QUANTITIES``, a column for each of m samples after the start.
    """

    starts: int
    horizon: Array  # (m,) s after the start
    model: Array  # (4, m)
    still: Array  # (4, m) where velocity and body rate stay as the pose has them at the start

    @property
    def worse(self) -> list[str]:
        """The quantities that the model predicts worse than the guess, at the horizon's end."""
        ends = zip(QUANTITIES, self.model[:, -1], self.still[:, -1], strict=True)
        return [name for name, model, still in ends if model > still]

    @classmethod
    def pooled(cls, parts: Sequence[PredictionErrors]) -> PredictionErrors:
        """Return the errors over all starts of several, which have one horizon."""
        starts = [part.starts for part in parts]
        both = [[part.model for part in parts], [part.still for part in parts]]
        means = (np.average(of, axis=0, weights=starts) for of in both)
        return cls(sum(starts), parts[0].horizon, *means)


def prediction_errors(
    logs: Sequence[FlightLog],
    vehicle: Vehicle,
    horizon_s: float = 0.5,
    windows: Sequence[Segments] | None = None,
) -> PredictionErrors:
    """Return how well a model predicts flights, beside the guess that nothing changes.

    A prediction starts every 0.25 s, as ``predict`` makes it. The flight that it is compared with
    is the pose below 5 Hz; the angle between two attitudes is their distance.

    Args:
        logs: with a pose; flights that the model was not fitted to, or its errors mean little. For
            commands alone the vehicle's motor curve says the rotor speeds.
        vehicle: whose model predicts, with its declared effects.
        horizon_s: s.
        windows: for each log, its parts: from and to in s after its start; None: all of it.

    Raises:
        InputError: no stretch of pose is long enough, or poses come at different rates.
    """
    model: list[Array] = []
    still: list[Array] = []
    whole = [[(0.0, math.inf)]] * len(logs)
    for log, parts in zip(logs, windows or whole, strict=True):
        first, last = log.t[[0, -1]].tolist()
        ends = [(first + begin, min(first + end, last)) for begin, end in parts]
        flown = with_commanded_speeds(log, vehicle)
        for piece, _, rows, path in _predictions(flown, vehicle, ends, horizon_s):
            begun = rows[:, 0] - 1
            ahead = piece.period * np.arange(1, rows.shape[1] + 1)[:, None]
            seen = Rotation.from_matrix(piece.rotation)
            guess = np.zeros_like(path)
            guess[..., 7:10] = piece.velocity[begun, None]
            guess[..., 10:13] = piece.angular_velocity[begun, None]
            guess[..., :3] = piece.position[begun, None] + ahead * guess[..., 7:10]
            turn = Rotation.from_rotvec((ahead * guess[..., 10:13]).reshape(-1, 3))
            turned = seen[np.repeat(begun, rows.shape[1])] * turn
            guess[..., 3:7] = turned.as_quat(scalar_first=True).reshape(*rows.shape, 4)
            for out, x in ((model, path), (still, guess)):
                attitude = Rotation.from_quat(x[..., 3:7].reshape(-1, 4), scalar_first=True)
                angle = (seen[rows.ravel()].inv() * attitude).magnitude().reshape(rows.shape)
                off = [
                    np.linalg.norm(x[..., :3] - piece.position[rows], axis=2),
                    np.linalg.norm(x[..., 7:10] - piece.velocity[rows], axis=2),
                    angle,
                    np.linalg.norm(x[..., 10:13] - piece.angular_velocity[rows], axis=2),
                ]
                out.append(np.stack(off, axis=1))
    if len({x.shape[2] for x in model}) != 1:
        names = ", ".join(log.name for log in logs)
        raise InputError(f"{names}: expected poses at one rate, unbroken for {horizon_s + 1:g} s")
    both = np.concatenate(model), np.concatenate(still)
    return PredictionErrors(len(both[0]), ahead[:, 0], *(x.mean(axis=0) for x in both))


def _predictions(
    log: FlightLog, vehicle: Vehicle, segments: Segments, horizon: float
) -> Iterator[tuple[Signals, Array, NDArray[np.intp], Array]]:
    """Yield for each unbroken piece of a log its signals and states (n, STATE_SIZE), the samples
    (starts, m) that predictions come to, and the states (starts, m, STATE_SIZE) that they say.
    """
    log = undo_log_sensing(log, vehicle)
    for piece in log_signals(log):
        ahead = max(1, round(horizon / piece.period))
        starts = _start_samples(piece, segments, horizon)
        starts = starts[starts + ahead < len(piece.t)]
        if starts.size:
            starts = starts[:: math.ceil(len(starts) / PREDICTION.most_starts)]
            states, path = _rolled_out(piece, vehicle, starts, ahead, float(log.t[0]))
            yield piece, states, starts[:, None] + np.arange(1, ahead + 1), path


def _rolled_out(
    signals: Signals, vehicle: Vehicle, starts: NDArray[np.intp], ahead: int, take_off: float
) -> tuple[Array, Array]:
    """Return the flight's states (n, STATE_SIZE) over one unbroken piece of a log that began at
    ``take_off`` s, and the states (starts, ahead, STATE_SIZE) that the model predicts.
    """
    substeps = max(1, math.ceil(signals.period / PREDICTION.longest_rotor_step - _STEP_TOLERANCE))
    dt = signals.period / substeps
    columns = signals.columns()
    modelled = np.zeros((len(signals.t), 6))
    path = np.zeros((len(starts), ahead, STATE_SIZE))
    states = np.zeros((0, STATE_SIZE))
    # along the flight once for the model's accelerations, and once more with the starts' states
    for begun in (starts[:0], starts):
        # the model that flies along, and the copy of it that is let go
        models = np.zeros(2, dtype=_MODEL)
        load_model(models[0], vehicle)
        models[0]["time"] = signals.t[0] - take_off
        modelled[:] = 0.0
        _fly_along(models, begun, ahead, dt, substeps, *columns, states, modelled, path)
        if not len(begun):
            states = start_states(signals, modelled)
    return states, path


def _start_samples(signals: Signals, segments: Segments, horizon: float) -> NDArray[np.intp]:
    """Return the samples at which predictions start that lie in a segment and well inside this
    piece.
    """
    use = PREDICTION
    first = signals.t[0] + use.start_margin
    last = signals.t[-1] - max(horizon + use.end_margin, use.start_margin)
    each = (np.arange(t0, t1 - horizon + 1e-9, use.start_every) for t0, t1 in segments)
    times = np.concatenate([np.empty(0), *each])
    times = times[(times >= first) & (times <= last)]
    return np.unique(np.round((times - signals.t[0]) / signals.period).astype(np.intp))


def start_states(signals: Signals, modelled: Array) -> Array:
    """Return the flight's state (n, STATE_SIZE) in the filter's layout, without the wrench and
    without a filter's delay.

    Velocity, attitude and angular velocity are the pose's below 1 Hz and the model's above, where
    the pose is mostly noise: what the two differ by goes through a zero-phase low-pass. A quadrotor
    steers above 1 Hz, but what its model lacks acts mostly below. At 5 mrad of noise in a pose at
    200 Hz that leaves 0.5 mrad of tilt and 3 mrad/s of angular velocity; from the pose alone, cut
    at 5 Hz, it is 1.1 mrad, 19 mrad/s and the flight's own fast motion lost.

    Args:
        signals: n samples.
        modelled: (n, 6) the model's acceleration (m/s2, world) and angular acceleration (rad/s2,
            body) over the interval that ends at each sample.
    """
    period = signals.period
    integral = period * np.cumsum(modelled, axis=0)
    measured = np.column_stack([signals.velocity, signals.angular_velocity])
    twist = integral + low_pass(measured - integral, CUTOFFS.twist_hz, period)
    # the attitude that this angular velocity integrates to drifts slowly off the measured one:
    # low-pass the difference
    attitude = Rotation.from_matrix(signals.rotation)
    turned = np.empty((len(signals.t), 4))
    turned[0] = attitude[0].as_quat(scalar_first=True)
    _integrate_angular_velocity(np.ascontiguousarray(twist[:, 3:]), period, turned)
    path = Rotation.from_quat(turned, scalar_first=True)
    drift = (attitude * path.inv()).as_quat(scalar_first=True)
    drift = low_pass(continuous(drift), CUTOFFS.twist_hz, period)
    states = np.zeros((len(signals.t), STATE_SIZE))
    states[:, 0:3] = low_pass(signals.position, CUTOFFS.position_hz, period)
    states[:, 3:7] = (Rotation.from_quat(drift, scalar_first=True) * path).as_quat(
        scalar_first=True
    )
    states[:, 7:13] = twist
    return states


@compiled
def _integrate_angular_velocity(rate: Array, period: float, out: Array) -> None:
    """Write the attitude (n, 4) that turns at a angular velocity (n, 3) into ``out``, from its
    first row on.
    """
    for k in range(1, len(rate)):
        a, b = rate[k - 1], rate[k]
        w = 0.5 * (a + b)
        turn_body(out[k - 1], w[0], w[1], w[2], period, out[k])


@compiled
def _fly_along(
    models: Record,
    starts: np.ndarray,
    ahead: int,
    dt: float,
    substeps: int,
    speeds: Array,
    voltage: Array,
    position: Array,
    rotation: Array,
    velocity: Array,
    rate: Array,
    states: Array,
    modelled: Array,
    path: Array,
) -> None:
    """Run the first model along a flight and write its accelerations (n, 6); let a copy of it go at
    each start, and write the states (starts, ahead, STATE_SIZE) that it comes to.
    """
    f, g = models[0], models[1]
    nothing, after = np.zeros(3), np.zeros(path.shape[2])
    at, fine = 0, dt / _MOTION_STEPS
    for k in range(len(speeds)):
        if k > 0:
            j = k - 1
            for _ in range(substeps):
                drive(f, speeds[k], dt, voltage[k])
                apply_effects(f, position[j], rotation[j], velocity[j], rate[j])
                accelerations(
                    f.body,
                    rotation[j],
                    rate[j],
                    f.rotor_wrench,
                    nothing,
                    nothing,
                    f.effect_wrench,
                    f.acceleration,
                )
                f.time += dt
                for i in range(6):
                    modelled[k, i] += f.acceleration[i] / substeps
        if at < len(starts) and starts[at] == k:
            models[1] = f
            x = states[k].copy()
            for i in range(ahead):
                for _ in range(substeps):
                    drive(g, speeds[k + 1 + i], dt, voltage[k + 1 + i])
                    for _ in range(_MOTION_STEPS):
                        propagate(g, x, fine, after)
                        x[:] = after
                    g.time += dt
                path[at, i] = x
            at += 1


def nis_without_wrench_state(log: FlightLog, vehicle: Vehicle, segments: Segments) -> float:
    """Return the mean NIS over the segments of a wrench filter whose external wrench is held at
    zero.

    The filter runs over the whole log as in ``estimate_log``, with ``UKFTuning.for_vehicle``, and
    undoes declared sensing effects by itself. As the wrench cannot move, what the model lacks stays
    in the innovations. The mean is 6 for a model whose errors are as large as the tuning says, and
    lower for a better one.

    Args:
        log: the flight.
        vehicle: whose model the filter runs, with its declared effects.
        segments: times (s) from and to.

    Returns:
        NaN where no row of a segment has a pose to compare with, or the filter's numbers overflow.

    Raises:
        InputError: the vehicle has more effects than a model holds.
    """
    period = log.period
    tuning = UKFTuning.for_vehicle(vehicle, period)
    tuning = replace(
        tuning,
        force_walk=PREDICTION.frozen_wrench_factor * np.asarray(tuning.force_walk),
        torque_walk=PREDICTION.frozen_wrench_factor * np.asarray(tuning.torque_walk),
    )
    covariance = default_covariance(vehicle, tuning)
    covariance[12:18, 12:18] *= PREDICTION.frozen_wrench_factor**2
    position = np.where(log.valid[:, None], log.position, np.nan)
    columns = log.t, log.rotor_speeds, position, log.quaternion, log.voltage
    pieces = pieces_of(vehicle, *columns, PREDICTION.longest_gap, 0.0)
    if not pieces:
        return math.nan
    found = innovations(vehicle, tuning, period, pieces, 0.0, math.inf, covariance)
    inside = np.any([(found.t >= t0) & (found.t <= t1) for t0, t1 in segments], axis=0)
    return float(np.mean(found.nis[inside])) if inside.any() else math.nan
