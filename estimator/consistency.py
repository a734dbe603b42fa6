"""Is a filter as good as it says? Its errors against its own covariance, where the truth is known.

Bar-Shalom, Li and Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001,
section 5.4: the normalised estimation error squared (NEES) of a consistent filter is chi-squared
with as many degrees of freedom as the state has (18), the normalised innovation squared (NIS) with
as many as the measurement has (6).
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import chi2

from ..dynamics.rotation import attitude_error
from ..runtime.errors import InputError
from .estimate import Array, WrenchEstimate
from .filter_record import N

MEASURED = 6  # numbers in a pose


def state_error(
    estimate: WrenchEstimate,
    true_position: ArrayLike,
    true_quaternion: ArrayLike,
    true_velocity: ArrayLike,
    true_angular_velocity: ArrayLike,
    true_torque: ArrayLike,
    true_force: ArrayLike,
) -> Array:
    """Return truth minus estimate (18,), in the order of the covariance: (rho, omega, x, v, torque,
    force).

    rho is the world-frame MRP that turns the estimated attitude into the true one; positions are in
    m, velocities in m/s (world), body rates in rad/s, torque in Nm and force in N (world).
    """
    error = np.empty(N)
    attitude_error(np.asarray(true_quaternion, dtype=np.float64), estimate.quaternion, error[0:3])
    error[3:6] = np.subtract(true_angular_velocity, estimate.angular_velocity)
    error[6:9] = np.subtract(true_position, estimate.position)
    error[9:12] = np.subtract(true_velocity, estimate.velocity)
    error[12:15] = np.subtract(true_torque, estimate.torque)
    error[15:18] = np.subtract(true_force, estimate.force)
    return error


def nees(
    estimate: WrenchEstimate,
    true_position: ArrayLike,
    true_quaternion: ArrayLike,
    true_velocity: ArrayLike,
    true_angular_velocity: ArrayLike,
    true_torque: ArrayLike,
    true_force: ArrayLike,
) -> float:
    """Return the normalised estimation error squared of one estimate; see ``state_error`` for the
    arguments.
    """
    error = state_error(
        estimate,
        true_position,
        true_quaternion,
        true_velocity,
        true_angular_velocity,
        true_torque,
        true_force,
    )
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
