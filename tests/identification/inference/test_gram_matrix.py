"""Least squares within bounds, as the search for effects uses it."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from windwrench.identification.inference.gram_matrix import Gram


@pytest.mark.parametrize("seed", range(40))
def test_least_squares_within_bounds_as_scipy_s(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 9))
    design = rng.standard_normal((20, n)) * 10.0 ** rng.uniform(-2, 2, n)
    design[:, 0] = design[:, -1] + 0.01 * rng.standard_normal(
        20
    )  # nearly alike: both at a bound at once
    y = rng.standard_normal(20)
    low, high = (sign * rng.random(n) * (rng.random(n) < 0.8) for sign in (-1.0, 1.0))
    high[low >= high] = 1.0
    both = np.column_stack([design, y])
    square = both.T @ both
    g = Gram(
        tuple(("", str(i)) for i in range(n)),
        both,
        np.array([0]),
        square[None],
        np.zeros(n),
        np.zeros(n),
        low,
        high,
    )
    found = g.solve(square, np.arange(n))
    best = lsq_linear(design, y, (low, high), method="bvls", tol=1e-14).x
    assert np.all(found >= low - 1e-12)
    assert np.all(found <= high + 1e-12)
    assert np.sum((design @ found - y) ** 2) == pytest.approx(
        np.sum((design @ best - y) ** 2), rel=1e-9
    )
