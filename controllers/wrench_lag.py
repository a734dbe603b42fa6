"""How an estimated wrench follows the true one: the wrench filter in steady flight, as a linear
system, and the covariance of its errors from one decision to the next.

Along one axis the filter knows a place (or an angle), its rate, and a random walk of the wrench. A
noise of its own drives the rate, and the place is measured. Its error ``e`` obeys ``e' = (I - K C)
(A e + b dw) - K v``, with ``dw`` the true wrench's change and ``v`` the measurement noise: the
estimate is the true wrench less the third part of ``e``. Whatever is not the jet's mean is a
coloured noise with known covariance, told from decision to decision by an autoregression (Yule and
Walker).
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..runtime.arrays import Array
from .briefing import Air, FilterNoise

ORDER = 3  # the autoregression's


@dataclass(frozen=True, eq=False)
class _AxisLag:
    """One axis of the filter, from decision to decision."""

    keep: Array  # (3, 3), remainder of the error after a decision
    enter: Array  # (3,), error of an even change of the wrench in a decision
    disturbance: Array  # (ORDER + 1,) autocovariance due to a disturbance of unit variance,
    gust: Array  # (ORDER + 1,) a gust of unit variance,
    pose: Array  # (ORDER + 1,) and the noise of the pose

    @property
    def delay(self) -> float:
        """Delay of the estimate of an evenly changing wrench, in decisions."""
        return float(np.linalg.solve(np.eye(3) - self.keep, self.enter)[2])


@lru_cache(maxsize=64)
def axis_lag(
    inertia: float, noise: tuple[float, float, float], air: Air, period: float, steps: int
) -> _AxisLag:
    """Return how one axis follows.

    Args:
        inertia: kg or kg m2.
        noise: assumed noise of the model (N or Nm, a step), of the wrench's walk (likewise) and of
            the measurement (m or rad).
        air: whose times count.
        period: the filter's, s.
        steps: the filter's in a decision.
    """
    from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov

    white, walk, measured = noise
    A = np.array([[1.0, period, 0.0], [0.0, 1.0, period / inertia], [0.0, 0.0, 1.0]])
    C = np.array([[1.0, 0.0, 0.0]])
    Q = np.diag([0.0, (period / inertia * white) ** 2, walk**2])
    # scaled, so that the numbers of the equation are of one size
    scale = np.diag([measured, measured / period, measured * inertia / period**2])
    inverse = np.linalg.inv(scale)
    a, q = inverse @ A @ scale, inverse @ Q @ inverse
    P = scale @ solve_discrete_are(a.T, C.T, q, np.eye(1)) @ scale
    K = P @ C.T / (P[0, 0] + measured**2)
    remainder = np.eye(3) - K @ C
    F, b = remainder @ A, remainder[:, 2]

    def over(matrix: Array) -> Array:
        return np.asarray(np.linalg.matrix_power(matrix, steps))

    enter, power = np.zeros(3), np.eye(3)
    for _ in range(steps):
        enter += power @ b / steps
        power = F @ power

    def coloured(time: float) -> Array:
        """Return the autocovariance of the output for a unit wrench of the correlation time
        ``time``.
        """
        phi = float(np.exp(-period / time))
        whole = np.zeros((4, 4))
        whole[:3, :3], whole[:3, 3], whole[3, 3] = F, b * (phi - 1.0), phi
        drive = np.append(b, 1.0) * np.sqrt(1.0 - phi * phi)
        return _autocovariance(whole, np.outer(drive, drive), np.array([0.0, 0.0, -1.0, 1.0]))

    def _autocovariance(matrix: Array, driven: Array, output: Array) -> Array:
        S, jump = solve_discrete_lyapunov(matrix, driven), over(matrix)
        values = []
        for _ in range(ORDER + 1):
            values.append(float(output @ S @ output))
            S = jump @ S
        return np.array(values)

    pose = _autocovariance(F, K @ K.T * measured**2, np.array([0.0, 0.0, -1.0]))
    return _AxisLag(over(F), enter, coloured(air.disturbance_time), coloured(air.gust_time), pose)


def autoregressions(autocovariance: Array) -> tuple[Array, Array]:
    """Return coefficients (ORDER + 1, ORDER) and innovation variances (ORDER + 1,) of the
    autoregressions of order 0 to ORDER of a stationary process.
    """
    from scipy.linalg import solve_toeplitz

    R = np.asarray(autocovariance, dtype=np.float64)
    order = len(R) - 1
    coefficients, variances = np.zeros((order + 1, order)), np.full(order + 1, R[0])
    for m in range(1, order + 1):
        coefficients[m, :m] = solve_toeplitz(R[:m], R[1 : m + 1])
        variances[m] -= coefficients[m, :m] @ R[1 : m + 1]
    return coefficients, variances


def lags(
    mass: float, inertia_z: float, noise: FilterNoise, air: Air, decision: float
) -> tuple[_AxisLag, _AxisLag]:
    """Return how the estimated torque about z and the estimated force follow."""
    steps = max(1, round(decision / noise.period))
    torque = (noise.torque, noise.torque_walk, noise.attitude)
    force = (noise.thrust, noise.force_walk, noise.position)
    return (
        axis_lag(inertia_z, torque, air, noise.period, steps),
        axis_lag(mass, force, air, noise.period, steps),
    )
