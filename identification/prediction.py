"""Predictions of a logged flight by a vehicle's model, with its declared effects, and their errors:
in metres and as NIS.

All three functions run the model of plant and filter. ``predict`` and ``rollout_error`` take a
planner's view: the model starts from the flight's own state, without any later row, and is compared
with the flight a second later. ``nis_without_wrench_state`` takes the view of a filter with nothing
but the model to explain the motion.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import astuple, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from .. import _core
from ..dynamics.effects.own import raise_errors
from ..dynamics.vehicle import Vehicle
from ..estimator import UKFTuning
from ..estimator.estimate import POSITION, QUATERNION, RATE, VELOCITY
from ..estimator.innovations import innovations, pieces_of
from ..estimator.ukf import default_covariance
from ..runtime.arrays import Mask
from ..runtime.errors import InputError
from .causal_states import STATE, causal_states, scaled_tuning
from .logs.commanded_speeds import with_commanded_speeds
from .logs.flight_log import NORM_TOLERANCE, FlightLog
from .logs.flight_phases import carried
from .logs.table import Array, Rows, finite_rows
from .motion.residual import loaded_model
from .motion.sensing_effects import undo_log_sensing
from .motion.signals import known_pieces, log_signals, longest_step
from .motion.smoothing import continuous, likeliest_speeds, resampled, unbroken

Segments = Sequence[tuple[float, float]]


# the flight of a model from a state
_HEAVY = 1e9  # kg m2: torques turn nothing
_STEP_TOLERANCE = 0.1  # of a period: a step so little too long is still one step
# s after the start of unbroken pose: the filter of a prediction's start settles
_START_MARGIN = 0.5
_CLEARANCE = 0.05  # m above the place of rest: the vehicle is off the ground
_END_MARGIN = 0.1  # s before its end: the low-pass of the flight to compare with
_HORIZON = 1.0  # s, of ``rollout_error``
_START_EVERY = 0.25  # s, of an error's predictions
_MOST_STARTS = 2000  # of an error's predictions in a piece, spread over it
# the filter without a wrench
_LONGEST_GAP = 2.0  # s without a pose, after which it starts anew (``estimate_log``)
_FROZEN = 1e-6  # of its usual standard deviation: a fixed wrench state


class Prediction(NamedTuple):
    """The motion predicted by a model from each of n starts, over m steps of ``period``."""

    start: Rows  # (n,) rows of the log
    period: float  # s
    position: Array  # (n, m, 3) m, world; the first is a period after the start
    velocity: Array  # (n, m, 3) m/s, world
    quaternion: Array  # (n, m, 4) body to world
    angular_velocity: Array  # (n, m, 3) rad/s, body


def predict(
    log: FlightLog,
    vehicle: Vehicle,
    horizon_s: float = 0.5,
    every: int = 1,
    state: ArrayLike | None = None,
) -> Prediction:
    """Predict a flight from its own states by a vehicle's model and the logged rotor speeds alone.

    The model starts at a row from position, velocity, attitude and angular velocity. From then on
    only the logged rotor speeds and voltage enter; a rotor speed holds over the interval before its
    sample. White noise of measured speeds is taken out by ``likeliest_speeds``, with the speeds
    some hundredths of a second later. Rotors and effects start with the memory of the flight
    before. Rows before the start tell the thrust of commands along body axes. Declared sensing
    effects are taken out of the log.
    No row after a start changes its state.

    A torque that held-out flights refuted (``vehicle.status``) leaves the body rate as at the
    start, unless the vehicle states the flight loop's reaction (``closed_loop``): the body then
    turns by this. A refuted force leaves the velocity.

    The start limits a prediction: 1 mrad of tilt is 5 mm after a second, 10 mrad/s of angular
    velocity is 16 mm. See ``causal_states``.

    Args:
        log: the flight.
        vehicle: the predicting model, with its declared effects.
        horizon_s: s.
        every: samples from start to start. Starts without a whole horizon before the next break of
            the pose, or with a state before the next break of the rows, are left out.
        state: (N, 13) position, quaternion (body to world), velocity (world) and angular velocity
            (body) at each row, taken as they are; of the log without declared sensing effects.
            Rows with a NaN are no starts. None: a filter's state, without any later row.

    Raises:
        InputError: no stretch of pose is unbroken for 3 s, a state has another shape or a
            quaternion of another length than 1, or the vehicle has too many effects for a model.
    """
    log = undo_log_sensing(with_commanded_speeds(log, vehicle), vehicle)
    if state is None:
        pieces, states = known_pieces(log), causal_states(log, vehicle)
    else:
        states = _checked(log, state)
        pieces = unbroken(log.t, np.arange(len(log.t)), longest_step(log))
    ahead = max(1, round(horizon_s / log.period))
    last = log.t - (ahead - _STEP_TOLERANCE) * log.period  # s, of a start whose horizon ends there
    starts = np.concatenate(
        [
            np.arange(rows[0], np.searchsorted(log.t, last[rows[-1]], side="right"), every)
            for rows in pieces
        ]
    )
    starts = starts[finite_rows(states[starts])]
    x = _flown(_without_noise(log), vehicle, states, starts, ahead)
    parts = POSITION, VELOCITY, QUATERNION, RATE
    return Prediction(starts, log.period, *(x[..., part] for part in parts))


def _without_noise(log: FlightLog) -> FlightLog:
    """Return the log with the likeliest speeds behind measured ones: noise turns a calm flight."""
    if log.commanded or not np.isfinite(log.rotor_speeds).all():
        return log
    return replace(log, rotor_speeds=likeliest_speeds(log.rotor_speeds, log.period))


def _checked(log: FlightLog, state: ArrayLike) -> Array:
    """Return a user's states (N, STATE), with quaternions of length 1.

    Raises:
        InputError: the shape differs, or a quaternion is not a rotation.
    """
    states = np.array(state, dtype=np.float64)
    if states.shape != (len(log.t), STATE):
        raise InputError(
            f"{log.name}: state has shape {states.shape}; expected ({len(log.t)}, {STATE}): "
            "position, quaternion, velocity and angular velocity at each row"
        )
    length = np.linalg.norm(states[:, QUATERNION], axis=1)
    wrong = np.flatnonzero(np.abs(length - 1.0) > NORM_TOLERANCE)  # not where a NaN is
    if wrong.size:
        raise InputError(
            f"{log.name}: state: the quaternion of row {wrong[0]} has length {length[wrong[0]]:.4g}"
            "; expected 1"
        )
    states[:, QUATERNION] /= length[:, None]
    return states


def _flown(log: FlightLog, vehicle: Vehicle, states: Array, starts: Rows, ahead: int) -> Array:
    """Return the model's states (starts, ahead, STATE), a period apart, from the states (N, STATE)
    of a log at some rows in ascending order. For the memory of effects, the last state holds over
    rows without one. Neighbouring rows with a state show the thrust of commands.
    """
    path = np.zeros((len(starts), ahead, STATE))
    if not len(starts):
        return path
    finite, known = finite_rows(states), vehicle.uncertainty
    first = int(np.argmax(finite))
    last_known = np.maximum.accumulate(np.where(finite, np.arange(len(log.t)), 0))[first:]
    loop = vehicle.closed_loop
    if vehicle.status.torque == "refuted" and loop is None:
        vehicle = replace(vehicle, inertia=_HEAVY * np.eye(3))
    shown = _off_ground(log, vehicle, states) & finite & np.roll(finite, 1)
    models = loaded_model(vehicle)[0].copy()
    t = log.t[first:] - log.t[0]
    models[0]["time"] = t[0]
    voltage = np.zeros(len(log.t)) if log.voltage is None else log.voltage
    speeds, volts = (np.ascontiguousarray(x[first:]) for x in (log.rotor_speeds, voltage))
    reaction = np.array(() if loop is None else astuple(loop))
    _core.predict_flight(
        models.ctypes.data,
        t,
        speeds,
        volts,
        states[last_known],
        starts - first,
        log.period,
        shown[first:],
        math.hypot(known.thrust, known.command) if log.commanded else 0.0,
        vehicle.status.force == "refuted",
        reaction,
        path,
    )
    raise_errors()
    return path


def rollout_error(log: FlightLog, vehicle: Vehicle, segments: Segments) -> float:
    """Return the RMS distance (m) between flight and model after a second of ``predict``.

    Args:
        log: the flight.
        vehicle: the predicting model, with its declared effects.
        segments: times (s) from and to; a prediction counts if one of them holds all of it.

    Returns:
        NaN if no segment holds a sufficient unbroken stretch of pose.

    Raises:
        InputError: the vehicle has too many effects for a model.
    """
    try:
        starts = logged_starts(log, vehicle, segments, _HORIZON)
    except InputError:
        return math.nan
    off = (starts.flown(vehicle) - starts.seen)[:, -1, POSITION]
    return math.sqrt(np.square(off).sum(axis=1).mean()) if len(off) else math.nan


QUANTITIES = {"position": "m", "velocity": "m/s", "attitude": "rad", "body rate": "rad/s"}


class PredictionErrors(NamedTuple):
    """Mean distances of predictions from a flight over their starts: a row for each of
    ``QUANTITIES``, a column for each of m samples after the start.
    """

    starts: int
    horizon: Array  # (m,) s after the start
    model: Array  # (4, m)
    still: Array  # (4, m) with velocity and body rate as at the start

    @classmethod
    def pooled(cls, parts: Sequence[PredictionErrors]) -> PredictionErrors:
        """Return the errors over all starts of several, at the samples of the slowest."""
        horizon = min((part.horizon for part in parts), key=len)
        both = []
        for part in parts:
            at = np.rint(horizon / part.horizon[0]).astype(int).clip(max=len(part.horizon)) - 1
            both.append((part.model[:, at], part.still[:, at]))
        starts = [part.starts for part in parts]
        return cls(sum(starts), horizon, *np.average(both, axis=0, weights=starts))


ErrorsByPart = Mapping[str, Sequence[PredictionErrors]]  # of flights or blocks, of some models


def errors_of_models(
    logs: Sequence[FlightLog],
    vehicles: Sequence[Vehicle],
    horizon_s: float = 0.5,
    windows: Sequence[Segments] | None = None,
) -> list[PredictionErrors]:
    """Return prediction errors of models of one vehicle, beside the guess of an unchanged velocity.

    A prediction starts every 0.25 s of flight, as in ``predict``, by the first model's filters, and
    the guess from the same state. Both are compared with the pose below 15 Hz; the angle between
    two attitudes is their distance.

    Args:
        logs: with a pose; flights outside the model's fit, or the errors mean little. For commands
            alone the vehicle's motor curve gives the rotor speeds.
        vehicles: the predicting models, with their declared effects.
        horizon_s: s.
        windows: for each log, its parts: from and to in s after its start; None: all of it.

    Raises:
        InputError: no stretch of pose is long enough.
    """
    starts = []
    for log, spans in zip(logs, windows or [[(0.0, math.inf)]] * len(logs), strict=True):
        parts = (np.array(spans) + log.t[0]).tolist()
        starts.append(logged_starts(log, vehicles[0], parts, horizon_s))
    if not any(len(part.rows) for part in starts):
        names = ", ".join(log.name for log in logs)
        raise InputError(f"{names}: expected a pose, unbroken for {horizon_s + 1:g} s of flight")
    return errors_at(starts, vehicles)


def errors_at(
    starts: Sequence[LoggedStarts], vehicles: Sequence[Vehicle]
) -> list[PredictionErrors]:
    """Return the errors of several models from the starts of flights, at least one of them."""
    parts = []
    for part in starts:
        if not len(part.rows):
            continue
        paths = part.unchanged, *(part.flown(v) for v in vehicles)
        still, *means = (distances(path, part.seen) for path in paths)
        parts.append([PredictionErrors(len(part.rows), part.ahead, mean, still) for mean in means])
    return [PredictionErrors.pooled(each) for each in zip(*parts, strict=True)]


class LoggedStarts(NamedTuple):
    """n starts of predictions in a log, and the flight at the m samples after each."""

    log: FlightLog  # without declared sensing effects and the speeds' noise
    states: Array  # (N, STATE) at each row of the log
    rows: Rows  # (n,) the starts'
    segment: Rows  # (n,) number of the segment with each start
    seen: Array  # (n, m, STATE)

    def those(self, keep: Mask | slice) -> LoggedStarts:
        """Return some of the starts."""
        each = ("rows", "segment", "seen")
        return self._replace(**{name: getattr(self, name)[keep] for name in each})

    def flown(self, vehicle: Vehicle) -> Array:
        """Return a model's states (n, m, STATE)."""
        log = with_commanded_speeds(self.log, vehicle)
        return _flown(log, vehicle, self.states, self.rows, self.seen.shape[1])

    @property
    def ahead(self) -> Array:
        """The times (m,) of the samples, s after a start."""
        return self.log.period * np.arange(1, self.seen.shape[1] + 1)

    @property
    def unchanged(self) -> Array:
        """The states (n, m, STATE) with velocity and angular velocity as at the start."""
        ahead = self.ahead[:, None]
        out = np.repeat(self.states[self.rows, None], len(ahead), axis=1)
        out[..., POSITION] += ahead * out[..., VELOCITY]
        turn = Rotation.from_rotvec((ahead * out[..., RATE]).reshape(-1, 3))
        turned = (_attitudes(out) * turn).as_quat(scalar_first=True)
        out[..., QUATERNION] = turned.reshape(*out.shape[:2], 4)
        return out


