"""The filter of McKinnon and Schoellig (2016), equation by equation with all its sigma points:
slow, and the judge.

It shares no code with the package. Where the paper's text slips, the signs that hold are coded (see
docs/estimator.md).
"""

import numpy as np


def cross(a, b):
    """As ``numpy.cross``, bit for bit, without what that takes to accept any shape."""
    (ax, ay, az), (bx, by, bz) = a, b
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def multiply(a, b):
    return np.array(
        [
            a[0] * b[0] - a[1:] @ b[1:],
            *(a[0] * b[1:] + b[0] * a[1:] + cross(a[1:], b[1:])),
        ]
    )


def conjugate(q):
    return np.array([q[0], *(-q[1:])])


def skew(a):
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def matrix(q):
    """(7)"""
    q0, qv = q[0], q[1:]
    return (q0**2 - qv @ qv) * np.eye(3) + 2 * np.outer(qv, qv) + 2 * q0 * skew(qv)


def to_quaternion(rho):
    """(17)"""
    return np.array([1 - rho @ rho, *(2 * rho)]) / (1 + rho @ rho)


def to_mrp(q):
    """(16), of the sign with a non-negative scalar part"""
    q = q if q[0] >= 0 else -q
    return q[1:] / (1 + q[0])


class LiteralUKF:
    def __init__(self, vehicle, tuning, period, effect_wrench=None):
        self.v, self.t, self.T = vehicle, tuning, period
        self.effect_wrench = (
            effect_wrench  # (x, q, v, omega, rotor_speeds) -> force in world, torque in body
        )

        def three(s):
            return np.square(np.broadcast_to(s, 3).astype(float))

        self.Q = np.diag(
            np.concatenate(
                [
                    three(tuning.motor_torque_noise),
                    three(tuning.torque_walk),
                    three(tuning.thrust_noise),
                    three(tuning.force_walk),
                ]
            )
        )
        self.R = np.diag(
            np.concatenate([three(tuning.attitude_noise) / 16, three(tuning.position_noise)])
        )

    def reset(self, position, quaternion, P, velocity, omega):
        self.x = dict(
            q=np.array(quaternion, float),
            w=np.array(omega, float),
            x=np.array(position, float),
            v=np.array(velocity, float),
            tau=np.zeros(3),
            f=np.zeros(3),
        )
        self.P = np.array(P)

    def process(self, s, noise, W):
        """(2)-(5), (8)-(14)"""
        n_m, n_tau, n_c, n_f = noise[:3], noise[3:6], noise[6:9], noise[9:]
        T, v = self.T, self.v
        C = matrix(s["q"])
        c, M = v.k * W**2, v.p * W**2
        moment = np.array(
            [
                v.arm_l * (c[0] + c[1] - c[2] - c[3]),
                v.arm_l * (-c[0] + c[1] + c[2] - c[3]),
                M[0] - M[1] + M[2] - M[3],
            ]
        )
        force, torque = np.zeros(3), np.zeros(3)
        if self.effect_wrench is not None:
            force, torque = self.effect_wrench(s["x"], s["q"], s["v"], s["w"], W)
        thrust = np.array([0, 0, c.sum()])
        moment = moment - cross(v.com, thrust)
        alpha = np.linalg.solve(
            v.inertia, moment + n_m + torque + C.T @ s["tau"] - cross(s["w"], v.inertia @ s["w"])
        )
        a = (C @ (thrust + n_c) + s["f"] + force) / v.mass - np.array([0, 0, v.gravity])
        a = a - C @ (cross(alpha, v.com) + cross(s["w"], cross(s["w"], v.com)))
        angle = np.linalg.norm(s["w"]) * T / 2
        psi = np.sin(angle) * s["w"] / np.linalg.norm(s["w"]) if angle > 0 else np.zeros(3)
        omega = np.zeros((4, 4))  # (13): right multiplication by the body rate, so -[psi]x
        omega[0, 0], omega[0, 1:], omega[1:, 0] = np.cos(angle), -psi, psi
        omega[1:, 1:] = np.cos(angle) * np.eye(3) - skew(psi)
        return dict(
            q=omega @ s["q"],
            w=s["w"] + T * alpha,
            x=s["x"] + T * s["v"] + T**2 / 2 * a,
            v=s["v"] + T * a,
            tau=s["tau"] + n_tau,
            f=s["f"] + n_f,
        )

    def displaced(self, e):
        s = self.x
        return dict(
            q=multiply(to_quaternion(e[:3]), s["q"]),
            w=s["w"] + e[3:6],
            x=s["x"] + e[6:9],
            v=s["v"] + e[9:12],
            tau=s["tau"] + e[12:15],
            f=s["f"] + e[15:18],
        )

    def fold(self, centre, mean):
        self.x = centre
        self.x = self.displaced(mean)
        self.x["q"] = self.x["q"] / np.linalg.norm(self.x["q"])

    def weights(self, L):
        """(28): they sum to one"""
        kappa = self.t.kappa
        return np.concatenate([[kappa / (L + kappa)], np.full(2 * L, 1 / (2 * (L + kappa)))])

    def predict(self, W):
        L = 30
        root = np.linalg.cholesky(
            (L + self.t.kappa)
            * np.block([[self.P, np.zeros((18, 12))], [np.zeros((12, 18)), self.Q]])
        )
        points = np.concatenate([np.zeros((1, L)), root.T, -root.T])  # 61
        after = [self.process(self.displaced(p[:18]), p[18:], W) for p in points]
        centre = after[0]
        errors = np.array(
            [
                np.concatenate(
                    [
                        to_mrp(multiply(s["q"], conjugate(centre["q"]))),
                        s["w"] - centre["w"],
                        s["x"] - centre["x"],
                        s["v"] - centre["v"],
                        s["tau"] - centre["tau"],
                        s["f"] - centre["f"],
                    ]
                )
                for s in after
            ]
        )  # (25)
        w = self.weights(L)
        mean = w @ errors  # (26)
        self.P = (w[:, None] * (errors - mean)).T @ (errors - mean)  # (27)
        self.fold(centre, mean)

    def correct(self, position, quaternion):
        L = 24
        root = np.linalg.cholesky(
            (L + self.t.kappa)
            * np.block([[self.P, np.zeros((18, 6))], [np.zeros((6, 18)), self.R]])
        )
        points = np.concatenate(
            [np.zeros((1, L)), root.T, -root.T]
        )  # 49, redrawn: no second Q or R
        w = self.weights(L)
        predicted = np.array([np.concatenate([p[0:3], p[6:9]]) + p[18:] for p in points])
        z_mean = w @ predicted
        dz, dx = predicted - z_mean, points[:, :18] - w @ points[:, :18]
        S = (w[:, None] * dz).T @ dz
        K = ((w[:, None] * dx).T @ dz) @ np.linalg.inv(S)
        innovation = np.concatenate(
            [to_mrp(multiply(quaternion, conjugate(self.x["q"]))), position - self.x["x"]]
        )
        innovation = innovation - z_mean
        self.P = self.P - K @ S @ K.T
        self.nis = innovation @ np.linalg.solve(S, innovation)
        self.fold(dict(self.x), K @ innovation)
