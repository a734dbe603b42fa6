"""Noise becomes white with variance one, and an effect that lasts does not become noise."""

import numpy as np
import pytest
from scipy.signal import lfilter

from windwrench.identification.inference.whitening import WHITENING, Whitener

PERIOD, ROWS = 0.04, 6000
NOWHERE = np.arange(ROWS) == 0
EVERYWHERE = np.ones(ROWS, dtype=np.bool_)


def coloured(rng, pole):
    """Noise of variance one that remembers by ``pole``."""
    return lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], rng.standard_normal((ROWS, 6)), axis=0)


@pytest.mark.parametrize("pole", [0.0, 0.6, 0.9])
def test_the_sensors_noise_becomes_white(pole):
    rng = np.random.default_rng(0)
    noise = 0.01 * coloured(rng, pole)
    whiten = Whitener(noise, noise, NOWHERE, EVERYWHERE, PERIOD)
    white = whiten(0.01 * coloured(rng, pole))[WHITENING.order :]
    # a tenth is allowed for: the sensors may be noisier than a sample of them
    assert np.mean(white**2) == pytest.approx(1.0 / WHITENING.sensor_noise_factor, rel=0.05)
    for lag in (1, 2, 5):
        assert abs(np.mean(white[lag:] * white[:-lag])) < 0.05


def test_a_constant_that_nothing_explains_stays():
    """It is no noise: a filter free to follow it would hide it."""
    rng = np.random.default_rng(1)
    noise = 0.01 * rng.standard_normal((ROWS, 6))
    plain, off = (
        Whitener(noise + shift, noise, NOWHERE, EVERYWHERE, PERIOD) for shift in (0.0, 0.1)
    )
    constant = np.full((ROWS, 6), 0.1)
    assert np.mean(off(constant)[50:] ** 2) > 0.5 * np.mean(plain(constant)[50:] ** 2) > 1.0
