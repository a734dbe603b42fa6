"""The Rauch-Tung-Striebel smoother on the reference filter, with all 61 sigma points and plain
inverses: slow, and the judge. It shares no code with the fast smoother.
"""

import numpy as np

from windwrench.estimator.reference import ReferenceUKF, difference, displaced


def as_reference(estimate, near):
    """Return an estimate as a state (19,) of the reference filter, its quaternion's sign that of
    another state's.
    """
    e = estimate
    state = np.concatenate(
        [e.quaternion, e.angular_velocity, e.position, e.velocity, e.torque, e.force]
    )
    state[:4] *= np.sign(e.quaternion @ near[:4])
    return state


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
            G = C @ np.linalg.inv(P_after)
            state = displaced(x, G @ difference(later, predicted))
            found.append((state, P + G @ (P_later - P_after) @ G.T))
        return found[::-1]
