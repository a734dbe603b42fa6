"""The Rauch-Tung-Striebel smoother on the literal filter, with all 61 sigma points and plain
inverses: slow, and the judge. It shares no code with the package.
"""

import numpy as np

from tests.support.literal_ukf import LiteralUKF, conjugate, multiply, to_mrp


def difference(a, b):
    return np.concatenate(
        [
            to_mrp(multiply(a["q"], conjugate(b["q"]))),
            *(a[n] - b[n] for n in ("w", "x", "v", "tau", "f")),
        ]
    )


class LiteralSmoother(LiteralUKF):
    def reset(self, *start):
        super().reset(*start)
        self.links = []  # state and covariance before, cross covariance, and both after

    def predict(self, W):
        L = 30
        root = np.linalg.cholesky(
            (L + self.t.kappa)
            * np.block([[self.P, np.zeros((18, 12))], [np.zeros((12, 18)), self.Q]])
        )
        points = np.concatenate([np.zeros((1, L)), root.T, -root.T])
        after = [self.process(self.displaced(p[:18]), p[18:], W) for p in points]
        errors = np.array([difference(s, after[0]) for s in after])
        w = self.weights(L)
        C = (w[:, None] * points[:, :18]).T @ (errors - w @ errors)
        before = dict(self.x), self.P
        super().predict(W)
        self.links.append((*before, C, dict(self.x), self.P))

    def smoothed(self):
        """Return states and covariances at the start and after every step."""
        found = [(dict(self.x), self.P)]
        for x, P, C, predicted, P_after in reversed(self.links):
            later, P_later = found[-1]
            G = C @ np.linalg.inv(P_after)
            self.x = x
            state = self.displaced(G @ difference(later, predicted))
            found.append((state, P + G @ (P_later - P_after) @ G.T))
        return found[::-1]
