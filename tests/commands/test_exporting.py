"""The commands export-c and identify, and a tuning as a file: what is written and refused."""

import json
import math
from dataclasses import fields

import numpy as np
import pytest

from tests.support.paths import ROOT
from windwrench.commands.identifying import parse_window
from windwrench.commands.tuning_file import load_tuning, save_tuning
from windwrench.dynamics import load_vehicle
from windwrench.envs.recording import record_flight
from windwrench.estimator import UKFTuning
from windwrench.identification.logs.flight_log import FlightLog, write_log

FILES = {
    *("windwrench.h", "windwrench.cpp", "windwrench_numbers.hpp", "main.c", "CMakeLists.txt"),
    "core",
}


def test_it_writes_the_files_and_says_what_they_are(call, tmp_path):
    out = tmp_path / "filter"
    code, text, _ = call(
        "export-c",
        *("--vehicle", "crazyflie", "--estimator", "ukf", "--policy", "sac-0"),
        *("--rate", 100, "--gate", 0, "--out", out, "--json"),
    )
    assert code == 0
    said = json.loads(text)["result"]
    assert said["period_s"] == 0.01
    assert said["effects"] == []
    assert {p.name for p in out.iterdir()} == FILES | {"policy.hpp", "run.json"}
    assert "--estimator ukf" in (out / "windwrench_numbers.hpp").read_text()
    assert "ww_policy" in (out / "windwrench.h").read_text()
    for header in (out / "core").rglob("*.hpp"):
        assert header.read_bytes() == (ROOT / header.relative_to(out)).read_bytes()


def test_files_that_are_there_stay_unless_said_otherwise(call, tmp_path):
    mine = tmp_path / "main.c"
    mine.write_text("int mine;\n")
    code, _, err = call("export-c", "--vehicle", "ardrone2", "--out", tmp_path)
    assert code == 2
    assert "main.c" in err
    assert "--overwrite" in err
    assert [p.name for p in tmp_path.iterdir()] == ["main.c"]
    assert mine.read_text() == "int mine;\n"
    assert call("export-c", "--vehicle", "ardrone2", "--out", tmp_path, "--overwrite")[0] == 0
    assert "ww_init" in mine.read_text()


def test_declared_effects_are_in_it_unless_none_are_wanted(call, tmp_path):
    vehicle = tmp_path / "mine.yaml"
    text = "name: mine\nmass: 0.5\ninertia: [3e-3, 3e-3, 5e-3]\narm_l: 0.12\n"
    text += "k: [8e-6, 8e-6, 8e-6, 8e-6]\np: [2e-7, 2e-7, 2e-7, 2e-7]\neffects:\n"
    vehicle.write_text(text + "- {name: rotor_drag, coefficients: {kdx: 1.0e-4, kdy: 1.0e-4}}\n")
    for words, effects in (((), ["rotor_drag"]), (("--effects", "none"), [])):
        out = tmp_path / f"{len(effects)} effects"
        code, text, _ = call("export-c", "--vehicle", vehicle, *words, "--out", out, "--json")
        assert code == 0
        assert json.loads(text)["result"]["effects"] == effects
        assert (out / "core/effects/rotor_drag.hpp").exists() == bool(effects)


def test_identify_writes_a_vehicle_that_loads_and_predicts_other_flights(call, tmp_path):
    known = load_vehicle("ardrone2")
    for seed in (1, 2):
        flown = FlightLog(**record_flight(known, trajectory="excite", seconds=12.0, seed=seed))
        write_log(flown, tmp_path / f"{seed}.csv")
    asked = ("identify", "1.csv:0.5-11", "--mass", known.mass, "--geometry", known.arm_l)
    code, text, _ = call(*asked, "--test", "2.csv:2-11", "--out", "mine.yaml", "--export", "gazebo")
    assert code == 0
    assert load_vehicle(tmp_path / "mine.yaml").mass == known.mass
    assert "<motorConstant>" in text
    assert "± (95 %)" in text
    assert "held out blocks" in text
    assert "if nothing changes" in text
    data = json.loads((tmp_path / "mine.identify.json").read_bytes())
    estimates = {e["name"]: e for e in data["estimates"]}
    low, high = estimates["k"]["interval_95"]
    assert low < estimates["k"]["value"] < high
    assert data["flight_s"] == pytest.approx(10.5, abs=0.5)
    assert (tmp_path / "mine.identify.png").read_bytes()[:4] == b"\x89PNG"
    for errors in (data["held_out_blocks"], data["prediction"]):
        assert errors["starts"] > 20
    assert (tmp_path / "mine.prediction.png").read_bytes()[:4] == b"\x89PNG"


def test_a_part_of_a_log():
    path, window = parse_window("a/b.csv:35-65.5")
    assert (str(path), window) == ("a/b.csv", (35.0, 65.5))
    assert parse_window("b.csv")[1] == (0.0, math.inf)


TRUE = UKFTuning(force_walk=(0.02, 0.02, 0.008), thrust_noise=0.3, force_time=(0.5, 0.5, math.inf))


def test_a_tuning_is_kept_in_a_file_for_any_period(tmp_path):
    path = tmp_path / "tuning.yaml"
    save_tuning(TRUE, 0.01, path)
    again = load_tuning(path, 0.01)
    for field in fields(TRUE):
        given = getattr(TRUE, field.name)
        assert getattr(again, field.name) == pytest.approx(given, rel=1e-8)
    halved = load_tuning(path, 0.005)
    assert np.allclose(halved.force_walk, np.asarray(TRUE.force_walk) / 2**0.5)
    assert halved.thrust_noise == pytest.approx(0.3 * 2**0.5)
    assert halved.position_noise == TRUE.position_noise
