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

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..motion.smoothing import (
    high_pass,
    resampled,
    robust_std,
    running_integral,
    second_difference,
    turned,
    unbroken,
)
from .evidence import SIDES
from .flight_log import FlightLog, SomeVehicle, excerpt
from .table import Array, Pair, Rows, median_step

FARTHEST = 0.3  # s, of the search
# s: smaller delays are of filters, and of stamps at a sample's end
LEAST = 0.01
SURE = 4.0  # standard deviations
_STEP = 0.001  # s, of the search
_DELAYS = _STEP * np.arange(-300.0, 301.0)
_SEGMENT = 2.0  # s, of a spectrum
_PARTS = 5  # of the flight; the scatter of their delays is the uncertainty
_FEWEST = 10  # segments
_ANSWERED = 6.0  # standard deviations of a chance correlation

Spectra = NDArray[np.complex128]


class _PoseDelay(NamedTuple):
    """A delay of the pose behind the rotor speeds; negative: ahead."""

    seconds: float
    std: float
    beyond_honest: bool  # whether no honest delay with any lag of the motors is as likely


class _Response(NamedTuple):
    """Measured response of turns to moments: (f, 2) by frequency and axis, roll and pitch."""

    omega: Array  # (f, 1) rad/s
    gain: Spectra
    weight: Array  # one over the variance of the real part

    def explained(self, delays: Array, lag: float = 0.0) -> Array:
        """Return the deviance that the moments explain at each of some delays (n,) in s, at the
        best gain of each axis.
        """
        shape = np.exp(-1j * self.omega * delays[:, None, None]) / (1.0 + 1j * self.omega * lag)
        along = (self.weight * np.real(np.conj(shape) * self.gain)).sum(axis=1)
        power = (self.weight * abs(shape) ** 2).sum(axis=1)
        return np.asarray((np.maximum(along, 0.0) ** 2 / power).sum(axis=1))

    def likeliest(self) -> float:
        """Return the likeliest delay, s."""
        return float(_DELAYS[self.explained(_DELAYS).argmax()])


def pose_delay(log: FlightLog, vehicle: SomeVehicle) -> _PoseDelay | None:
    """Return the delay of a log's pose behind its rotor speeds; None: the flight does not show one.

    Args:
        log: the flight, with rotor speeds.
        vehicle: as declared; None: rotors on one side turn the body to the other.
    """
    log = excerpt(log)
    if log.valid.sum() < _FEWEST:
        return None
    segments, response_of = _spectra(log, vehicle)
    late = 0.0
    for _ in range(10):  # a window over delayed signals cuts the two of them differently
        both = segments(late)
        if len(both[0]) < _FEWEST:
            return None
        response = response_of(*both)
        step = response.likeliest()
        late = float(np.clip(late + step, -FARTHEST, FARTHEST))
        if step == 0.0:
            break
    best = response.explained(np.zeros(1))[0]
    whole = response.weight * abs(response.gain) ** 2
    left = whole.sum() - best
    scale = max(1.0, left / (2.0 * whole.size - 3.0))  # beyond what noise leaves
    if best < 40.0 * scale:
        return None
    # gusts answered by the loop leave a response of another shape, and turn its phase by as much
    misfit = np.sqrt(left / (response.omega**2 * whole).sum())
    parts = zip(*(np.array_split(x, _PARTS) for x in both), strict=True)
    scatter = np.std([response_of(*part).likeliest() for part in parts])
    std = float(np.hypot(scatter / np.sqrt(_PARTS), misfit))
    # s: rotor speeds of flown vehicles act by up to 0.04 later (a flight loop falls over more), and
    # those that pass a filter of their own by up to 0.03 earlier
    honest = np.arange(-0.03, 0.04 + _STEP, _STEP)
    # a lag, of motors behind a command that was logged for a speed; with a delay together 0.1
    as_good = max(
        response.explained(honest[honest <= 0.1 - lag] - late, lag).max()
        for lag in 0.01 * np.arange(11)
    )
    return _PoseDelay(late, std, bool(best - as_good > 9.0 * scale))


