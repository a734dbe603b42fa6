"""Candidate regressors: columns of what a flight excites, and a resonance that is one."""

import numpy as np
import pytest

from tests.support.searches import VEHICLE, recorded
from windwrench.identification.inference.candidate_regressors import (
    REGRESSORS,
    _resonant_response,
    explanatory_variables,
    general_regressors,
    resonant_regressors,
    standardised,
)
from windwrench.identification.inference.regression import Flights


def flights_of(trajectory):
    return Flights([recorded(trajectory, 12.0)], VEHICLE)


@pytest.fixture(scope="module")
def excited():
    return flights_of("excite")


def test_variables_are_of_one_size_and_only_what_varies(excited):
    known = standardised(explanatory_variables(excited, {}))
    for name, x in known.items():
        assert x.mean() == pytest.approx(0.0, abs=1e-9), name
        assert x.std() == pytest.approx(1.0), name
    assert {"body velocity x", "speed", "thrust", "time"} <= set(known)
    hover = standardised(explanatory_variables(flights_of("hover"), {}))
    assert not {"body velocity x", "world position x"} & set(hover)


def test_a_column_is_one_variable_in_one_channel(excited):
    found = list(general_regressors(excited, {}))
    assert len({words[:2] for words in found}) == len(found)
    for channel, name, column in found:
        assert column.shape == (len(excited.t), 6)
        moved = np.flatnonzero(np.any(column != 0.0, axis=0))
        if channel.startswith("force along body"):
            assert set(moved) <= {0, 1, 2}, name
            assert not column[:, 3:].any()
        else:
            assert len(moved) == 1, name


def test_resonances_are_of_loads_and_of_mounts(excited):
    words = [name for _, name, _ in resonant_regressors(excited, {})]
    loads = len(REGRESSORS.load_frequencies_hz)
    assert len(words) >= loads
    assert (len(words) - loads) % len(REGRESSORS.mount_frequencies_hz) == 0


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
