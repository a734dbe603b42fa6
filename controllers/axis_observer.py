"""A Kalman filter of one axis of the flight loop and its vehicle (``axis_models``).

Further states are the external wrench, the wrench filter's estimate, and an accelerometer's bias.
"""

from dataclasses import dataclass

import numpy as np

from ..runtime.arrays import Array
from .axis_models import RATE, SPEED, TILT, AxisModel

_BELIEVED = 1e-12  # added to the variance of each state, so that the equations can be solved
_BIAS_TIME = 300.0  # s, over which the accelerometer's bias lasts
_SETTLED = 250  # decisions after which the Kalman gain hardly changes
# standard deviations of the states at the start: place, speed, tilt and its rates, integral, set
# point; upwards place, speed, the rotors' acceleration, integral
_START = (0.05, 0.2, 0.1, 0.5, 5.0, 0.3, 0.05)
_START_UPWARDS = (0.05, 0.2, 1.0, 0.3)


@dataclass(frozen=True)
class WrenchProcess:
    """The external force (N), and on a horizontal axis the torque (Nm), as Ornstein-Uhlenbeck
    processes. Their estimates follow behind a lag of first order.
    """

    sizes: tuple[float, ...]  # standard deviations
    times: tuple[float, ...]  # s, correlation times
    lag: float  # s, of the estimates


@dataclass(frozen=True, eq=False)
class AxisFilter:
    """The model of a decision and its Kalman gains. The states (n,) are the axis's, the wrench
    (k,), the estimated wrench (k,), and the bias, if any.
    """

    A: Array  # (n, n)
    B: Array  # (n,)
    C: Array  # (seen, n)
    gains: Array  # (decisions, n, seen), of the first decisions; the last stands for all others


def axis_filter(
    axis: AxisModel,
    period: float,
    wrench: WrenchProcess,
    model: tuple[float, float],
    noise: tuple[float, ...],
    bias: float = 0.0,
) -> AxisFilter:
    """Return the Kalman filter of an axis.

    Args:
        axis: its model.
        period: s, of a decision.
        wrench: the external wrench.
        model: m/s2 and rad/s2 that the model lacks, per root of a second.
        noise: standard deviations of the observed quantities: the first states of the axis, then
            the estimated wrench (k,), then, with a bias, the accelerometer less the rotors
            (m/s2).
        bias: m/s2, standard deviation of the accelerometer's bias; 0: no accelerometer.
    """
    n, k = axis.D.shape
    sizes, times, with_bias = np.array(wrench.sizes), np.array(wrench.times), int(bias > 0.0)
    count, seen = n + 2 * k + with_bias, len(noise)
    force, estimates = slice(n, n + k), slice(n + k, n + 2 * k)
    A, B, C = np.zeros((count, count)), np.zeros((count, 1)), np.zeros((seen, count))
    A[:n, :n], A[:n, force], B[:n] = axis.A, axis.D, axis.B
    A[force, force], A[estimates, force] = -np.diag(1.0 / times), np.eye(k) / wrench.lag
    A[estimates, estimates] = -A[estimates, force]
    spread = np.zeros(count)
    spread[SPEED], spread[force] = model[0] ** 2, 2.0 * sizes**2 / times
    if k == 2:
        spread[RATE] = model[1] ** 2
    direct = seen - k - with_bias
    C[range(direct), range(direct)] = 1.0
    C[direct : direct + k, estimates] = np.eye(k)
    begin = [*(_START if k == 2 else _START_UPWARDS)[:n], *sizes, *sizes]
    if with_bias:
        A[-1, -1], spread[-1] = -1.0 / _BIAS_TIME, 2.0 * bias**2 / _BIAS_TIME
        C[-1, n], C[-1, -1] = axis.D[SPEED, 0], 1.0
        begin.append(bias)
    held = AxisModel(A, B, np.zeros((count, 0))).held(period)
    process = _process_noise(A, np.diag(spread), period) + _BELIEVED * np.eye(count)
    gains = _kalman_gains(held[0], C, process, np.diag(noise) ** 2, np.diag(begin) ** 2)
    return AxisFilter(held[0], held[1][:, 0], C, gains)


class AxisObserver:
    """The states of an axis through an episode; ``state`` (n,) is the newest estimate."""

    def __init__(self, model: AxisFilter) -> None:
        self.model = model
        self.reset()

    def reset(self) -> None:
        """Forget the last episode."""
        self.state, self._count = np.zeros(len(self.model.A)), 0

    def update(self, action: float, seen: Array, turned: float = 0.0) -> Array:
        """Return the states (n,) after a decision at ``action`` and the observation ``seen``.

        ``turned`` is the reference's change since the last decision: tilt in rad, upwards m/s2.
        """
        model, x = self.model, self.state
        if self._count:
            x = model.A @ x + model.B * action
            x[TILT] -= turned
        gain = model.gains[min(self._count, len(model.gains) - 1)]
        self.state, self._count = x + gain @ (seen - model.C @ x), self._count + 1
        return self.state


def _kalman_gains(A: Array, C: Array, process: Array, noise: Array, P: Array) -> Array:
    """Return the Kalman gains (decisions, states, seen), from the covariance ``P`` of the states
    before the first observation on.
    """
    gains = np.empty((_SETTLED, len(A), len(C)))
    for gain in gains:
        shown = P @ C.T
        gain[:] = np.linalg.solve(C @ shown + noise, shown.T).T
        P = A @ (P - gain @ shown.T) @ A.T + process
        P = 0.5 * (P + P.T)
    return gains


def _process_noise(A: Array, spread: Array, period: float) -> Array:
    """Return the covariance of white noise of density ``spread`` (n, n) over a decision (Van Loan,
    IEEE TAC 23(3), 1978).
    """
    from scipy.linalg import expm

    n = len(A)
    whole = np.zeros((2 * n, 2 * n))
    whole[:n, :n], whole[:n, n:], whole[n:, n:] = -A, spread, A.T
    step = np.asarray(expm(period * whole))
    noise: Array = step[n:, n:].T @ step[:n, n:]
    return 0.5 * (noise + noise.T)
