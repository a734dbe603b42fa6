"""What noise a residual has, from the log itself: the floor that sensors leave, and a filter that makes the noise white."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_ORDER = 8  # of the autoregression
_LOADING = 1e-3  # share of the variance added as white noise, so that what the low-pass took away is not blown up


def _autocovariance(noise: Array, start: Mask) -> Array:
    """Return the autocovariance (p + 1,) of a channel (rows,); ``start`` (rows,) marks the first rows of unbroken pieces."""
    lags = np.zeros(_ORDER + 1)
    for part in np.split(noise, np.flatnonzero(start)[1:]):
        n = len(part)
        if n > 2 * _ORDER:
            spectrum = np.fft.rfft(part, 2 * n)
            lags += np.fft.irfft(np.abs(spectrum) ** 2)[: _ORDER + 1]
    return lags / len(noise)


def _predictor(lags: Array) -> tuple[Array, float]:
    """Return the prediction filter (p,) of noise with this autocovariance, and the standard deviation of its innovation."""
    lags = lags.copy()
    lags[0] = lags[0] * (1.0 + _LOADING) + 1e-30
    a = solve_toeplitz(lags[:_ORDER], lags[1:])
    return a, float(np.sqrt(max(lags[0] - a @ lags[1:], 1e-12 * lags[0])))


class Whitener:
    """A filter for each channel after which the noise is white with variance one.

    Args:
        noise: (rows, 6), what is taken to be noise.
        least: (rows, 6), what sensors alone make; the noise is taken to be no less.
        start: (rows,) first rows of unbroken pieces.
        fit: (rows,) the rows that may be looked at.
    """

    def __init__(self, noise: Array, least: Array, start: Mask, fit: Mask) -> None:
        # blocks apart in time are pieces apart
        begins = start | np.concatenate([[True], fit[1:] != fit[:-1]])
        self._filters = []
        for i in range(noise.shape[1]):
            lags, floor = (_autocovariance(x[fit, i], begins[fit]) for x in (noise, least))
            missing = max(0.0, 1.0 - lags[0] / floor[0]) if floor[0] > 0 else 0.0
            self._filters.append(_predictor(lags + missing * floor))
        ends = np.flatnonzero(start)
        self._lost = np.unique(np.concatenate([np.arange(k, min(k + _ORDER, len(start))) for k in ends]))

    def __call__(self, x: Array) -> Array:
        """Return ``x`` (rows, 6) or (rows, 6, columns) whitened; the first rows of each piece become zero."""
        out = np.empty_like(x)
        for i, (a, deviation) in enumerate(self._filters):
            out[:, i] = lfilter(np.concatenate([[1.0], -a]) / deviation, [1.0], x[:, i], axis=0)
        out[self._lost] = 0.0
        return out
