"""Candidate regressors: columns of what a flight excites, and a resonance that is one."""

import numpy as np
import pytest

from windwrench.identification.inference.candidate_regressors import (
    REGRESSORS,
    _resonant_response,
)


@pytest.mark.parametrize("hertz", [0.5, 2.0])
def test_a_response_is_that_of_a_spring(hertz):
    """The base is pushed once; the mass rings at its frequency and dies by its damping."""
    period = 0.001
    drive = np.zeros(round(4.0 / hertz / period))
    drive[1] = 1.0 / period
    found = _resonant_response(drive, hertz, period)
    rate, damping = 2.0 * np.pi * hertz, REGRESSORS.damping_ratio
    t = period * (np.arange(len(drive)) - 1.0)
    own = rate * np.sqrt(1.0 - damping**2)
    s = np.where(t >= 0.0, -np.exp(-damping * rate * t) * np.sin(own * t) / own, 0.0)
    pull = rate**2 * s + 2.0 * damping * rate * np.gradient(s, period)
    late = slice(round(0.1 / hertz / period), None)
    assert np.abs(found - pull)[late].max() < 0.01 * np.abs(pull).max()
