"""The delay of a log's pose behind its rotor speeds, by the spectra of moments and turns.

Measured rotor speeds act on the angular acceleration at once. So the phase between the rotors' roll
and pitch moments and the turns of the pose falls in proportion to the frequency for a delay; behind
a lag the phase is an arctangent, and the gain falls. Delay and lag are fitted together to the
measured frequency response, with one free gain an axis.

A flight loop closed on the pose answers the pose's noise. The answer makes most of the moments
above a few hertz, and has a phase of its own. White noise of the pose is known from the log, and
the noise can hold at most the whole moment: the ratio of their amplitudes bounds the answer's error
of the response. The fit takes this bound for a standard deviation. A loop on gyros answers gusts,
and the response has another shape than a delay's. The misfit is a part of the uncertainty.

The answer tells more. No loop answers noise before the pose was measured. Rotor speeds in rows
ahead of the noise's row prove a late pose, and no latency of the vehicle does the same.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from ...dynamics.vehicle import Vehicle
from ..motion.smoothing import (
    high_pass,
    resampled,
    robust_std,
    second_difference,
    turned,
    unbroken,
)
from .evidence import SIDES
from .excerpt import excerpt
from .flight_log import FlightLog
from .table import Array, Pair, Rows, median_step

FARTHEST = 0.3  # s, of the search
# s: smaller delays are of filters, and of stamps at a sample's end
LEAST = 0.01
SURE = 4.0  # standard deviations
# s: rotor speeds of flown vehicles act by up to so much later. A flight loop falls over more
HONEST = 0.04
# s: rotor speeds that pass a filter of their own act by up to so much earlier
AHEAD = 0.03
# s, of motors behind a command that was logged for a speed; with a delay together at most 0.1
_LAGS = 0.01 * np.arange(11)
_STEP = 0.001  # s, of the search
_BAND_HZ = (0.8, 10.0)
_SHARE_OF_RATE = 0.4  # of the poses' rate, the highest frequency
_SEGMENT = 2.0  # s, of a spectrum
_PERIOD = 0.01  # s, the shortest of the spectra's clock
_INDEPENDENT = 0.55  # of half overlapping segments
_GAP = 0.1  # s (or 3.5 periods) without a pose end a piece
_ROUNDS = 10  # of the search, each around the delay of the last
_PARTS = 5  # of the flight; the scatter of their delays is the uncertainty
_FEWEST = 10  # segments
_VISIBLE = 40.0  # deviance explained by the moments, at least
_BEYOND = 9.0  # deviance against an honest delay and any lag
_NOISE_SHARE = 0.25  # of the poses' rate: above is noise alone
# correlation of second differences with the next ones: -2/3 of white noise, above 0 of motion
_WHITE = -0.5
_APART = 0.01  # s, of the differences, at least
_FINEST = 0.005  # s, between two delays of an answer
_FEWEST_POSES = 100
_ANSWERED = 6.0  # standard deviations of a chance correlation


@dataclass(frozen=True)
class PoseDelay:
    """A delay of the pose behind the rotor speeds; negative: ahead."""

    seconds: float
    std: float
    beyond_honest: bool  # whether no honest delay with any lag of the motors is as likely

    @property
    def is_clear(self) -> bool:
        """Whether the delay is beyond noise."""
        return abs(self.seconds) > max(LEAST, SURE * self.std)


@dataclass(frozen=True, eq=False)
class _Response:
    """Measured response of turns to moments: (f, 2) by frequency and axis, roll and pitch."""

    omega: Array  # (f, 1) rad/s
    gain: NDArray[np.complex128]
    weight: Array  # one over the variance of the real part

    def deviance(self, delays: Array, lag: float = 0.0) -> Array:
        """Return the deviance at each of some delays (n,) in s, at the best gain of each axis."""
        shape = np.exp(-1j * self.omega * delays[:, None, None]) / (1.0 + 1j * self.omega * lag)
        along = np.sum(self.weight * np.real(np.conj(shape) * self.gain), axis=1)
        power = np.sum(self.weight * np.square(np.abs(shape)), axis=1)
        explained = np.square(np.maximum(along, 0.0)) / power
        return np.asarray(self.none - np.sum(explained, axis=1))

    @property
    def none(self) -> float:
        """Deviance without any visible moment."""
        return float(np.sum(self.weight * np.square(np.abs(self.gain))))

    def misfit(self, left: float) -> float:
        """Return the error in s of a delay by the deviance left at the best one: gusts answered by
        the loop leave a response of another shape, and turn its phase by as much.
        """
        turn = np.square(np.abs(self.omega * self.gain))
        return float(np.sqrt(left / np.sum(self.weight * turn)))

    def likeliest(self) -> float:
        """Return the likeliest delay, s."""
        count = round(FARTHEST / _STEP)
        tried = _STEP * np.arange(-count, count + 1, dtype=np.float64)
        return float(tried[np.argmin(self.deviance(tried))])


@dataclass(frozen=True, eq=False)
class _Segments:
    """Transforms (n, f, 2) of segments of a flight, and the power (f, 2) of the pose's noise."""

    frequency: Array
    moment: NDArray[np.complex128]
    turning: NDArray[np.complex128]
    noise: Array
    highest_hz: float

    def response(self, chosen: slice | Rows = slice(None)) -> _Response:
        """Return the frequency response of some segments."""
        band = (self.frequency >= _BAND_HZ[0]) & (self.frequency <= self.highest_hz)
        x, y = self.moment[chosen][:, band], self.turning[chosen][:, band]
        xx, yy = (np.mean(np.square(np.abs(z)), axis=0) + 1e-300 for z in (x, y))
        xy = np.mean(np.conj(x) * y, axis=0)
        left = np.maximum(yy - np.square(np.abs(xy)) / xx, 1e-12 * yy)
        variance = left / (2.0 * _INDEPENDENT * len(x)) + self.noise[band]
        omega = 2.0 * np.pi * self.frequency[band][:, None]
        return _Response(omega, xy / xx, xx / variance)


