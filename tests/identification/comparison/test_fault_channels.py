"""The streams on the grid: means are exact, and nothing is read where the model does not hold."""

import numpy as np
import pytest

from windwrench.dynamics import InputError
from windwrench.identification.comparison.fault_channels import Channels, channels_of_log, sample
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.logs.streams import Stream


def hover(seconds=8.0, rate=200.0, command_rate=200.0, **changed):
    rng = np.random.default_rng(0)
    t, u = np.arange(0.0, seconds, 1.0 / rate), np.arange(0.0, seconds, 1.0 / command_rate)
    streams = {
        "gyro": 0.01 * rng.standard_normal((len(t), 3)),
        "accelerometer": np.tile([0.0, 0.0, 9.81], (len(t), 1)),
        "command": np.full((len(u), 4), 0.4),
    } | changed
    times = {"command": u}
    return Channels("hover.csv", *(Stream(k, times.get(k, t), x) for k, x in streams.items()))


def test_nothing_is_read_behind_a_clipped_gyro_or_an_impact():
    t = np.arange(0.0, 8.0, 0.005)
    clipped = np.zeros((len(t), 3))
    clipped[:, 0] = np.clip(40.0 * (t - 6.0), 0.0, 500.0 * np.pi / 180.0)
    samples = sample(hover(gyro=clipped))
    assert samples.ended == "the gyro was at its limit"
    assert samples.t[-1] == pytest.approx(6.0 + 8.73 / 40.0, abs=0.03)
    hit = np.tile([0.0, 0.0, 9.81], (len(t), 1))
    hit[t > 7.0, 1] = 90.0
    samples = sample(hover(accelerometer=hit))
    assert samples.ended == "the vehicle hit something"
    assert samples.t[-1] < 7.0
    turning = np.zeros((len(t), 3))
    turning[:, 2] = 2.0  # a steady turn is no clipped gyro
    assert sample(hover(gyro=turning)).ended == ""


def test_what_cannot_show_a_fault_is_refused():
    with pytest.raises(InputError, match=r"hover\.csv: 0 s in flight; expected at least 3 s"):
        sample(hover(seconds=1.4))
    with pytest.raises(InputError, match="fewer than ten samples"):
        sample(hover(seconds=0.04))
    t = np.arange(10.0)
    log = FlightLog(t, np.zeros((10, 3)), np.tile([1.0, 0, 0, 0], (10, 1)), np.ones((10, 4)))
    with pytest.raises(InputError, match="no gyro or no accelerometer"):
        channels_of_log(log)
