"""The reference filter and a Rauch-Tung-Striebel smoother on it, with all 61 sigma points and plain
inverses: slow, and the judges of the fast ones. They share no code with them.
"""

import numpy as np
from numpy.linalg import inv
from numpy.random import default_rng
from scipy.spatial.transform import Rotation

from windwrench.dynamics.effects import compile_effects
from windwrench.estimator.reference import ReferenceUKF, difference, displaced

KIT_ORDER = np.r_[3:7, 10:13, 0:3, 7:10, 13:19]  # of the kit's state, to be the reference's
CORNERS = np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])  # of the rotors, in arms


def as_reference(estimate, near):
    """Return an estimate as a state (19,) of the reference filter, its quaternion's sign that of
    another state's.
    """
    state = estimate.state[KIT_ORDER]
    state[:4] *= np.sign(state[:4] @ near[:4])
    return state


def initial_covariance(seed=1):
    """Return a start (18, 18) in which everything is correlated with everything."""
    rng = default_rng(seed)
    A = np.eye(18) + 0.15 * rng.standard_normal((18, 18))
    scale = np.repeat([0.003, 0.3, 0.003, 0.1, 0.02, 0.3], 3)
    return (A @ A.T) * np.outer(scale, scale)


def rotor_effects(vehicle, drag=0.0, ground=0.0):
    """Return the wrench of rotor drag and ground effect, written out, about the centre of mass.

    Args:
        vehicle: as declared, with its effects.
        drag: coefficient of rotor_drag along x and y.
        ground: the coefficient of ground_effect.
    """
    com = compile_effects(vehicle).vehicle.com

    def wrench(x, q, v, w, W):
        C = Rotation.from_quat(q, scalar_first=True).as_matrix()
        force = np.zeros(3)
        torque = np.zeros(3)
        for corner, rate, k in zip(CORNERS, W, vehicle.k, strict=True):
            r = vehicle.arm_l * corner
            ratio = ground * (vehicle.rotor_radius / (4 * (x + C @ r)[2])) ** 2
            lift = k * rate**2 * (1 / (1 - ratio) - 1)
            f = [0, 0, lift] - rate * drag * (C.T @ v + np.cross(w, r)) * [1, 1, 0]
            force = force + C @ f
            torque = torque + np.cross(r - com, f)
        return force, torque

    return wrench


class ReferenceSmoother(ReferenceUKF):
    def reset(self, *start):
        super().reset(*start)
        self.links = []  # state and covariance before, cross covariance, and both after

    def predict(self, W):
        before = self.state, self.covariance
        super().predict(W)
        self.links.append((*before, self.cross_covariance, self.state, self.covariance))

    def smoothed(self):
        """Return states and covariances at the start and after every step."""
        found = [(self.state, self.covariance)]
        for x, P, C, predicted, P_after in reversed(self.links):
            later, P_later = found[-1]
            G = C @ inv(P_after)
            state = displaced(x, G @ difference(later, predicted))
            found.append((state, P + G @ (P_later - P_after) @ G.T))
        return found[::-1]
