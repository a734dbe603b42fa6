"""How often a channel was measured, and what results do with rotors that were measured seldom."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng

from tests.support.flown import VEHICLE, recorded
from tests.support.outcomes import refused
from tests.support.sizes import rms
from windwrench.identification import diagnose, read_log
from windwrench.identification.logs.flight_log import between_samples, source_rate, write_log
from windwrench.identification.logs.screening import screen_log
from windwrench.identification.wrench_series import estimate_log

PERIOD = 0.005  # s


def walk(rate, seconds=20.0, seed=0):
    """Times and values (n, 4) of a random walk that was sampled at a rate."""
    rng = default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / rate)
    return t, 400.0 + np.cumsum(rng.normal(size=(len(t), 4)), axis=0)


def in_lines(t, values, rate):
    """Values (n, k) on the lines between samples at a rate."""
    beats = np.arange(t[0], t[-1], 1.0 / rate)
    return np.column_stack([np.interp(t, beats, np.interp(beats, t, x)) for x in values.T])


@pytest.mark.parametrize("rate", [4.0, 10.0, 25.0, 50.0])
def test_a_channel_that_is_held_or_drawn_in_lines_keeps_its_own_rate(rate):
    times, values = walk(rate)
    t = np.arange(0.0, times[-1], PERIOD)
    held = values[np.searchsorted(times, t, side="right") - 1]
    lines = np.column_stack([np.interp(t, times + 0.0013, column) for column in values.T])
    for rows in (held, np.round(held), lines, np.round(lines, 6)):
        assert source_rate(t, rows) == pytest.approx(rate, rel=0.05)
    t, values = walk(1.0 / PERIOD)
    every = round(1.0 / (rate * PERIOD))  # in rows of its own
    values[np.arange(len(t)) % every > 0] = np.nan
    assert source_rate(t, values) == pytest.approx(rate)


@pytest.mark.parametrize("step", [1e-6, 0.3, 3.0])
def test_a_rounded_channel_is_as_fast_as_its_rows(step):
    t = np.arange(0.0, 20.0, PERIOD)
    noise = default_rng(1).normal(size=(len(t), 4))
    slow = 400.0 + 10.0 * np.sin(np.pi * t[:, None] + np.arange(4))
    for values in (slow, slow + noise, np.full((len(t), 4), 400.0)):
        assert source_rate(t, step * np.round(values / step)) == pytest.approx(1.0 / PERIOD)


def test_what_lies_between_samples_is_bounded_by_their_neighbours():
    times, values = walk(200.0, seconds=100.0)
    lines = in_lines(times, values, 4.0)
    left = rms(values - lines, axis=0)
    bound = between_samples(times, lines, 4.0)
    assert (left < bound).all()
    assert (bound < 3.0 * left).all()


def with_rotors_at(rate, log):
    """The flight with rotor speeds that were measured at a rate, in lines between."""
    return replace(log, rotor_speeds=in_lines(log.t, log.rotor_speeds, rate))


@pytest.mark.parametrize(("rate", "force"), [(4.0, True), (30.0, False)])
def test_slow_rotors_tell_no_torque_and_no_effect(rate, force, tmp_path):
    path = tmp_path / "slow.csv"
    write_log(with_rotors_at(rate, recorded(seconds=14.0, seed=3)), path)
    log = read_log(path)
    said = rf"rotor speeds come {rate:g} times a second; expected at least 45"
    with refused(said):
        screen_log(log, VEHICLE)
    with refused(said):
        diagnose([log], VEHICLE)
    series = estimate_log(log, VEHICLE)
    told = estimate_log(replace(log, rates={}), VEHICLE)
    assert np.isnan(series.torque).all()
    assert np.isnan(series.std_torque).all()
    assert np.array_equal(series.force, told.force)
    wider = series.std_force > told.std_force
    assert wider.all() if force else not wider.any()
    (words,) = [note for note in series.notes if "no torque is estimated" in note]
    assert ("A force takes 20 a second" in words) == force
