"""Rotor faults: simulated flights, and measured logs."""

import json

import pytest
from typer.testing import CliRunner

from tests.support.data_paths import data_file
from tests.support.golden_identification import failing_flight
from windwrench.cli import app
from windwrench.identification.comparison.fault_channels import channels_of_log
from windwrench.identification.comparison.fault_detection import find_fault
from windwrench.identification.comparison.words import fault_data, fault_headline


def test_a_failing_rotor_is_named_with_its_time():
    found = find_fault(channels_of_log(failing_flight()))
    assert found.likeliest == "3"
    assert found.sure
    assert found.onset[1] <= 9.0 <= found.onset[2]
    assert found.onset[2] - found.onset[1] < 0.1
    assert 0.2 < 1.0 - found.remaining[0] < 0.6
    said = fault_headline(found)
    assert "Rotor 3 (" in said
    assert fault_data(found)["rotor"] == 3
    assert json.dumps(fault_data(found))


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
    (found,) = json.loads((tmp_path / "rotor_faults.json").read_text(encoding="utf-8"))
    assert found["found"] == "rotor 4"
    assert found["motor"] == "PX4 motor 1"
    assert found["sure"]
    assert commanded - 0.12 < found["onset_s"] < commanded
    assert found["remaining_ci95"][0] <= 0.2 <= found["remaining_ci95"][1]
    assert (tmp_path / "rotor_faults.png").stat().st_size > 5000
