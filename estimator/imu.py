"""Gyro and accelerometer as further measurements of the same filter.

The paper says that it "can easily be extended to GPS and IMU". A gyro measures the body rate. An
accelerometer at the geometric centre measures the specific force ``R' (a + g)``, with the
acceleration ``a`` of (4): it sees the external force at once, where a pose sees it only after two
integrations. What the rotor model misses (``thrust_noise``) is in the measured acceleration too and
cannot be told from the force in one sample, so it counts as noise of the measurement. Sensors with
a bias must be corrected before.
"""

import math

import numpy as np

from ..dynamics.model import apply_effects
from ..dynamics.motion import accelerations
from ..dynamics.rotation import quaternion_to_matrix
from ..runtime.compiled import Record, compiled
from .error_state import displace, fold, symmetrise
from .estimate import NIS, Array
from .filter_record import N


@compiled
def expected_imu(f: Record, x: Array, out: Array) -> None:
    """Write what gyro and accelerometer would measure in a state ``x`` into ``out`` (6,)."""
    R = f.rotation
    quaternion_to_matrix(x[3:7], R)
    apply_effects(f, x[0:3], R, x[7:10], x[10:13])
    accelerations(
        f.body, R, x[10:13], f.rotor_wrench, x[13:16], x[16:19], f.effect_wrench, f.acceleration
    )
    a = f.acceleration
    for i in range(3):
        out[i] = x[10 + i]
        out[3 + i] = R[0, i] * a[0] + R[1, i] * a[1] + R[2, i] * (a[2] + f.body.gravity)


@compiled
def take_in_imu(record: Record, z: Array, gyro: bool, accelerometer: bool) -> None:
    """Correct with what is measured of ``z`` (6,), gyro and accelerometer: (27)-(37) with its 37
    sigma points.
    """
    f = record[0]
    x, P = f.x, f.P
    first, last = 0 if gyro else 3, 6 if accelerometer else 3
    if first >= last:
        return
    spread, weight = math.sqrt(N + f.kappa), 0.5 / (N + f.kappa)  # (28)
    root = np.linalg.cholesky(P)
    centre, plus, minus = np.empty(6), np.empty(6), np.empty(6)
    expected_imu(f, x, centre)
    differences, sums = np.zeros((N, 6)), np.zeros(6)
    S = np.zeros((6, 6))
    column = np.empty(N)
    for j in range(N):
        for i in range(N):
            column[i] = root[i, j]
        displace(x, column, spread, f.rho, f.q, f.point)
        expected_imu(f, f.point, plus)
        displace(x, column, -spread, f.rho, f.q, f.point)
        expected_imu(f, f.point, minus)
        for a in range(6):
            differences[j, a] = 0.5 * (plus[a] - minus[a])
            sums[a] += weight * (plus[a] + minus[a] - 2.0 * centre[a])
            for b in range(a + 1):
                S[a, b] += weight * (
                    (plus[a] - centre[a]) * (plus[b] - centre[b])
                    + (minus[a] - centre[a]) * (minus[b] - centre[b])
                )
    count = last - first
    covariance, cross, innovation = np.empty((count, count)), np.zeros((N, count)), np.empty(count)
    for a in range(count):
        innovation[a] = z[first + a] - centre[first + a] - sums[first + a]
        for b in range(a + 1):
            covariance[a, b] = S[first + a, first + b] - sums[first + a] * sums[first + b]
            covariance[b, a] = covariance[a, b]
        covariance[a, a] += f.imu_noise[first + a]
        if first + a >= 3:
            covariance[a, a] += f.thrust[first + a - 3] / (f.body.mass * f.body.mass)
        # a column and its difference are both ``spread`` long, and 2 weight spread^2 = 1
        for i in range(N):
            for j in range(i + 1):
                cross[i, a] += root[i, j] * differences[j, first + a] / spread
    gain = np.linalg.solve(covariance, cross.T).T
    step = gain @ innovation
    P -= gain @ cross.T
    symmetrise(P)
    for i in range(NIS):
        f.centre[i] = x[i]
    fold(f, f.centre, step)
    x[NIS] = innovation @ np.linalg.solve(covariance, innovation)
