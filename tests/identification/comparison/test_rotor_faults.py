"""Rotor faults: the streams on the grid, and measured logs; a simulated flight is in
``tests/golden/identification.json``.
"""

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from typer.testing import CliRunner

from tests.support.data_paths import data_file
from tests.support.golden_identification import failing_flight
from tests.support.outcomes import refused
from windwrench.cli import app
from windwrench.identification.comparison.fault_channels import sample, samples_of
from windwrench.identification.logs.channels import Stream


def hover(seconds=8.0, rate=200.0, **changed):
    rng = default_rng(0)
    t = np.arange(0.0, seconds, 1.0 / rate)
    streams = {
        "gyro": 0.01 * rng.standard_normal((len(t), 3)),
        "accelerometer": np.tile([0.0, 0.0, 9.81], (len(t), 1)),
        "commands": np.full((len(t), 4), 0.4),
    } | changed
    return sample("hover.csv", **{k: Stream(k, t, x) for k, x in streams.items()})


def test_nothing_is_read_behind_a_clipped_gyro_or_an_impact():
    t = np.arange(0.0, 8.0, 0.005)
    clipped, turning = np.zeros((2, len(t), 3))
    clipped[:, 0] = np.clip(40.0 * (t - 6.0), 0.0, np.radians(500.0))
    samples = hover(gyro=clipped)
    assert samples.ended == "the gyro was at its limit"
    assert samples.t[-1] == pytest.approx(6.0 + 8.73 / 40.0, abs=0.03)
    hit = np.tile([0.0, 0.0, 9.81], (len(t), 1))
    hit[t > 7.0, 1] = 90.0
    samples = hover(accelerometer=hit)
    assert samples.ended == "the vehicle hit something"
    assert samples.t[-1] < 7.0
    turning[:, 2] = 2.0  # a steady turn is no clipped gyro
    assert hover(gyro=turning).ended is None


def test_what_cannot_show_a_fault_is_refused():
    for seconds, rate in ((1.4, 200.0), (0.04, 200.0), (8.0, 8.0)):
        with refused(r"hover\.csv: 0 s in flight .* expected at least 3 s without a gap of 0\.1 s"):
            hover(seconds, rate)
    for absent in ("gyro", "accelerometer"):
        with refused(f"no {absent}; expected all of gyro, accelerometer and motor commands"):
            samples_of(replace(failing_flight(), **{absent: None}))


@pytest.mark.measured
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "commanded"),
    [("TestCase_3_1000000002.ulg", 35.365), ("TestCase_3_2000000002.ulg", 54.416)],
)
def test_a_px4_log_names_the_motor_and_the_time(name, commanded, tmp_path):
    """The fault's command is logged at 10 Hz: it came up to 0.1 s before what is logged."""
    log = data_file(f"motor_faults/{name}")
    result = CliRunner().invoke(
        app, ["diagnose", str(log), "--rotor-faults", "--out", str(tmp_path)]
    )
    assert result.exit_code == 0, result.output
    (found,) = json.loads((tmp_path / "rotor_faults.json").read_bytes())
    assert found["found"] == "rotor 4"
    assert found["motor"] == "PX4 motor 1"
    assert found["sure"]
    assert commanded - 0.12 < found["onset_s"] < commanded
    assert found["remaining_ci95"][0] <= 0.2 <= found["remaining_ci95"][1]
    assert (tmp_path / "rotor_faults.png").stat().st_size > 500
