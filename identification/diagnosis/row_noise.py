"""The noise of force rows: a vector autoregression over all channels.

A disturbance is in the pose's channel and in the accelerometer's, an error of the pose in one
alone: the covariance of the innovations says which. Noise that is correlated in time would explain
slow effects if it were fitted first, so the fit begins with white noise, and the noise is what the
whole library leaves.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


ROUNDS = 3  # of the noise and of what is explained beside it
MOST_LAGS = 3
ROWS_PER_NUMBER = 12  # and channel, that a lag must have
# share of the variance added as white noise, so that what the low-pass took is not blown up
LOADING = 0.01


@dataclass(frozen=True, eq=False)
class RowNoise:
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
        """The rows (n,) that have all rows before them that the autoregression needs."""
        since = np.arange(len(self.begins))
        first = since[self.begins][np.cumsum(self.begins) - 1]
        return np.asarray(since - first >= len(self.lags))

    def white(self, x: Array) -> Array:
        """Return rows (n, c, ...) after which noise is white with variance one; those that are not
        ``known`` mean nothing.
        """
        out = x.copy()
        for k, a in enumerate(self.lags, start=1):
            out[k:] -= np.einsum("ij,nj...->ni...", a, x[:-k])
        root = np.linalg.inv(np.linalg.cholesky(self.covariance))
        return np.asarray(np.einsum("ij,nj...->ni...", root, out))


def white_noise(x: Array, begins: Mask, fit: Mask, least: Array) -> RowNoise:
    """Return noise without memory of the size of rows ``x`` (n, c), of the rows ``fit``, and of
    ``least`` (c,).
    """
    size = _size(x[fit], least)
    return RowNoise(np.zeros((0, x.shape[1], x.shape[1])), np.diag(size**2), begins)


def _size(x: Array, least: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(np.square(x), axis=0) + np.square(least)))


def fitted_noise(x: Array, begins: Mask, fit: Mask, least: Array) -> RowNoise:
    """Return the noise of which rows ``x`` (n, c) are a sample, of the rows ``fit`` (n,): least
    squares, with a little white noise added, and white noise of ``least`` (c,).
    """
    channels = x.shape[1]
    rows = int(fit.sum())
    lags = int(np.clip(rows // (ROWS_PER_NUMBER * channels), 1, MOST_LAGS))
    size = _size(x[fit], least)
    z = x / size
    use = fit & RowNoise(np.zeros((lags, channels, channels)), np.eye(channels), begins).known
    for k in range(1, lags + 1):
        use[k:] &= fit[:-k]
    at = np.flatnonzero(use)
    past = np.column_stack([z[at - k] for k in range(1, lags + 1)])
    now = z[at]
    loading = len(at) * (LOADING + np.square(least / size))
    normal = past.T @ past + np.diag(np.tile(loading, lags))
    found = np.linalg.solve(normal, past.T @ now)
    left = now.T @ now + np.diag(loading) - found.T @ (past.T @ now)
    covariance = left / max(len(at) - lags * channels, 1)
    parts = [found[k * channels : (k + 1) * channels].T for k in range(lags)]
    return RowNoise(
        np.array([size[:, None] * a / size for a in parts]),
        size[:, None] * covariance * size,
        begins,
    )
