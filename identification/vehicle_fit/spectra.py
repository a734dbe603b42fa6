"""Columns of a regression as tapered Fourier transforms, and the noise's spectrum.

Least squares weighted with the residual's own spectrum is the maximum of Whittle's likelihood. In
each frequency the motion counts by its ratio to disturbance and sensor noise, so no cut-off has to
be chosen between the two. The noise model may take any shape: this is the prediction-error method,
without the bias of plain least squares in closed-loop flight (Ljung, System Identification, 1999,
section 13.4).
"""

import itertools
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from ...runtime.arrays import Array, Complex, Floats
from ..logs.table import Pair
from ..motion.smoothing import mean_square

_SEGMENT = 5.0  # s, length of one transform; the inverse is the step of frequency
TAPERS = 3  # sine tapers (Riedel and Sidorenko, 1995): a low leak, and little lost
# variance of an estimate over the information's inverse: the tapers' mean square, 1 on average,
# weighs a segment's middle more than its ends
LOSS = 1.0 + 0.5 / TAPERS
# Hz: above lie vibration and the loops' answer to noise; rotors follow no faster
BAND = 15.0
_SMOOTHING = 0.35  # spectrum's smoothing: width as a share of the frequency,
_NARROWEST = 0.4  # and at least so many Hz

Spectra = list[Array]  # of each segment


class Segment(NamedTuple):
    """One segment's transforms."""

    log: int
    span: Pair  # s, first and last sample
    frequency: Floats  # (m,) Hz
    weight: Array  # (m,): 2 of a complex number, 1 of a real one; over the number of tapers
    passed: Floats  # (m,): share of an amplitude behind the columns' low-pass
    columns: Complex  # (K, m, c): per root Hz


def segments_of(
    columns: Array, t: Array, period: float, log: int, band: float
) -> Iterator[Segment]:
    """Yield the transforms of a piece's columns (n, c) at times (n,), cut into segments of about
    equal length.
    """
    n = len(columns)
    edges = np.linspace(0, n, 1 + max(1, round(n * period / _SEGMENT))).astype(np.int64)
    for a, b in itertools.pairwise(edges):
        size = b - a
        frequency = np.fft.rfftfreq(size, period)
        inside = frequency <= min(band, 0.4 / period)
        frequency = frequency[inside]
        weight = np.where(frequency == 0.0, 1.0, 2.0) / TAPERS
        places = np.linspace(0.0, np.pi, size + 2)[1:-1]
        waves = np.sin(np.outer(np.arange(1, TAPERS + 1), places))[..., None]
        tapers = np.sqrt(2.0 * period / (size + 1)) * waves
        transforms = np.fft.rfft(tapers * columns[a:b], axis=1)[:, inside]
        passed = 1.0 / (1.0 + (frequency / band) ** 4)
        yield Segment(log, (t[a], t[b - 1]), frequency, weight, passed, transforms)


def residual_spectra(segments: Iterable[Segment], residuals: Iterable[Complex]) -> Spectra:
    """Return, for each segment, the spectrum (m, c) of residuals with transforms (K, m, c): their
    power, smoothed over the segments of a log and over frequency, infinite where there is none.
    Segments of a log stand together.
    """
    out = []
    pairs = zip(segments, (mean_square(np.abs(x)) for x in residuals), strict=True)
    for _, group in itertools.groupby(pairs, key=lambda pair: pair[0].log):
        of_log, each = zip(*group, strict=True)
        frequency = np.concatenate([s.frequency for s in of_log])
        order = np.argsort(frequency, kind="stable")
        total = np.pad(np.cumsum(np.concatenate(each)[order], axis=0), ((1, 0), (0, 0)))
        half = 0.5 * np.maximum(_SMOOTHING * frequency, _NARROWEST) + 1e-9
        low, high = np.searchsorted(frequency[order], [frequency - half, frequency + half])
        mean = (total[high] - total[low]) / (high - low)[:, None]
        ends = np.cumsum([*map(len, each)])[:-1]
        out += np.split(np.where(mean > 0.0, mean, np.inf), ends)
    return out
