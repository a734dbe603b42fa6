"""The paper's filter, equation by equation, with all of its sigma points: to read and to judge by.

The filter is slow, has no gate and no restart, and shares no code with the fast filters. The tests
compare the fast filters with this one. ``docs/estimator.md`` lists the errors of the printed paper;
the code has the right equations. Equation numbers are those of McKinnon and Schoellig (2016).

States are rows (..., 19): quaternion, then the parts of the error state (rho, omega, x, v, torque,
force) behind rho, in their order.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ..dynamics.motion import LONG_TURN
from ..dynamics.vehicle import Vehicle
from .estimate import Array
from .tuning import UKFTuning

ATTITUDE, RATE, POSITION = slice(0, 4), slice(4, 7), slice(7, 10)
VELOCITY, TORQUE, FORCE = slice(10, 13), slice(13, 16), slice(16, 19)
MEASURED = [0, 1, 2, 6, 7, 8]  # rows of (rho, x) in the error state

# position, quaternion, velocity, rate, rotor speeds -> force (3,) world, torque (3,) body
EffectWrench = Callable[[Array, Array, Array, Array, Array], tuple[Array, Array]]


def cross(a: Array, b: Array) -> Array:
    """Return the cross products (..., 3) of vectors, in a fifth of ``numpy.cross``'s time."""
    after, before = [1, 2, 0], [2, 0, 1]
    return a[..., after] * b[..., before] - a[..., before] * b[..., after]


def skew(a: Array) -> Array:
    """Return the matrices (..., 3, 3) of the cross products with vectors (..., 3)."""
    return cross(np.eye(3), a[..., np.newaxis, :])


def rotation_matrix(q: Array) -> Array:
    """Return matrices (..., 3, 3), body to world, of quaternions (..., 4): (7)."""
    q0, qv = q[..., 0, np.newaxis, np.newaxis], q[..., 1:, np.newaxis]
    outer = qv @ np.swapaxes(qv, -1, -2)
    square = np.trace(outer, axis1=-2, axis2=-1)[..., np.newaxis, np.newaxis]
    matrix: Array = (q0**2 - square) * np.eye(3) + 2 * outer + 2 * q0 * skew(q[..., 1:])
    return matrix


def multiply(a: Array, b: Array) -> Array:
    """Return the products (..., 4) of quaternions."""
    a0, av, b0, bv = a[..., :1], a[..., 1:], b[..., :1], b[..., 1:]
    scalar = a0 * b0 - np.sum(av * bv, axis=-1, keepdims=True)
    return np.concatenate([scalar, a0 * bv + b0 * av + cross(av, bv)], axis=-1)


def to_quaternion(rho: Array) -> Array:
    """Return the quaternions (..., 4) of MRPs (..., 3): (17)."""
    square: Array = np.sum(rho**2, axis=-1, keepdims=True)
    return np.concatenate([1 - square, 2 * rho], axis=-1) / (1 + square)


def to_mrp(q: Array) -> Array:
    """Return the MRPs (..., 3) of quaternions, taken with a non-negative scalar part: (16)."""
    q = np.where(q[..., :1] >= 0, q, -q)
    rho: Array = q[..., 1:] / (1 + q[..., :1])
    return rho


def displaced(state: Array, error: Array) -> Array:
    """Return states with an error state added, its attitude from the left: (24), (35)."""
    turned = multiply(to_quaternion(error[..., :3]), state[..., ATTITUDE])
    return np.concatenate([turned, state[..., 4:] + error[..., 3:]], axis=-1)


def difference(state: Array, other: Array) -> Array:
    """Return the error states that lead from ``other`` to states: (25)."""
    back = other[..., ATTITUDE] * [1, -1, -1, -1]
    rho = to_mrp(multiply(state[..., ATTITUDE], back))
    return np.concatenate([rho, state[..., 4:] - other[..., 4:]], axis=-1)