def logged_starts(
    log: FlightLog, vehicle: Vehicle, segments: Segments, horizon: float
) -> LoggedStarts:
    """Return starts every 0.25 s whose horizon (s) lies in one of the segments, times (s) from and
    to, by the filters of a vehicle. The rotors carry the vehicle off the ground at both ends: no
    model has the ground's force.

    Raises:
        InputError: no stretch of pose is unbroken for 3 s.
    """
    log = undo_log_sensing(with_commanded_speeds(log, vehicle), vehicle)
    ahead = log.period * np.arange(1, max(1, round(horizon / log.period)) + 1)
    each = (np.arange(t0, min(t1, log.t[-1]) - horizon + 1e-9, _START_EVERY) for t0, t1 in segments)
    times = np.concatenate([np.empty(0), *each])
    pieces = log_signals(log)  # refuses a log without a pose
    states = causal_states(log, vehicle)
    aloft = carried(log.rotor_speeds, log.period) & _off_ground(log, vehicle, states)
    starts, seen = [], []
    for piece in pieces:
        first, last = piece.t[0] + _START_MARGIN, piece.t[-1] - horizon - _END_MARGIN
        inside = times[(times >= first) & (times <= last)]
        rows = np.unique(np.searchsorted(log.t, inside - 0.5 * log.period))
        ends = np.searchsorted(log.t, log.t[rows] + ahead[-1], side="right") - 1
        rows = rows[aloft[rows] & aloft[ends]]
        rows = rows[:: math.ceil(len(rows) / _MOST_STARTS) or 1]
        starts.append(rows)
        turned = continuous(Rotation.from_matrix(piece.rotation).as_quat(scalar_first=True))
        flown = np.hstack([piece.position, turned, piece.velocity, piece.angular_velocity])
        at = log.t[rows, None] + ahead
        seen.append(resampled(at.ravel(), piece.t, flown).reshape(*at.shape, STATE))
    rows = np.concatenate(starts)
    begins = [t0 for t0, _ in segments]
    segment = np.searchsorted(begins, log.t[rows] + log.period, side="right") - 1
    return LoggedStarts(_without_noise(log), states, rows, segment, np.concatenate(seen))


