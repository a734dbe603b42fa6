"""The measured side of force and torque balance, evenly sampled, piece by piece.

Specific force and angular velocity come from the IMU, or without one from the pose's derivatives.
Rotors come as measured speeds, or as motor commands.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import cumulative_trapezoid

from ...runtime.arrays import Array, Mask
from ...runtime.errors import InputError
from ..logs.flight_log import TORQUE_HZ, FlightLog, Logs, serves
from ..logs.flight_phases import carried
from ..logs.table import Pair, median_step
from ..motion.signals import (
    LONGEST_GAP,
    SHORTEST_PIECE,
    Signals,
    in_body,
    log_signals,
    pose_pieces,
    voltage_at,
)
from ..motion.smoothing import (
    derivative,
    low_pass,
    power_spectrum,
    resampled,
    runs_of,
    unbroken,
)
from .geometry import GRAVITY

# Hz, low-pass of angular velocity and velocity as factors of products: it passes a quadrotor's
# motion and keeps out noise, which a product squares
_PRODUCT_HZ = 8.0
# Hz: above, velocity is the accelerometer's integral. The pose's noise grows with frequency, and
# drag of a noisy velocity is too small: 1.0e-6 N/(rad/s m/s) on a small quadrotor, 2.7e-6 by the
# coherence of 0.99 below
_POSED_HZ = 1.0
# Hz: faster logs are thinned out, behind a low-pass at 0.4 of it: rotors follow no faster
_FASTEST_HZ = 200.0
# share of different values among all: rotor speeds below it are rounded
_FEW_VALUES = 0.2


class MotionPiece(NamedTuple):
    """n evenly spaced samples of one unbroken piece of a log; body axes forward, left, up."""

    log: int  # index of the log
    t: Array  # (n,) s
    period: float  # s
    specific_force: Array  # (n, 3) m/s2; NaN: not known
    angular_acceleration: Array  # (n, 3) rad/s2
    angular_velocity: Array  # (n, 3) rad/s, smoothed
    velocity: Array | None = None  # (n, 3) m/s, body axes, smoothed
    # (n, 4) speeds in rad/s, or commands where no speeds are compared
    rotors: Array = np.empty((0, 4))
    command: Array | None = None  # (n, 4), 0 to 1
    voltage: Array | None = None  # (n,) V

    def measured(self) -> Array:
        """Return specific force and angular acceleration (n, 6)."""
        return np.column_stack([self.specific_force, self.angular_acceleration])

    def mapped(self, change: Callable[[Array], Any], *names: str) -> "MotionPiece":
        """Return the piece with each of its series changed, or these alone."""
        some = {name: getattr(self, name) for name in names or self._fields}
        return self._replace(**{n: change(x) for n, x in some.items() if np.ndim(x)})


Pieces = list[MotionPiece]


@dataclass(frozen=True)
class Sources:
    """The sensors of the balance."""

    force: str  # "accelerometer", "pose" or "" (none)
    rate: str  # "gyro" or "pose"
    rotors: str  # "rotor speeds" or "commands"
    velocity: bool


def _sources_of(logs: Logs) -> Sources:
    """Return the sensors common to all logs.

    Raises:
        InputError: a log has no motion, its rotors were measured too seldom, or some logs have
            rotor speeds and others commands.
    """

    def quick(log: FlightLog, channel: str) -> bool:
        """Return whether a channel of the rotors is quick enough to tell their torque."""
        return serves(log.rates.get(channel, np.inf), TORQUE_HZ)

    unmeasured = [
        log for log in logs if not log.has_rotor_speeds or log.commanded or not quick(log, "rotors")
    ]
    commands = all(log.command is not None and quick(log, "commands") for log in logs)
    if unmeasured and not commands:
        log = unmeasured[0]
        rates = [f"{x} {log.rates[x]:.3g} Hz" for x in ("rotors", "commands") if x in log.rates]
        raise InputError(
            f"{log.source or logs[0].name}: expected rotor speeds (omega1..omega4) in every log, "
            "or motor commands (cmd1..cmd4) in every log, "
            f"{TORQUE_HZ:g} times a second; found {' and '.join(rates) or 'neither'}"
        )
    accelerometer = all(log.accelerometer is not None for log in logs)
    gyro = all(log.gyro is not None for log in logs)
    pose = all(log.has_pose for log in logs)
    if not gyro and not pose:
        raise InputError(
            f"{logs[0].name}: expected a gyro (gx, gy, gz) in every log, or a pose in every log"
        )
    return Sources(
        "accelerometer" if accelerometer else "pose" if pose else "",
        "gyro" if gyro else "pose",
        "commands" if unmeasured else "rotor speeds",
        pose,
    )


def rounding_step(logs: Logs) -> float:
    """Return the step (rad/s) of rounded rotor speeds, from the numbers themselves; 0 where
    rounding does not matter.
    """
    values = np.concatenate([log.rotor_speeds.ravel() for log in logs])
    kept = np.unique(values.round(6))
    return median_step(kept) if 3 <= len(kept) <= _FEW_VALUES * len(values) else 0.0


def speed_noise(pieces: Pieces) -> float:
    """Return the standard deviation (rad/s) of the white noise of rotor speeds with their rounding,
    from the highest quarter of their spectrum: no rotor follows its command there.
    """
    powers = [power_spectrum(p.rotors, p.period, 256)[1] / (2.0 * p.period) for p in pieces]
    return math.sqrt(np.median([power[-len(power) // 4 :].mean(axis=0) for power in powers]))


def pieces_of(logs: Logs, windows: Sequence[Pair]) -> tuple[Pieces, Sources]:
    """Return all unbroken pieces of the logs in flight, and their sensors.

    Args:
        logs: flights of one vehicle.
        windows: for each log, from and to in s after its start.

    Raises:
        InputError: a log lacks a channel, or no piece in flight is long enough.
    """
    sources = _sources_of(logs)
    pieces = []
    for number, (log, (first, last)) in enumerate(zip(logs, windows, strict=True)):
        log = _without_bias(log)
        motion = _posed if "pose" in (sources.rate, sources.force) else _inertial
        for moved in motion(log, number, sources):
            piece = _piece(log, moved, sources)
            inside = (piece.t >= log.t[0] + first) & (piece.t <= log.t[0] + last)
            for part in _cut(piece, inside):
                pieces += _cut(part, carried(part.rotors, part.period))
    moving = [piece for piece in pieces if piece.velocity is not None]
    pieces, sources = moving or pieces, replace(sources, velocity=bool(moving))
    if not pieces:
        raise InputError(
            f"{logs[0].name}: no piece of {SHORTEST_PIECE:g} s in flight is unbroken "
            "in pose and sensors; expected a longer flight, or another --from and --to"
        )
    return pieces, sources


def _without_bias(log: FlightLog) -> FlightLog:
    """Return a log whose accelerometer agrees with the pose on the mean of each axis: over a flight
    the mean force carries the weight, however the sensor is calibrated.
    """
    if log.accelerometer is None or not pose_pieces(log):
        return log
    off = [_sensor(log, "accelerometer", s.t) - _felt(s) for s in log_signals(log)]
    return replace(log, accelerometer=log.accelerometer - np.vstack(off).mean(axis=0))


def _felt(s: Signals) -> Array:
    """Return the specific force (n, 3) of a pose's motion, body axes."""
    return in_body(s.acceleration + np.array([0.0, 0.0, GRAVITY]), s.rotation)


