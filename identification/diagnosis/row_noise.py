"""The noise of force rows: a vector autoregression over all channels.

A disturbance is in the channels of pose and accelerometer, an error of the pose in one alone: the
covariance of the innovations tells them apart. Noise with a correlation in time would explain slow
effects if fitted first. So the fit begins with white noise, and the noise is the residual beside
the whole library.
"""

from typing import NamedTuple

import numpy as np

from ..logs.table import Array, Mask
from ..motion.smoothing import mean_square

ROUNDS = 3  # of the noise and of the explained part beside it
MOST_LAGS = 3
ROWS_PER_NUMBER = 12  # and channel, for each lag
# share of the variance added as white noise, against blowing up frequencies the low-pass took
LOADING = 0.01


class RowNoise(NamedTuple):
    """Noise of rows with c channels.

    Attributes:
        lags: (p, c, c) of the autoregression.
        covariance: (c, c) of its innovations.
        begins: (n,) first rows of unbroken pieces.
    """

    lags: Array
    covariance: Array
    begins: Mask

    @property
    def known(self) -> Mask:
        """The rows (n,) with all earlier rows of the autoregression."""
        return _with_earlier(self.begins, len(self.lags))

    def white(self, x: Array) -> Array:
        """Return rows (n, c, ...) with white noise of variance one; rows outside ``known`` are
        invalid.
        """
        out = x.copy()
        for k, a in enumerate(self.lags, start=1):
            out[k:] -= np.einsum("ij,nj...->ni...", a, x[:-k])
        root = np.linalg.inv(np.linalg.cholesky(self.covariance))
        return np.asarray(np.einsum("ij,nj...->ni...", root, out))

    @classmethod
    def fitted(cls, x: Array, begins: Mask, fit: Mask, least: Array) -> "RowNoise":
        """Return the noise of rows ``x`` (n, c) from its sample ``fit`` (n,): least squares, with a
        little white noise added, and white noise of ``least`` (c,).
        """
        channels = x.shape[1]
        lags = min(max(int(fit.sum()) // (ROWS_PER_NUMBER * channels), 1), MOST_LAGS)
        size = np.sqrt(mean_square(x[fit]) + np.square(least))
        z = x / size
        use = fit & _with_earlier(begins, lags)
        each_lag = range(1, lags + 1)
        for k in each_lag:
            use[k:] &= fit[:-k]
        at = np.flatnonzero(use)
        past = np.column_stack([z[at - k] for k in each_lag])
        now = z[at]
        loading = len(at) * (LOADING + np.square(least / size))
        fitted = np.linalg.solve(past.T @ past + np.diag(np.tile(loading, lags)), past.T @ now)
        left = now.T @ now + np.diag(loading) - fitted.T @ (past.T @ now)
        covariance = left / max(len(at) - lags * channels, 1)
        each = fitted.reshape(lags, channels, channels).swapaxes(1, 2)
        return cls(size[:, None] * each / size, size[:, None] * covariance * size, begins)


def _with_earlier(begins: Mask, count: int) -> Mask:
    first = np.flatnonzero(begins)[np.cumsum(begins) - 1]
    return np.asarray(np.arange(len(begins)) - first >= count)