def _off_ground(log: FlightLog, vehicle: Vehicle, states: Array) -> Mask:
    """Return the rows (N,) off the ground, by the states (N, STATE) so far: of a log whose first
    0.5 s have too little thrust to fly, those above the first place.
    """
    height = states[:, POSITION][:, 2]
    first = np.argmax(np.isfinite(height))
    early = (log.t >= log.t[first]) & (log.t <= log.t[first] + _START_MARGIN)
    thrust = np.square(log.rotor_speeds[early]) @ vehicle.k
    rests = np.median(thrust) < 0.5 * vehicle.weight
    return height > (height[first] + _CLEARANCE if rests else -np.inf)


def _attitudes(states: Array) -> Rotation:
    return Rotation.from_quat(states[..., QUATERNION].reshape(-1, 4), scalar_first=True)


def offsets(x: Array, y: Array) -> Array:
    """Return the differences (..., 4, 3), in the order of ``QUANTITIES``, of states (..., STATE)
    from others, an attitude's as a rotation vector.
    """
    turn = (_attitudes(y).inv() * _attitudes(x)).as_rotvec().reshape(*x.shape[:-1], 3)
    off = x - y
    return np.stack([off[..., POSITION], off[..., VELOCITY], turn, off[..., RATE]], axis=-2)


