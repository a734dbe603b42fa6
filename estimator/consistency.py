"""Is a filter consistent with its covariance?

Bar-Shalom, Li and Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001,
section 5.4: the normalised estimation error squared (NEES) of a consistent filter is chi-squared
with the degrees of freedom of the state (18). The normalised innovation squared (NIS) has those of
the measurement (6). Its innovations are also white (Mehra, *On the identification of variances and
adaptive Kalman filtering*, IEEE Trans. Automatic Control 15, 1970): whitened ones, summed over a
second and divided by the root of their number, are six normal numbers again. Their squares add up
to a NIS *over a second*. Its mean exceeds the mean NIS by the innovations' autocorrelations at all
lags within a second, nearer ones weighted more. So NIS over a second shows a wrench that walks too
slowly: such a wrench pushes every pose of a second the same way by less than one pose's noise.
"""

import math

import numpy as np
from scipy.special import gammaincinv

from ..runtime.errors import InputError
from .estimate import Array, WrenchEstimate
from .reference import difference

MEASURED = 6  # numbers in a pose
_REFERENCE = np.r_[3:7, 10:13, 0:3, 7:10, 13:19]  # indices of a state, in ``reference``'s order


def state_error(estimate: WrenchEstimate, truth: Array) -> Array:
    """Return truth minus estimate (18,), in the order of the covariance: (rho, omega, x, v, torque,
    force).

    The world-frame MRP rho turns the estimated attitude into the true one. ``truth`` (20,) is a
    state laid out by the constants of ``estimator.estimate``.
    """
    return difference(truth[_REFERENCE], estimate.state[_REFERENCE])


def nees(estimate: WrenchEstimate, truth: Array) -> float:
    """Return the normalised estimation error squared; arguments as of ``state_error``."""
    error = state_error(estimate, truth)
    return float(error @ np.linalg.solve(estimate.covariance, error))


def chi2_band(dof: int, runs: int, probability: float = 0.95) -> tuple[float, float]:
    """Return the band that holds the mean of ``runs`` independent chi-squared numbers with
    ``probability``.

    Raises:
        InputError: an argument out of range.
    """
    if dof < 1 or runs < 1 or not 0.0 < probability < 1.0:
        raise InputError(
            "chi2_band: expected dof and runs of at least 1 and a probability between 0 and 1, got "
            f"{dof}, {runs}, {probability}"
        )
    tail = 0.5 * (1.0 - probability)
    low, high = (2.0 / runs * gammaincinv(0.5 * dof * runs, [tail, 1.0 - tail])).tolist()
    return low, high


class Consistency:
    """Statistics of a flight's innovations as a test of the filter's tuning, in constant memory.

    Attributes:
        poses: how many were added.
        seconds: with a pose.
    """

    def __init__(self) -> None:
        self.poses = self.seconds = 0
        self._nis = self._nis_over_seconds = 0.0  # sums; the latter's of the seconds before
        self._end = -math.inf  # s, end of this second
        self._total, self._count = (
            np.zeros(MEASURED),
            0,
        )  # sum of this second's innovations, and their number

    def add(self, t: float, white: Array) -> None:
        """Take in the whitened innovation (6,) of a pose at ``t``, s."""
        if not self._end - 1.0 <= t < self._end:
            self._nis_over_seconds += self._nis_over_this_second
            self._total, self._count, self._end = np.zeros(MEASURED), 0, t + 1.0
            self.seconds += 1
        self._nis += float(white @ white)
        self._total += white
        self._count += 1
        self.poses += 1

    @property
    def _nis_over_this_second(self) -> float:
        return float(self._total @ self._total) / max(self._count, 1)

    @property
    def nis(self) -> float:
        """Mean NIS of a pose; 6 is expected, NaN where there is none."""
        return self._nis / (self.poses or math.nan)

    @property
    def nis_over_second(self) -> float:
        """Mean NIS over a second, likewise."""
        total = self._nis_over_seconds + self._nis_over_this_second
        return total / (self.seconds or math.nan)

    @property
    def too_slow(self) -> bool:
        """Whether NIS over a second exceeds that of 99 % of consistent filters: the wrench walks
        faster than the tuning says.
        """
        return self.nis_over_second > chi2_band(MEASURED, max(self.seconds, 1), 0.98)[1]

    def as_dict(self) -> dict[str, float]:
        """Return the numbers as plain data."""
        names = ("nis", "poses", "nis_over_second", "seconds")
        return {name: getattr(self, name) for name in names}

    def __str__(self) -> str:
        low, high = chi2_band(MEASURED, max(self.seconds, 1))
        return (
            f"NIS {self.nis:.2f}, over a second {self.nis_over_second:.3g} (expected {MEASURED}; "
            f"95 % of means over {self.seconds} s from {low:.2f} to {high:.2f})"
        )