def pose_delay(log: FlightLog, vehicle: Vehicle | None) -> PoseDelay | None:
    """Return the delay of a log's pose behind its rotor speeds; None: the flight does not show one.

    Args:
        log: the flight, with rotor speeds.
        vehicle: as declared; None: rotors on one side turn the body to the other.
    """
    log = excerpt([log])[0]
    late = 0.0
    for _ in range(_ROUNDS):  # a window over delayed signals cuts the two of them differently
        segments = _segments(log, vehicle, late)
        if segments is None or len(segments.moment) < _FEWEST:
            return None
        response = segments.response()
        step = response.likeliest()
        late = min(max(late + step, -FARTHEST), FARTHEST)
        if step == 0.0:
            break
    assert segments is not None
    here = response.deviance(np.zeros(1))[0]
    free = 2.0 * response.gain.size - 3.0
    scale = max(1.0, here / free)  # beyond what noise leaves
    if response.none - here < _VISIBLE * scale:
        return None
    parts = np.array_split(np.arange(len(segments.moment)), _PARTS)
    scatter = float(np.std([segments.response(part).likeliest() for part in parts]))
    std = float(np.hypot(scatter / np.sqrt(_PARTS), response.misfit(here)))
    honest = np.arange(-AHEAD, HONEST + _STEP, _STEP)
    least = min(
        np.min(response.deviance(honest[honest <= _LAGS[-1] - lag] - late, lag)) for lag in _LAGS
    )
    beyond = bool(not -AHEAD < late < HONEST and least - here > _BEYOND * scale)
    return PoseDelay(late, std, beyond)