def distances(x: Array, y: Array) -> Array:
    """Return the mean distances (4, m) of states (n, m, STATE), in the order of ``QUANTITIES``."""
    return np.transpose(np.linalg.norm(offsets(x, y), axis=-1).mean(axis=0))


def nis_without_wrench_state(log: FlightLog, vehicle: Vehicle, segments: Segments) -> float:
    """Return the mean NIS over the segments of a wrench filter with the external wrench held at
    zero.

    The filter runs over the whole log as in ``estimate_log``, with ``UKFTuning.for_vehicle``, and
    undoes declared sensing effects itself. With a fixed wrench, the errors of the model stay in the
    innovations. The mean is 6 for a model with errors as large as in the tuning, and lower for a
    better one.

    Args:
        log: the flight.
        vehicle: the filter's model, with its declared effects.
        segments: times (s) from and to.

    Returns:
        NaN if no row of a segment has a pose to compare with, or the filter's numbers overflow.

    Raises:
        InputError: the vehicle has too many effects for a model.
    """
    period = log.period
    tuning = scaled_tuning(UKFTuning.for_vehicle(vehicle, period), 1.0, _FROZEN, _FROZEN)
    covariance = default_covariance(vehicle, tuning)
    covariance[12:18, 12:18] *= _FROZEN**2
    position = np.where(log.valid[:, None], log.position, np.nan)
    columns = log.t, log.rotor_speeds, position, log.quaternion, log.voltage
    pieces = pieces_of(vehicle, *columns, _LONGEST_GAP, 0.0)
    if not pieces:
        return math.nan
    steps = innovations(vehicle, tuning, period, pieces, 0.0, math.inf, covariance)
    inside = np.any([(steps.t >= t0) & (steps.t <= t1) for t0, t1 in segments], axis=0)
    return float(steps.nis[inside].mean()) if inside.any() else math.nan
