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


def test_disturbances_count_as_noise_by_their_strength():
    rng = np.random.default_rng(2)
    quiet = 0.01 * rng.standard_normal((ROWS, 6))
    gusts = 0.1 * coloured(rng, np.exp(-PERIOD / 0.25))
    calm, windy = (
        Whitener(quiet + x, quiet, NOWHERE, EVERYWHERE, PERIOD) for x in (0.0 * gusts, gusts)
    )
    slow = np.sin(2.0 * np.pi * 0.3 * PERIOD * np.arange(ROWS))[:, None] * np.full(6, 0.05)
    assert np.mean(windy(slow) ** 2) < 0.1 * np.mean(calm(slow) ** 2)


def test_the_first_rows_of_each_piece_are_lost():
    start = NOWHERE | (np.arange(ROWS) == 3000)
    noise = np.random.default_rng(3).standard_normal((ROWS, 6))
    white = Whitener(noise, noise, start, EVERYWHERE, PERIOD)(noise)
    for begin in (0, 3000):
        assert not white[begin : begin + WHITENING.order].any()
        assert white[begin + WHITENING.order :].any()
