"""The evidence of sets, against integrals that are done by numbers."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from windwrench.identification.diagnosis.evidence import (
    Marginal,
    evidence_of_one_more,
    marginal,
    set_evidence,
    tempering,
)


def by_numbers(normal, right, low, high):
    """The integral of the likelihood over a normal prior that is cut off at its bounds."""

    def density(z):
        return math.exp(right * z - 0.5 * normal * z * z - 0.5 * z * z)

    low, high = max(low, -12.0), min(high, 12.0)
    share = quad(lambda z: math.exp(-0.5 * z * z), low, high)[0]
    return math.log(quad(density, low, high)[0] / share)


@pytest.mark.parametrize(("right", "low"), [(3.0, -np.inf), (-4.0, 0.0), (-0.5, -np.inf)])
def test_the_evidence_of_one_coefficient_is_the_integral(right, low):
    found = set_evidence(
        Marginal(np.array([[2.0]]), np.array([right]), 0.0),
        [0],
        np.array([low]),
        np.array([np.inf]),
    )
    assert found.log_evidence == pytest.approx(by_numbers(2.0, right, low, np.inf), abs=1e-6)
    assert found.mode[0] == pytest.approx(max(right / 3.0, low))


def test_a_likelihood_is_tempered_where_its_scores_scatter_too_much():
    rng = np.random.default_rng(2)
    x, noise = rng.standard_normal((40, 100, 3)), rng.standard_normal((40, 100))
    alike = np.repeat(rng.standard_normal((40, 5)), 20, axis=1)  # one error for 20 samples
    slow = np.repeat(rng.standard_normal((40, 5, 3)), 20, axis=1)

    def power(x, y):
        both = np.concatenate([x, y[..., None]], axis=2)
        return tempering(np.einsum("bni,bnj->bij", both, both), np.arange(3))

    assert power(x, noise) > 0.75
    assert power(slow, alike) < 0.1


def test_one_more_column_is_worth_the_mean_of_its_bayes_factors():
    rng = np.random.default_rng(4)
    x, y = rng.standard_normal((200, 4)), rng.standard_normal(200)
    y += 0.4 * x[:, 3]
    normal, right = x.T @ x, x.T @ y

    def evidence(columns, size):
        at = np.array(columns)
        own = np.array([1.0, 1.0, size])[: len(at)]
        inner = normal[np.ix_(at, at)] * own[:, None] * own + np.eye(len(at))
        b = right[at] * own
        return 0.5 * b @ np.linalg.solve(inner, b) - 0.5 * np.linalg.slogdet(inner)[1]

    sizes = (0.1, 1.0)
    m = marginal(normal, right, 0.0, np.array([2, 3]), np.array([0, 1]), np.ones(2))
    found = evidence_of_one_more(m, [0, 1], sizes)
    each = [evidence([0, 1, c], s) - evidence([0, 1], s) for c in (2, 3) for s in sizes]
    assert found == pytest.approx(np.logaddexp.reduce(each) - math.log(4.0))
    assert found > 5.0
    assert evidence_of_one_more(m, [0], sizes) < 0.0
