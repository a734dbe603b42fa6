"""The noise of an axis is found again in poses that were made with it."""

import numpy as np
import pytest

from windwrench.identification.posterior.axis_filter import likeliest_noise, steady_noise

PERIOD = 0.005


NO_JUMPS = [np.zeros((8000, 0))], np.zeros(0, dtype=np.intp)


def made(pose, disturbance, time, count=8000, seed=3):
    """Poses of an axis that a known acceleration and a disturbance drive, that acceleration, and
    what is new in the disturbance before each."""
    rng = np.random.default_rng(seed)
    drive = np.sin(2.0 * PERIOD * np.arange(count))
    keep = np.exp(-PERIOD / time)
    x = v = d = 0.0
    out, new = np.empty(count), np.zeros(count)
    for k in range(count):
        out[k] = x
        a = drive[k] + d
        x += PERIOD * v + 0.5 * PERIOD**2 * a
        v += PERIOD * a
        fresh = disturbance * np.sqrt(1.0 - keep**2) * rng.standard_normal()
        d = keep * d + fresh
        new[min(k + 1, count - 1)] = fresh
    return out + pose * rng.standard_normal(count), drive, new


def test_the_noise_that_was_made_is_found():
    measured, drive, _ = made(1e-3, 0.3, 0.4)
    found, gains = likeliest_noise([measured], [drive], [0.0], PERIOD, 1e-6, 5e-4, 0.1, *NO_JUMPS)
    assert not len(gains)
    assert found.pose == pytest.approx(1e-3, rel=0.05)
    assert found.disturbance == pytest.approx(0.3, rel=0.35)
    assert 0.15 < found.time < 1.0


def test_what_another_sensor_says_of_a_disturbance_is_no_longer_unknown():
    measured, drive, new = made(1e-3, 0.3, 0.4)
    told = new + 0.3 * new.std() * np.random.default_rng(1).standard_normal(len(new))
    found, gains = likeliest_noise(
        [measured],
        [drive],
        [0.0],
        PERIOD,
        1e-6,
        5e-4,
        0.1,
        [told[:, None]],
        np.array([2]),
    )
    # of a disturbance, in the variance 1 of 1.09 that it tells
    assert gains[0] == pytest.approx(1.0 / 1.09, abs=0.15)
    alone, _ = likeliest_noise([measured], [drive], [0.0], PERIOD, 1e-6, 5e-4, 0.1, *NO_JUMPS)
    assert found.disturbance < 0.6 * alone.disturbance
    assert found.pose == pytest.approx(1e-3, rel=0.05)


def test_innovations_are_white_and_as_large_as_said():
    measured, drive, _ = made(1e-3, 0.3, 0.4)
    noise = steady_noise(1e-3, 0.3, 0.4, 1e-9, PERIOD)
    x = v = d = 0.0
    innovations = []
    for k in range(len(measured)):
        e = measured[k] - x
        innovations.append(e)
        x, v, d = x + noise.gain[0] * e, v + noise.gain[1] * e, d + noise.gain[2] * e
        a = drive[k] + d
        x += PERIOD * v + 0.5 * PERIOD**2 * a
        v += PERIOD * a
        d *= np.exp(-PERIOD / noise.time)
    e = np.array(innovations[400:]) / noise.innovation
    assert np.mean(e**2) == pytest.approx(1.0, abs=0.06)  # NIS of one axis
    for lag in (1, 5, 20):
        assert abs(np.mean(e[lag:] * e[:-lag])) < 0.05