def _spectra(
    log: FlightLog, vehicle: SomeVehicle
) -> tuple[Callable[[float], Spectra], Callable[..., _Response]]:
    """Return two functions: the transforms (2, n, f, 2) of moments and of turns in segments of a
    flight with the pose moved so many s back; and the frequency response of some of the segments.
    """
    rows = np.flatnonzero(log.valid)
    step = median_step(log.t[rows])
    period = max(0.01, log.period)
    count = max(2, round(_SEGMENT / period))
    inertia = np.eye(3) if vehicle is None else vehicle.inertia
    window = np.hanning(count)[:, None]
    moments = running_integral(_moments(log, vehicle), log.t)
    turns, noises = [], [0.0]
    for piece in unbroken(log.t, rows, max(0.1, 3.5 * step), 60, _SEGMENT):
        angles = _angles(log, piece)
        # above a quarter of the poses' rate is noise alone
        noises.append(robust_std(high_pass(angles, 0.25)))
        turns.append((log.t[piece], running_integral(angles, log.t[piece])))
    frequency = np.fft.rfftfreq(count, period).astype(float)
    band = (frequency >= 0.8) & (frequency <= min(10.0, 0.4 / step))
    frequency = frequency[band, None]
    omega = 2.0 * np.pi * frequency
    # white noise of the angles, through the mean over a period and two differences
    passed = np.sinc(frequency * period) * (2.0 * np.sin(0.5 * omega * period)) ** 2
    mean = sum(noises) / max(1, len(turns))
    noise = (passed / period**2 * mean * np.diag(inertia)[:2]) ** 2
    noise *= step / period * (window**2).sum()

    def segments(late: float) -> Spectra:
        transforms = []
        for t, sums in turns:
            first = max(t[0], log.t[0] + late) + period
            at = np.arange(first, min(t[-1], log.t[-1] + late) - period, period)
            turn = _means(at, period, t, sums)
            w = (turn[2:] - turn[:-2]) / (2.0 * period)
            alpha = np.diff(turn, n=2, axis=0) / period**2
            needed = (alpha @ inertia + np.cross(w, w @ inertia))[:, :2]
            both = np.stack([_means(at[1:-1] - late, period, log.t, moments), needed])
            for begin in range(0, len(needed) - count + 1, count // 2):
                part = both[:, begin : begin + count]
                part = window * (part - part.mean(axis=1, keepdims=True))
                transforms.append(np.fft.rfft(part, axis=1)[:, band])
        return np.reshape(transforms, (len(transforms), 2, len(frequency), 2)).swapaxes(0, 1)

    def response(moment: Spectra, turning: Spectra) -> _Response:
        xx, yy = ((abs(z) ** 2).mean(axis=0) + 1e-300 for z in (moment, turning))
        xy = (np.conj(moment) * turning).mean(axis=0)
        left = np.maximum(yy - abs(xy) ** 2 / xx, 1e-12 * yy)
        # a half overlapping segment counts for 0.55 independent ones
        variance = left / (1.1 * len(moment)) + noise
        return _Response(omega, xy / xx, xx / variance)

    return segments, response


def _means(at: Array, width: float, t: Array, sums: Array) -> Array:
    """Return means (m, k) over ``width`` s around times (m,) of columns by their integrals (n, k)
    over times (n,).
    """
    return (resampled(at + 0.5 * width, t, sums) - resampled(at - 0.5 * width, t, sums)) / width


def _moments(log: FlightLog, vehicle: SomeVehicle) -> Array:
    """Return the rotors' roll and pitch moments (N, 2); without a vehicle, in no unit."""
    return log.rotor_speeds**2 @ (SIDES if vehicle is None else vehicle.mixing[1:3]).T


def _angles(log: FlightLog, piece: Rows) -> Array:
    """Return the summed turns (n, 3) of the attitude in some rows."""
    return np.vstack([np.zeros(3), turned(log.quaternion[piece])])


def answer_to_noise(log: FlightLog, vehicle: SomeVehicle, late: float) -> Pair | None:
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
    log = excerpt(log)
    rows = np.flatnonzero(log.valid)
    step, fine = median_step(log.t[rows]), max(log.period, 0.005)
    apart = max(1, round(0.01 / step))  # rows
    width = apart * step
    most = round(FARTHEST / fine)
    lags = fine * np.arange(-most, most + 1)
    products, count = np.zeros(len(lags)), 0
    moments = _moments(log, vehicle)
    turns = moments - moments.mean(axis=0)
    for _ in range(2):
        turns = running_integral(turns, log.t)
    for piece in unbroken(log.t, rows, 1.5 * step, 100):
        t, angles = log.t[piece], _angles(log, piece)[:, :2]
        at = t[apart:-apart]
        noise = angles[2 * apart :] - 2.0 * angles[apart:-apart] + angles[: -2 * apart]
        after = (noise[apart:] * noise[:-apart]).sum() / (noise**2 + 1e-300).sum()
        inside = (at > t[0] + lags[-1] + width) & (at < t[-1] - lags[-1] - width)
        # the differences' correlation with the next ones: -2/3 of white noise, above 0 of motion
        if after > -0.5 or not inside.any():
            continue
        at, noise = at[inside], noise[inside]
        driven = np.hstack(
            [second_difference(at - late - k * fine, width, log.t, turns) for k in (-1, 0, 1)]
        )
        noise -= driven @ np.linalg.lstsq(driven, noise, rcond=None)[0]
        noise = _without_size(noise)
        answers = (second_difference(at - lag, width, log.t, moments) for lag in lags)
        products += [(noise * _without_size(answer)).sum() for answer in answers]
        count += noise.size
    score = abs(products) / np.sqrt(max(count, 1))
    peak = int(score.argmax())
    near = abs(lags - lags[peak]) <= 3.0 * width
    if score[peak] <= max(_ANSWERED, 2.0 * score[~near].max(initial=0.0)):
        return None
    seen = near & (score > 0.5 * _ANSWERED)
    return float(np.average(lags[seen], weights=score[seen] ** 2)), width


def _without_size(x: Array) -> Array:
    """Return columns (n, k) over their standard deviation, without leaps."""
    return (x / max(robust_std(x), 1e-300)).clip(-4.0, 4.0)
