"""How fast the estimated force and torque follow a step: the steady filter along one axis."""

import numpy as np
from scipy.linalg import solve_discrete_are

from ..dynamics.vehicle import Vehicle
from .estimate import Array
from .tuning import UKFTuning, decay_of

_LONGEST = 1_000_000  # steps


def rise_times(vehicle: Vehicle, tuning: UKFTuning, period: float) -> tuple[Array, Array]:
    """Return the 10-90 % rise times (3,) s of the estimated force and (3,) s of the torque, along
    x, y, z near hover, with a pose every period.

    If the white noise of the model dominates the pose's, this is about ``2.2 * period *
    thrust_noise / force_walk``. Otherwise the pose's noise slows the filter down further.

    Args:
        vehicle: whose mass and inertia are used.
        tuning: deviations per step.
        period: s.
    """
    of, mass, inertia = tuning, np.full(3, vehicle.mass), np.diagonal(vehicle.inertia)
    return (
        _rise(period, mass, of.thrust_noise, of.force_walk, of.force_time, of.position_noise),
        _rise(
            *(period, inertia, of.motor_torque_noise, of.torque_walk),
            *(of.torque_time, of.attitude_noise),
        ),
    )


@np.vectorize(otypes=[float])
def _rise(dt: float, inertia: float, white: float, walk: float, time: float, noise: float) -> float:
    """Return the rise time (s) of the wrench w in ``inertia * x'' = w`` with measured x: from 10 to
    90 % of the final estimate of a steady wrench.
    """
    # in units of the noise, time in periods: w is then the change of x in a step squared
    scale = dt * dt / inertia / noise
    decay, grown = decay_of(time, dt, dt)
    A = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, decay]])
    b = np.array([0.5, 1.0, 0.0]) * white * scale
    Q = np.outer(b, b)
    Q[2, 2] = grown * (walk * scale) ** 2
    C = np.array([[1.0, 0.0, 0.0]])
    P = solve_discrete_are(A.T, C.T, Q, np.eye(1))
    gain = P[:, 0] / (P[0, 0] + 1.0)
    remainder = np.eye(3) - np.outer(gain, C[0])
    input_ = remainder @ [0.0, 0.0, 1.0 - decay]  # the truth does not decay
    # share of a unit step that never shows
    rest = np.linalg.solve(np.eye(3) - remainder @ A, input_)[2]
    error = np.array([0.0, 0.0, 1.0])  # truth minus estimate
    response = [0.0]
    while response[-1] < 0.9:
        if len(response) > _LONGEST:
            return float("inf")
        error = remainder @ (A @ error) + input_
        response.append((1.0 - float(error[2])) / (1.0 - rest))
    start, end = np.interp((0.1, 0.9), response, np.arange(len(response)))
    return float(end - start) * dt
