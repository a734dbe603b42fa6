"""The optimal law of the tasks in the wind, with the estimated wrench as its measure of wind: a
linear-quadratic Gaussian regulator (LQG).

It commands the flight loop by the oracle's (``preview``) model of the loop (``axis_models``), and
by the same weight of a position error. Only the two laws' knowledge differs.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..dynamics.vehicle import Vehicle
from ..runtime.errors import InputError
from .axis_models import AxisModel, axis_models, tilting
from .briefing import Briefing, standard_vehicle
from .preview import regulator
from .wind_observation import (
    FORCE,
    MAX_ACCELERATION,
    POSITION_ERROR,
    REFERENCE_ACCELERATION,
    REFERENCE_VELOCITY,
    ROTOR_FORCE,
    SPECIFIC_FORCE,
    TORQUE,
    VELOCITY,
    WIND_PERIOD,
)

Array = NDArray[np.floating[Any]]
Wide = NDArray[np.float64]
_BELIEVED = 1e-12  # added to the variance of each state, so that the equations can be solved


@dataclass(eq=False)
class LQG:
    """A linear-quadratic Gaussian regulator with the external force and torque as states.

    Each axis is a Kalman filter and a regulator (Anderson and Moore, *Optimal Control: Linear
    Quadratic Methods*, 1990). Force and torque are Ornstein-Uhlenbeck processes. Their estimates
    from the wrench filter follow behind a lag of first order. The accelerometer less the rotors'
    force shows the force at once, but biased; the rotors' force shows the tilt. The torque matters:
    a tilt comes before any motion.

    Everything but ``effort`` describes measured quantities, and little more than their order of
    size matters. Sizes and times of the wrench, and the lag of its estimates, were halved and
    doubled. The error on WindHover's base changed by at most 4.2 % (16 validation episodes).

    Raises:
        InputError: a number is not above zero.
    """

    effort: float = 1e-5  # m2 of error that an acceleration of 1 m/s2 is worth
    force: float = 0.065  # of the weight, standard deviation of the external force
    torque: float = 0.035  # of weight times arm, likewise
    force_time: float = 1.0  # s, over which the force lasts
    torque_time: float = 0.5  # s
    estimate_lag: float = 0.2  # s, of the estimates; a rise time of 0.45 s over 2.2
    noise: Mapping[str, float] = field(
        default_factory=lambda: {
            "place": 0.002,  # m
            "speed": 0.02,  # m/s
            "tilt": 0.01,  # rad
            "force": 0.02,  # N, of the estimate
            "torque": 0.002,  # Nm, likewise
            "accelerometer": 0.11,  # m/s2, mean over a decision, with its bias
        }
    )
    model: tuple[float, float] = (0.05, 0.5)  # m/s2 and rad/s2 that it lacks, per root of a second
    vehicle: Vehicle = field(default_factory=standard_vehicle)

    def __post_init__(self) -> None:
        for name in ("effort", "force", "torque", "force_time", "torque_time", "estimate_lag"):
            if not getattr(self, name) > 0.0:
                raise InputError(f"LQG: {name} must be above 0, got {getattr(self, name)!r}")
        self._axes = [self._axis(axis) for axis in axis_models(self.vehicle)]
        self.reset()

    def brief(self, briefing: Briefing) -> None:
        """Fly the declared vehicle."""
        self.vehicle = briefing.vehicle
        self.__post_init__()

    def reset(self) -> None:
        """Forget the last episode."""
        self._states: list[Wide] = []
        self._action = np.zeros(3)

    def _axis(self, axis: AxisModel) -> tuple[Wide, ...]:
        """Return A, B, C, the Kalman gain and the regulator's of an axis with its disturbances and
        their estimates.
        """
        from scipy.linalg import solve_discrete_are

        n, k = axis.D.shape
        weight, said = self.vehicle.weight, self.noise
        times = np.array([self.force_time, self.torque_time])[:k]
        sizes = np.array([self.force * weight, self.torque * weight * self.vehicle.arm_l])[:k]
        none, one = np.zeros((k, k)), np.eye(k)
        A = np.block(
            [
                [axis.A, axis.D, np.zeros((n, k))],
                [np.zeros((k, n)), -one / times, none],
                [np.zeros((k, n)), one / self.estimate_lag, -one / self.estimate_lag],
            ]
        )
        B = np.vstack([axis.B, np.zeros((2 * k, 1))])
        spread = np.zeros(n + 2 * k)
        spread[1], spread[n : n + k] = self.model[0] ** 2, 2.0 * sizes**2 / times
        shown = [0, 1]
        if k == 2:
            spread[3] = self.model[1] ** 2
            shown.append(2)
        C = np.zeros((len(shown) + k + 1, n + 2 * k))
        C[range(len(shown)), shown] = 1.0
        C[len(shown) : -1, n + k :], C[-1, n] = one, axis.D[1, 0]
        names = ("place", "speed", "tilt")[: len(shown)] + ("force", "torque")[:k]
        noise = np.diag([said[name] ** 2 for name in (*names, "accelerometer")])
        held = AxisModel(A, B, np.zeros((n + 2 * k, 0))).held(WIND_PERIOD)
        process = _process_noise(A, np.diag(spread)) + _BELIEVED * np.eye(len(A))
        P = solve_discrete_are(held[0].T, C.T, process, noise)
        gain = P @ C.T @ np.linalg.inv(C @ P @ C.T + noise)
        return held[0], held[1], C, gain, regulator(held[0], held[1], self.effort)[0]

    def __call__(self, observation: Array, info: Mapping[str, Any] | None = None) -> Array:
        """Return the action (3,) m/s2 for an observation (27,)."""
        o = np.asarray(observation, dtype=np.float64)
        place, speed = -o[POSITION_ERROR], o[VELOCITY] - o[REFERENCE_VELOCITY]
        rotors, felt = o[ROTOR_FORCE], o[SPECIFIC_FORCE] - o[ROTOR_FORCE]
        tilt = (rotors - o[REFERENCE_ACCELERATION]) / self.vehicle.gravity
        torque = tilting(o[TORQUE])
        states, action = [], np.zeros(3)
        for i, (A, B, C, gain, wanted) in enumerate(self._axes):
            seen = [place[i], speed[i], o[FORCE][i], felt[i]]
            if i < 2:
                seen = [place[i], speed[i], tilt[i], o[FORCE][i], torque[i], felt[i]]
            y = np.array(seen)
            if self._states:
                x = A @ self._states[i] + B[:, 0] * self._action[i]
            else:
                x = np.linalg.lstsq(C, y, rcond=None)[0]
            x = x + gain @ (y - C @ x)
            states.append(x)
            action[i] = -float(wanted[0] @ x)
        self._states = states
        self._action = np.minimum(np.maximum(action, -MAX_ACCELERATION), MAX_ACCELERATION)
        return self._action.astype(np.float32)


def _process_noise(A: Wide, spread: Wide) -> Wide:
    """Return the covariance of white noise of density ``spread`` (n, n) over a decision (Van Loan,
    IEEE TAC 23(3), 1978).
    """
    from scipy.linalg import expm

    n = len(A)
    whole = np.zeros((2 * n, 2 * n))
    whole[:n, :n], whole[:n, n:], whole[n:, n:] = -A, spread, A.T
    step = np.asarray(expm(WIND_PERIOD * whole))
    noise: Wide = step[n:, n:].T @ step[:n, n:]
    return 0.5 * (noise + noise.T)
