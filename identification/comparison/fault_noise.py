"""The noise of one channel: correlated, and larger while the rotors work unusually.

The weights are the size of the model's own error: a share of the rotors' deviation from the mean.
The correlation is an autoregression, fitted by least squares. Its filter turns the residual into
innovations (Willsky and Jones, *A generalized likelihood ratio approach to the detection and
estimation of jumps in linear systems*, IEEE Transactions on Automatic Control 21, 1976).
"""

from operator import itemgetter
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ...runtime.arrays import Array, Mask

ORDER = 10
SHARES = (0.0, 1.0, 3.0, 10.0, 30.0, 100.0)  # activity over the quiet level, tried in turn


class Noise(NamedTuple):
    """Weights and whitening filter of one channel (N samples)."""

    scale: Array  # (N,) relative standard deviation
    filter: Array  # (p + 1,) the autoregression's, first 1
    whole: Mask  # (N,) the p samples before are there, without a gap
    variance: float  # fitted innovations

    def whiten(self, values: Array) -> Array:
        """Return innovations (n, ...) of values (N, ...), at the rows ``whole``."""
        return self.filtered(values)[self.whole]

    def filtered(self, values: Array) -> Array:
        """Return the filter's output (N, ...); rows outside ``whole`` mean nothing."""
        from scipy.signal import lfilter  # as late as can be: it takes .6 s

        return np.asarray(lfilter(self.filter, 1.0, (values.T / self.scale).T, axis=0))

    def log_likelihood(self, rest: Array | float) -> Array:
        """Return the log-likelihood of innovations with ``rest`` as the sum of squares, at the best
        variance.
        """
        n = self.whole.sum()
        log_scale = np.log(self.scale[self.whole]).sum()
        return np.asarray(-0.5 * n * np.log(np.maximum(rest, 1e-300) / n) - log_scale)


def fit_noise(residual: Array, activity: Array, follows: Mask) -> Noise:
    """Fit the noise to a residual.

    Args:
        residual: (N,).
        activity: (N,) relative deviation of the rotors from the mean.
        follows: (N,) the sample before is there.
    """
    whole = np.convolve(follows, np.ones(ORDER))[: len(follows)] == ORDER
    whole[:ORDER] = False
    tried = []
    for share in SHARES:
        scale = np.hypot(1.0, share * activity)
        windows = sliding_window_view(residual / scale, ORDER + 1)[whole[ORDER:], ::-1]
        present, past = windows[:, 0], windows[:, 1:]
        # a ridge keeps the filter tame where a residual is next to nothing
        gram = past.T @ past + 1e-6 * (present @ present) * np.eye(ORDER)
        poles = np.linalg.solve(gram, past.T @ present)
        rest = np.square(present - past @ poles).sum()
        noise = Noise(scale, np.append(1.0, -poles), whole, rest / len(present))
        tried.append((noise.log_likelihood(rest), noise))
    return max(tried, key=itemgetter(0))[1]
