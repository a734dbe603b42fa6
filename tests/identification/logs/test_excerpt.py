"""Long flights are looked at by windows, and what is found in them is what is
found in a short one."""

import numpy as np
import pytest

from tests.support.flown import resting
from windwrench.identification.logs.flight_log import LONGEST, excerpt
from windwrench.identification.motion.signals import log_signals


def long_log(seconds, period=0.02):
    t = 5.0 + period * np.arange(round(seconds / period))
    return resting(t, voltage=t, name="long")


def test_what_is_short_stays_whole():
    logs = [long_log(0.4 * LONGEST), long_log(0.5 * LONGEST)]
    assert all(excerpt(log, 0.9 * LONGEST) is log for log in logs)


@pytest.mark.parametrize("lengths", [[3600.0], [900.0, 2700.0, 30.0], [700.0, 100.0]])
def test_windows_are_spread_over_long_flights(lengths):
    logs = [long_log(seconds) for seconds in lengths]
    out = [excerpt(log, sum(lengths)) for log in logs]
    pieces = [log_signals(log) for log in out]
    kept = [sum(p.t[-1] - p.t[0] for p in each) for each in pieces]
    assert 0.8 * LONGEST < sum(kept) < 1.2 * LONGEST + 30.0
    for log, short, each in zip(logs, out, pieces, strict=True):
        if log.t[-1] - log.t[0] <= 60.0:
            assert short is log
            continue
        assert [round(p.t[-1] - p.t[0]) for p in each] == [60] * len(each)
        assert (np.diff([p.t[0] for p in each]) > 60.0).all()
        before = each[0].t[0] - log.t[0]
        behind = log.t[-1] - each[-1].t[-1]
        assert abs(before - behind) < 0.1
        assert np.array_equal(short.voltage, short.t)  # rows stay together
        assert f"{len(each)} windows" in short.notes[-1]
