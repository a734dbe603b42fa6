"""The steady filter of disturbances against one written out, for every kind of sensor."""

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are

from windwrench.identification.inference.disturbance_filter import innovations

PERIOD, TIME, STRENGTH = 0.01, 0.3, 50.0


@pytest.mark.parametrize("integrals", [0, 1, 2])
def test_innovations_are_those_of_a_kalman_filter(integrals: int) -> None:
    """What a sensor shows of a disturbed acceleration, by a filter that runs step by step."""
    rng = np.random.default_rng(integrals)
    measured, drive = rng.standard_normal((2, 300))
    n = integrals + 1
    A = np.diag(np.ones(n - 1), 1)
    A[-1, -1] = -1.0 / TIME
    F = expm(A * PERIOD)
    noise = np.zeros((n, n))  # of the disturbance over a period, by quadrature
    for s in (np.arange(2000) + 0.5) * PERIOD / 2000:
        reach = expm(A * s)[:, -1]
        noise += 2.0 * STRENGTH / TIME * np.outer(reach, reach) * PERIOD / 2000
    H = np.eye(1, n)
    P = solve_discrete_are(F.T, H.T, noise, np.eye(1))
    gain = (P @ H.T / (P[0, 0] + 1.0))[:, 0]
    step = {0: [0.0], 1: [PERIOD, 0.0], 2: [0.5 * PERIOD**2, PERIOD, 0.0]}[integrals]
    x, expected = np.zeros(n), []
    for k in range(len(measured)):
        seen = measured[k] - (drive[k] if integrals == 0 else 0.0)
        expected.append(seen - x[0])
        x = x + gain * expected[-1]
        acting = 0.5 * (drive[k] + drive[min(k + 1, len(drive) - 1)])
        x = F @ x + np.array(step) * acting
    found = innovations(measured[:, None], drive[:, None], STRENGTH, TIME, PERIOD, integrals)
    np.testing.assert_allclose(found[:, 0], expected, atol=1e-5)
