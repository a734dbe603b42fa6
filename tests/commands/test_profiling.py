"""``profile``: a law from a flight through a jet, flown by its file; no law without a jet."""

import csv
import json

import pytest
import yaml

from tests.commands.conftest import recorded
from windwrench.controllers import Admittance
from windwrench.controllers.registry import make_controller
from windwrench.evaluation.tasks import make_pilot

JET = "fan_jet:u0=4.8,x=-2.0,z=1.2,kd=0.02,area=0.05"


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    path = tmp_path_factory.mktemp("swept") / "sweep.csv.gz"
    return recorded(path, "--trajectory", "sweep", "--seed", "3", effect=JET, seconds=64)


@pytest.fixture(scope="module")
def calm(tmp_path_factory):
    path = tmp_path_factory.mktemp("calm") / "calm.csv.gz"
    return recorded(path, "--trajectory", "sweep", "--seed", "4", seconds=64)


def test_a_profile_becomes_a_law_that_is_flown(call, swept, tmp_path):
    code, out, _ = call("profile", swept, "--write", "law.yaml", "--out", "found")
    assert code == 0
    assert out.startswith("A gain of ")
    assert "k tau_max" in out
    result = json.loads((tmp_path / "found" / "profile.json").read_bytes())
    assert result["why_no_law"] is None
    gain = result["law"]["gain"]
    low, high = result["law"]["fastest_fan_ci95_m_s"]
    assert low <= result["law"]["fastest_fan_m_s"] * 1.02
    assert high >= result["law"]["fastest_fan_m_s"] * 0.98
    assert (tmp_path / "found" / "profile.png").stat().st_size > 1_000
    with open(tmp_path / "found" / "profile.csv") as file:
        rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]
    assert all(row["t_up_low"] < row["t_up"] < row["t_up_high"] for row in rows)
    assert max(row["t_up"] for row in rows) == pytest.approx(result["jet"]["torques_Nm"][1])
    law = yaml.safe_load((tmp_path / "law.yaml").read_text())
    assert law["gains"] == {"gain": gain}
    assert make_pilot(str(tmp_path / "law.yaml")).gain == gain
    code, out, _ = call("fly", "--controller", "law.yaml", "--scenario", "static", "--json")
    flown = json.loads(out)["result"]
    assert code == 0
    assert not flown["lost"]
    assert flown["rmse_m"] < 0.6  # from 0.8 m


def test_without_a_jet_there_is_no_law(call, calm, tmp_path):
    code, out, _ = call("profile", calm, "--fan-speed", "0.2", "--axis", "90")
    assert code == 0
    assert out.splitlines()[-1].startswith("No law: the torque about z is not distinguishable")
    code, _, said = call("profile", calm, "--write", "law.yaml")
    assert code == 2
    assert "no law was written: the torque about z is not distinguishable from zero" in said
    assert not (tmp_path / "law.yaml").exists()


def test_a_law_file_has_the_gains_of_its_task(tmp_path):
    path = tmp_path / "both.yaml"
    path.write_text("law: admittance\ntask: FanTracking2D\ngains: {gain: 7, gain_z: 5}\n")
    law = make_controller(str(path), "FanTracking2D")
    assert isinstance(law, Admittance)
    assert (law.gain, law.gain_z) == (7.0, 5.0)
