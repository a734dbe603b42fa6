"""The command identify: files and words."""

import json
import math
from dataclasses import replace

import pytest

from tests.identification.vehicle_fit.flown import ARM, MASS, inertial_flights
from windwrench.commands.identifying import parse_window
from windwrench.dynamics import load_vehicle
from windwrench.envs.recording import record_flight
from windwrench.identification.logs.flight_log import FlightLog, write_log


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("flights") / "flight.csv.gz"
    ((flight, speeds),) = inertial_flights([3], seconds=12.0)
    write_log(replace(flight, command=None, rotor_speeds=speeds), path)
    return path


def test_identify_writes_a_vehicle_that_loads(call, log, tmp_path):
    out = tmp_path / "mine.yaml"
    code, text, _ = call(
        *("identify", f"{log}:1-11.5", "--mass", MASS, "--geometry", ARM, "--out", out),
        *("--export", "gazebo"),
    )
    assert code == 0
    assert load_vehicle(out).mass == MASS
    data = json.loads((tmp_path / "mine.identify.json").read_text())
    estimates = {e["name"]: e for e in data["estimates"]}
    low, high = estimates["k"]["interval_95"]
    assert low < estimates["k"]["value"] < high
    assert data["flight_s"] == pytest.approx(10.5, abs=0.5)
    assert (tmp_path / "mine.identify.png").read_bytes()[:4] == b"\x89PNG"
    assert "<motorConstant>" in text
    assert "95 % interval" in text


def test_the_vehicle_predicts_flights_that_it_was_not_fitted_to(call, log, tmp_path):
    known = load_vehicle("ardrone2")
    for seed in (1, 2):
        flown = FlightLog(**record_flight(known, trajectory="excite", seconds=12.0, seed=seed))
        write_log(flown, tmp_path / f"{seed}.csv")
    asked = ("identify", "1.csv", "--mass", known.mass, "--geometry", known.arm_l)
    code, text, _ = call(*asked, "--test", "2.csv:2-11", "--out", "mine.yaml")
    assert code == 0
    assert "held out blocks" in text
    assert "if nothing changes" in text
    data = json.loads((tmp_path / "mine.identify.json").read_text())
    for errors in (data["held_out_blocks"], data["prediction"]):
        assert errors["starts"] > 20
        for name in ("position", "velocity", "attitude", "body_rate"):
            assert errors[name]["model"][-1] < 0.3 * errors[name]["if_nothing_changes"][-1]
    assert (tmp_path / "mine.prediction.png").read_bytes()[:4] == b"\x89PNG"
    code, _, error = call(*asked, "--test", log, "--out", "other.yaml")
    assert code == 2
    assert "flight: no unbroken piece of pose is longer than 3 s" in error
    assert not (tmp_path / "other.yaml").exists()


def test_a_part_of_a_log():
    path, window = parse_window("a/b.csv:35-65.5")
    assert (str(path), window) == ("a/b.csv", (35.0, 65.5))
    assert parse_window("b.csv")[1] == (0.0, math.inf)