def _segments(log: FlightLog, vehicle: Vehicle | None, late: float) -> _Segments | None:
    """Return a flight's segments with the pose moved ``late`` s back; None: there are none."""
    rows = np.flatnonzero(log.valid)
    if len(rows) < _FEWEST:
        return None
    step = median_step(log.t[rows])
    period = max(_PERIOD, log.period)
    count = round(_SEGMENT / period)
    inertia = np.eye(3) if vehicle is None else vehicle.inertia
    window = np.hanning(count)[:, None]
    moments = np.square(log.rotor_speeds) @ _mixing(vehicle).T
    transforms: list[list[NDArray[np.complex128]]] = []
    noises = []
    for piece in unbroken(log.t, rows, max(_GAP, 3.5 * step), 60, _SEGMENT):
        t, angles = _turns(log, piece)
        noises.append(robust_std(high_pass(angles, _NOISE_SHARE)))
        first = max(t[0], log.t[0] + late) + period
        last = min(t[-1], log.t[-1] + late) - period
        at = np.arange(first, last, period)
        if len(at) <= count + 2:
            continue
        turn = _means(at, period, t, angles)
        moment = _means(at[1:-1] - late, period, log.t, moments)
        w = (turn[2:] - turn[:-2]) / (2.0 * period)
        alpha = (turn[2:] - 2.0 * turn[1:-1] + turn[:-2]) / period**2
        needed = (alpha @ inertia + np.cross(w, w @ inertia))[:, :2]
        for begin in range(0, len(needed) - count + 1, count // 2):
            both = (z[begin : begin + count] for z in (moment, needed))
            transforms.append([np.fft.rfft(window * (z - z.mean(axis=0)), axis=0) for z in both])
    if not transforms:
        return None
    frequency = np.asarray(np.fft.rfftfreq(count, period), dtype=np.float64)
    # white noise of the angles, through the mean over a period and two differences
    passed = np.sinc(frequency * period) * np.square(2.0 * np.sin(np.pi * frequency * period))
    noise = np.square(np.outer(passed / period**2, np.mean(noises) * np.diag(inertia)[:2]))
    noise *= step / period * np.sum(np.square(window))
    moving, turning = np.moveaxis(np.array(transforms), 1, 0)
    return _Segments(frequency, moving, turning, noise, min(_BAND_HZ[1], _SHARE_OF_RATE / step))


def _means(at: Array, width: float, t: Array, x: Array) -> Array:
    """Return means (m, k) over ``width`` s around times (m,) of columns (n, k), linear between
    times (n,).
    """
    sums = cumulative_trapezoid(x, t, axis=0, initial=0.0)
    return (resampled(at + 0.5 * width, t, sums) - resampled(at - 0.5 * width, t, sums)) / width


def _mixing(vehicle: Vehicle | None) -> Array:
    """Return roll and pitch (2, 4) of squared rotor speeds."""
    return SIDES if vehicle is None else vehicle.mixing[1:3]


def _turns(log: FlightLog, piece: Rows) -> tuple[Array, Array]:
    """Return the times (n,) and the summed turns (n, 3) of the attitude in some rows."""
    return log.t[piece], np.vstack([np.zeros(3), turned(log.quaternion[piece])])


def answer_to_noise(log: FlightLog, vehicle: Vehicle | None, late: float) -> Pair | None:
    """Return by how much (s) the rotor speeds answer the pose's noise ahead of its rows, and the
    width (s) of the differences. None: there is no answer, or the pose shows no white noise.

    The loop's own reaction makes the answer later. Second differences leave a pose its noise; the
    moments pass the same differences, which smear the answer over their width.

    Args:
        log: the flight, with rotor speeds.
        vehicle: as declared; None: rotors on one side turn the body to the other.
        late: s, of the pose behind the rotor speeds. Turns by moments of so much earlier, a row
            more or less, are no noise.
    """
    log = excerpt([log])[0]
    rows = np.flatnonzero(log.valid)
    step, fine = median_step(log.t[rows]), max(log.period, _FINEST)
    apart = max(1, round(_APART / step))  # rows
    width = apart * step
    most = round(FARTHEST / fine)
    lags = fine * np.arange(-most, most + 1)
    products, count = np.zeros(len(lags)), 0
    moments = np.square(log.rotor_speeds) @ _mixing(vehicle).T
    turns = moments - moments.mean(axis=0)
    for _ in range(2):
        turns = cumulative_trapezoid(turns, log.t, axis=0, initial=0.0)
    for piece in unbroken(log.t, rows, 1.5 * step, _FEWEST_POSES):
        t, angles = _turns(log, piece)
        at, angles = t[apart:-apart], angles[:, :2]
        noise = angles[2 * apart :] - 2.0 * angles[apart:-apart] + angles[: -2 * apart]
        after = np.sum(noise[apart:] * noise[:-apart]) / np.sum(np.square(noise) + 1e-300)
        inside = (at > t[0] + lags[-1] + width) & (at < t[-1] - lags[-1] - width)
        if after > _WHITE or not inside.any():
            continue
        at, noise = at[inside], noise[inside]
        near = [second_difference(at - late - k * fine, width, log.t, turns) for k in (-1, 0, 1)]
        for axis, driven in enumerate(np.transpose(near, (2, 1, 0))):
            noise[:, axis] -= driven @ np.linalg.lstsq(driven, noise[:, axis], rcond=None)[0]
        noise = _without_size(noise)
        for i, lag in enumerate(lags):
            answer = second_difference(at - lag, width, log.t, moments)
            products[i] += np.sum(noise * _without_size(answer))
        count += noise.size
    score = np.abs(products) / np.sqrt(max(count, 1))
    peak = int(np.argmax(score))
    near = np.abs(lags - lags[peak]) <= 3.0 * width
    if score[peak] <= max(_ANSWERED, 2.0 * float(np.max(score[~near], initial=0.0))):
        return None
    weight = np.square(np.where(near & (score > 0.5 * _ANSWERED), score, 0.0))
    return float(lags @ weight / np.sum(weight)), width


def _without_size(x: Array) -> Array:
    """Return columns (n, k) over their standard deviation, without leaps."""
    clipped: Array = np.clip(x / max(robust_std(x), 1e-300), -4.0, 4.0)
    return clipped
