"""Filtering of a log's noise before it was written, by the spectrum of its channels.

A sensor's own noise is white: its spectrum is level up to half the sampling rate. The motion of a
rigid body is not up there, since rotors and inertia are low-passes of their own. In some logs the
upper half of the band still falls, as behind a low-pass, an estimator or a resampling. Then no part
of the log shows the noise at the frequencies of the motion: the rest at the top is a lower bound.
"""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ..logs.flight_log import FlightLog
from ..logs.table import Array, Mask, Names, Pair, finite_rows, median_step
from .smoothing import turned, unbroken

# shares of half the sampling rate between which the slope is read: above a vehicle's motion, below
# the last bins, which rounding and jitter of the clock fill
BAND = (0.5, 0.95)
SEGMENT = 128  # samples of a spectrum's segment
# power of 1/f by which the amplitude falls over the band. White noise has 0, unfiltered poses of
# cameras and onboard attitudes up to 1.0 (vibration), a first-order low-pass 1
MOST_SLOPE = 1.2
# for fast logs: ratio of the level between these shares of half the sampling rate to the level at
# the top of the band. White noise has 1; a first-order filter, like an estimator's own, has 2, at a
# slope no larger than a vibrating camera's
LOWER_BAND = (0.2, 0.35)
_SHARES = np.arange(1, SEGMENT // 2 + 1) / (SEGMENT // 2)  # of half the sampling rate


class _ChannelNoise(NamedTuple):
    """The fall of one channel's noise towards half the sampling rate."""

    channel: str  # position, attitude, gyro, accelerometer, rotor speeds
    slope: float  # power of 1/f of the amplitude; 0 of white noise
    # amplitude in a lower band over the amplitude at the top, 1 of white noise; NaN where the log
    # is too slow for a band above the motion
    fall: float
    band_hz: Pair  # of the slope

    @property
    def filtered(self) -> bool:
        """Whether it falls faster than an unfiltered sensor's noise."""
        # a rotor with a lag is a first-order low-pass itself, and its speed is no sensor's noise.
        # Recordings of the presets have slopes up to 1.9
        most = MOST_SLOPE + (self.channel == ROTORS)
        return self.slope > most or (self.fall > 1.5 and self.channel in POSE_CHANNELS)


POSE_CHANNELS = ("position", "attitude")
ROTORS = "rotor speeds"


@lru_cache(maxsize=1)  # a diagnosis asks three times
def noise_spectra(log: FlightLog) -> list[_ChannelNoise]:
    """Return the fall of the noise of each of a log's channels, without channels that are too short
    or never change.
    """
    out = []
    for channel, pieces, period in _channels(log):
        if (amplitude := _amplitudes(pieces)) is not None:
            nyquist = 0.5 / period
            band = BAND[0] * nyquist, BAND[1] * nyquist
            fall = _fall(amplitude, nyquist)
            out.append(_ChannelNoise(channel, _slope(amplitude), fall, band))
    return out


def _channels(log: FlightLog) -> Iterator[tuple[str, list[Array], float]]:
    """Yield the name, the unbroken pieces (n, k) and the period (s) of each channel with a
    measurement a row: the spectrum of others is the reader's interpolation.
    """
    quaternion = np.where(log.valid[:, None], log.quaternion, [1.0, 0.0, 0.0, 0.0])
    position = np.where(log.valid[:, None], log.position, np.nan)
    for name, x in (
        ("position", position),
        ("attitude", position),
        ("gyro", log.gyro),
        ("accelerometer", log.accelerometer),
        (ROTORS, None if log.commanded else log.rotor_speeds),
    ):
        if x is None or len(rows := np.flatnonzero(finite_rows(x))) <= SEGMENT:
            continue
        period = median_step(log.t[rows])
        rate = log.rates.get("rotors" if name == ROTORS else name, np.inf)
        if name not in POSE_CHANNELS and rate * period < 0.9:
            continue
        pieces = unbroken(log.t, rows, 2.5 * period, SEGMENT)  # a lost sample is no gap
        yield name, [turned(quaternion[r]) if name == "attitude" else x[r] for r in pieces], period


def _amplitudes(pieces: Sequence[Array]) -> Array | None:
    """Return logarithms of the amplitude (f, k) of pieces (n, k); None for too short ones.

    The power is the median of half overlapping segments: a leap of the pose, or a touch of the
    ground, spoils some of them.
    """
    # second differences, against leakage of slow motion
    rough = [np.diff(piece, 2, axis=0) for piece in pieces]
    segments = [
        x[a : a + SEGMENT] for x in rough for a in range(0, len(x) - SEGMENT + 1, SEGMENT // 2)
    ]
    if len(segments) < 8:  # the slope's own error is above 0.2
        return None
    spectra = np.fft.rfft(np.hanning(SEGMENT)[:, None] * np.array(segments), axis=1)[:, 1:]
    power = np.median(np.square(np.abs(spectra)), axis=0)
    moving = power.max(axis=0) > 0.0
    if not moving.any():
        return None
    undone = (2.0 * np.sin(0.5 * np.pi * _SHARES)) ** 4
    return np.asarray(0.5 * np.log(np.maximum(power[:, moving] / undone[:, None], 1e-300)))


def _within(low: float, high: float) -> Mask:
    """Return the frequencies (f,) between two shares of half the sampling rate."""
    return (low <= _SHARES) & (high >= _SHARES)


def _slope(amplitude: Array) -> float:
    """Return the power of 1/f by which the amplitude falls over the band: the median channel's."""
    inside = _within(*BAND)
    at = np.log(_SHARES[inside])
    at -= at.mean()
    return float(np.median(-(at @ amplitude[inside] / (at @ at))))


def _fall(amplitude: Array, nyquist: float) -> float:
    """Return the amplitude in the lower band over the amplitude at the top; NaN if motion may be in
    the lower band.
    """
    if LOWER_BAND[0] * nyquist < 20.0:  # a vehicle's motion ends below
        return np.nan
    lower, top = amplitude[_within(*LOWER_BAND)], amplitude[_within(0.8, BAND[1])]
    return float(np.exp(np.median(lower.mean(axis=0) - top.mean(axis=0))))


def filtering_notes(log: FlightLog) -> Names:
    """Return, as sentences, the filtered channels of a log, the evidence for the filter, and its
    consequence.
    """
    filtered = [noise for noise in noise_spectra(log) if noise.filtered]
    pose = [noise for noise in filtered if noise.channel in POSE_CHANNELS]
    groups = [pose, *([noise] for noise in filtered if noise not in pose)]
    return tuple(map(_sentence, filter(None, groups)))


def _sentence(group: Sequence[_ChannelNoise]) -> str:
    """Return the sentence on channels of one kind; the clearest of them is the evidence."""
    clearest = max(group, key=lambda noise: (noise.slope, noise.fall))
    low, high = clearest.band_hz
    how = f"falls with the power {clearest.slope:.1f} of the frequency"
    if clearest.slope <= MOST_SLOPE:
        how = f"is {clearest.fall:.1f} times that near {high:.3g} Hz"
        low, high = (share * high / BAND[1] for share in LOWER_BAND)
    means = (
        "The log does not show how large the sensors' noise is, so the noise floor is a lower bound"
        if clearest.channel in POSE_CHANNELS
        else "Its noise cannot be read from this log"
    )
    what = " and ".join(noise.channel for noise in group)
    were = "were" if len(group) > 1 or what.endswith("s") else "was"
    return (
        f"the {what} {were} filtered before the log was written, by a low-pass, an estimator or a "
        f"resampling: between {low:.3g} and {high:.3g} Hz, above a vehicle's motion, the amplitude "
        f"of the {clearest.channel} {how}, where a sensor's own noise is level. {means}"
    )


def pose_was_filtered(log: FlightLog) -> bool:
    """Return whether a log's pose was filtered, with its noise hidden."""
    return any(n.filtered for n in noise_spectra(log) if n.channel in POSE_CHANNELS)