def _variance(*deviations: ArrayLike) -> Array:
    """Return the diagonal covariance of deviations along three axes each."""
    return np.diag(np.square(np.concatenate([np.broadcast_to(d, 3) for d in deviations])))


def _stationary(period: float, time: float) -> float:
    """Return the variance of a step of a process with a correlation time, s, over a walk's."""
    return 1.0 if np.isinf(time) else (1 - np.exp(-2 * period / time)) * time / (2 * period)


class ReferenceUKF:
    """The unscented filter of the paper.

    Args:
        vehicle: its rigid body and rotors; declared effects are not read.
        tuning: standard deviations per step.
        period: s, of a step.
        effect_wrench: the wrench of declared effects at one state.

    Attributes:
        state: (19,), see the module.
        covariance: (18, 18) of the error state.
        cross_covariance: (18, 18) of the errors before and after the last prediction.
        nis: normalised innovation squared of the last correction.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        tuning: UKFTuning,
        period: float,
        effect_wrench: EffectWrench | None = None,
    ) -> None:
        self.vehicle, self.period, self.kappa = vehicle, period, tuning.kappa
        self.effect_wrench = effect_wrench
        # an Ornstein-Uhlenbeck process, exact over a step: w' = exp(-T / time) w + n. With the
        # variance of n, w keeps the variance walk^2 time / (2 T); with an infinite time, w is a
        # walk
        times = tuning.torque_time, tuning.force_time
        decay = [np.exp(-period / np.broadcast_to(time, 3)) for time in times]
        self.torque_decay, self.force_decay = decay
        torque_walk, force_walk = (
            np.asarray(walk) * np.sqrt([_stationary(period, t) for t in np.broadcast_to(time, 3)])
            for walk, time in zip((tuning.torque_walk, tuning.force_walk), times, strict=True)
        )
        self.Q = _variance(tuning.motor_torque_noise, torque_walk, tuning.thrust_noise, force_walk)
        self.R = _variance(np.asarray(tuning.attitude_noise) / 4, tuning.position_noise)  # (16)
        self.nis = float("nan")

    def reset(
        self,
        position: ArrayLike,
        quaternion: ArrayLike,
        covariance: ArrayLike,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        """Start at a pose without an external wrench; ``covariance`` is (18, 18)."""
        still = np.zeros(6)
        self.state = np.concatenate([quaternion, angular_velocity, position, velocity, still])
        self.covariance = np.array(covariance, dtype=np.float64)

    def process(self, s: Array, noise: Array, W: Array) -> Array:
        """Return states (n, 19) after a step with noise (n, 12) and rotor speeds ``W`` (4,).

        Equations (2)-(5), (8)-(14).
        """
        v, T = self.vehicle, self.period
        n_m, n_tau, n_c, n_f = np.split(noise, 4, axis=-1)
        C, omega = rotation_matrix(s[:, ATTITUDE]), s[:, RATE]
        c, M = v.k * W**2, v.p * W**2
        moment = [
            v.arm_l * (c[0] + c[1] - c[2] - c[3]),
            v.arm_l * (-c[0] + c[1] + c[2] - c[3]),
            M[0] - M[1] + M[2] - M[3],
        ]
        thrust = np.array([0, 0, c.sum()])
        force, torque = np.zeros((2, len(s), 3))
        if self.effect_wrench is not None:
            wrenches = [
                self.effect_wrench(row[POSITION], row[ATTITUDE], row[VELOCITY], row[RATE], W)
                for row in s
            ]
            force, torque = np.swapaxes(wrenches, 0, 1)
        # (12): the world torque enters as R' tau
        torque = torque + moment - cross(v.com, thrust) + n_m
        torque = torque + np.einsum("nji,nj->ni", C, s[:, TORQUE])
        # beyond LONG_TURN a step, where (12) adds energy, the momentum turns by exp(-[omega T]x)
        g, turned = (
            cross(omega, omega @ v.inertia),
            T * np.linalg.norm(omega, axis=1, keepdims=True),
        )
        far = np.maximum(turned, LONG_TURN)
        second = T * (1 - np.cos(far)) / far**2
        rest = (1 - np.sin(far) / far) * g + second * cross(omega, g)
        torque = torque - g + np.where(turned > LONG_TURN, rest, 0)
        alpha = np.linalg.solve(v.inertia, torque.T).T
        # (4), and the way from the centre of mass to the geometric centre
        a = (np.einsum("nij,nj->ni", C, thrust + n_c) + s[:, FORCE] + force) / v.mass
        a = a - [0, 0, v.gravity]
        offset = cross(alpha, v.com) + cross(omega, cross(omega, v.com))
        a = a - np.einsum("nij,nj->ni", C, offset)
        # (11), (13): multiplication from the right by the turn of the step
        angle = turned / 2
        turn = np.hstack([np.cos(angle), np.sinc(angle / np.pi) * omega * T / 2])
        return np.hstack(
            [
                multiply(s[:, ATTITUDE], turn),
                omega + T * alpha,
                s[:, POSITION] + T * s[:, VELOCITY] + T**2 / 2 * a,
                s[:, VELOCITY] + T * a,
                self.torque_decay * s[:, TORQUE] + n_tau,
                self.force_decay * s[:, FORCE] + n_f,
            ]
        )

    def sigma_points(self, noise: Array) -> tuple[Array, Array]:
        """Return points (2 L + 1, L) of the error state and a noise, and their weights, which sum
        to one: (18)-(23), (28).
        """
        n, L = len(self.covariance), len(self.covariance) + len(noise)
        root = np.zeros((L, L))
        root[:n, :n], root[n:, n:] = np.linalg.cholesky(self.covariance), np.linalg.cholesky(noise)
        spread = np.sqrt(L + self.kappa) * root.T
        weights = np.full(2 * L + 1, 1 / (2 * (L + self.kappa)))
        weights[0] = self.kappa / (L + self.kappa)
        return np.concatenate([np.zeros((1, L)), spread, -spread]), weights

    def fold(self, centre: Array, mean: Array) -> None:
        """Make ``centre`` with the mean error the state: (26), (35), (37)."""
        self.state = displaced(centre, mean)
        self.state[ATTITUDE] /= np.linalg.norm(self.state[ATTITUDE])

    def predict(self, rotor_speeds: ArrayLike) -> None:
        """Go one period on, with 61 points."""
        points, w = self.sigma_points(self.Q)
        n = len(self.covariance)
        before, noise = points[:, :n], points[:, n:]
        after = self.process(displaced(self.state, before), noise, np.asarray(rotor_speeds))
        errors = difference(after, after[0])  # (25)
        mean = w @ errors  # (26)
        self.cross_covariance = (w[:, np.newaxis] * before).T @ (errors - mean)
        self.covariance = (w[:, np.newaxis] * (errors - mean)).T @ (errors - mean)  # (27)
        self.fold(after[0], mean)

    def correct(self, position: ArrayLike, quaternion: ArrayLike) -> None:
        """Take in a pose, with 49 points drawn anew and no second Q or R: (29)-(37)."""
        points, w = self.sigma_points(self.R)
        n = len(self.covariance)
        measured = points[:, MEASURED] + points[:, n:]
        mean = w @ measured
        dz, dx = measured - mean, points[:, :n] - w @ points[:, :n]
        S = (w[:, np.newaxis] * dz).T @ dz
        K = (w[:, np.newaxis] * dx).T @ dz @ np.linalg.inv(S)
        seen = np.concatenate([quaternion, self.state[4:]])
        seen[POSITION] = position
        innovation = difference(seen, self.state)[MEASURED] - mean
        self.covariance = self.covariance - K @ S @ K.T
        self.nis = float(innovation @ np.linalg.solve(S, innovation))
        self.fold(self.state, K @ innovation)
