"""Is a filter as good as it says? Its errors against its own covariance, where the truth is known.

Bar-Shalom, Li and Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001,
section 5.4: the normalised estimation error squared (NEES) of a consistent filter is chi-squared
with as many degrees of freedom as the state has (18), the normalised innovation squared (NIS) with
as many as the measurement has (6).
"""

import numpy as np
from scipy.stats import chi2

from ..runtime.errors import InputError
from .error_state import error_from
from .estimate import Array, WrenchEstimate
from .filter_record import N

MEASURED = 6  # numbers in a pose


def state_error(estimate: WrenchEstimate, truth: Array) -> Array:
    """Return truth minus estimate (18,), in the order of the covariance: (rho, omega, x, v, torque,
    force).

    rho is the world-frame MRP that turns the estimated attitude into the true one. ``truth`` (20,)
    is a state laid out by the constants of ``estimator.estimate``.
    """
    error = np.empty(N)
    error_from(truth, estimate.state, error)
    return error


def nees(estimate: WrenchEstimate, truth: Array) -> float:
    """Return the normalised estimation error squared; arguments as of ``state_error``."""
    error = state_error(estimate, truth)
    return float(error @ np.linalg.solve(estimate.covariance, error))


def chi2_band(dof: int, runs: int, probability: float = 0.95) -> tuple[float, float]:
    """Return the band in which the mean of ``runs`` independent chi-squared numbers lies with
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
    return float(chi2.ppf(tail, dof * runs)) / runs, float(chi2.ppf(1.0 - tail, dof * runs)) / runs