def _moving(log: FlightLog, s: Signals) -> Array:
    """Return the velocity (n, 3) of a pose's motion, body axes: quick changes by the accelerometer,
    if any.
    """
    velocity = s.velocity
    if log.accelerometer is not None:
        felt = np.einsum("nij,nj->ni", s.rotation, _sensor(log, "accelerometer", s.t))
        gained = cumulative_trapezoid(felt - [0.0, 0.0, GRAVITY], dx=s.period, axis=0, initial=0.0)
        velocity = gained + low_pass(velocity - gained, _POSED_HZ, s.period)
    return in_body(velocity, s.rotation)


def _posed(log: FlightLog, number: int, sources: Sources) -> Iterator[MotionPiece]:
    """Yield motion by the pose's derivatives, with accelerometer and gyro in their place if any."""
    for s in log_signals(log, wide_hz=np.inf) if pose_pieces(log) else ():
        force, velocity = _felt(s), _moving(log, s)
        rate, turning = s.angular_velocity, s.angular_acceleration
        if sources.force == "accelerometer":
            force = _sensor(log, sources.force, s.t)
        if sources.rate == "gyro":
            rate = _sensor(log, sources.rate, s.t)
            turning = derivative(rate, s.period)
        yield MotionPiece(number, s.t, s.period, force, turning, rate, velocity)


def _inertial(log: FlightLog, number: int, sources: Sources) -> Iterator[MotionPiece]:
    """Yield motion by the IMU: rate, and force if any; velocity is the pose's, if any."""
    assert log.gyro is not None
    read = np.flatnonzero(np.isfinite(log.gyro[:, 0]))
    period = median_step(log.t[read])
    for rows in unbroken(log.t, read, max(LONGEST_GAP, 3.5 * period), 15, SHORTEST_PIECE):
        t = np.arange(log.t[rows[0]], log.t[rows[-1]], period)
        rate = _sensor(log, "gyro", t)
        force = np.full_like(rate, np.nan)
        if log.accelerometer is not None:
            force = _sensor(log, "accelerometer", t)
        piece, moving = MotionPiece(number, t, period, force, derivative(rate, period), rate), []
        for s in log_signals(log) if sources.velocity and pose_pieces(log) else ():
            velocity = resampled(t, s.t, _moving(log, s))
            moving += _cut(piece._replace(velocity=velocity), (t >= s.t[0]) & (t <= s.t[-1]))
        yield from moving or [piece]


def _piece(log: FlightLog, piece: MotionPiece, sources: Sources) -> MotionPiece:
    """Return a piece with the rotors beside its motion; fast logs are thinned out."""
    t, period = piece.t, piece.period
    rotors = getattr(log, "command" if sources.rotors == "commands" else "rotor_speeds")
    piece = piece._replace(
        rotors=resampled(t, log.t, rotors),
        command=None if log.command is None else resampled(t, log.t, log.command),
        voltage=voltage_at(log, t),
    )
    if period < 0.8 / _FASTEST_HZ:
        period = 1.0 / _FASTEST_HZ
        thin = np.arange(t[0], t[-1], period)

        def thinned(x: Array) -> Array:
            slow = low_pass(x, 0.4 * _FASTEST_HZ, piece.period)
            return resampled(thin, t, slow) if x.ndim > 1 else np.interp(thin, t, slow)

        piece = piece.mapped(thinned)._replace(t=thin, period=period)

    def smooth(x: Array) -> Array:
        return low_pass(x, _PRODUCT_HZ, period)

    return piece.mapped(smooth, "angular_velocity", "velocity")


def _sensor(log: FlightLog, channel: str, t: Array) -> Array:
    values = getattr(log, channel)
    read = np.isfinite(values[:, 0])
    return resampled(t, log.t[read], values[read])


def _cut(piece: MotionPiece, keep: Mask) -> Pieces:
    """Return the kept runs of samples that are long enough."""
    return [
        piece.mapped(itemgetter(slice(a, b)))
        for a, b in runs_of(keep)
        if (b - a) * piece.period >= SHORTEST_PIECE
    ]
