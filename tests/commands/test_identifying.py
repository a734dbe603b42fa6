"""The command identify: files, words and refusals."""

import json
import math
import sys
from dataclasses import replace

import pytest

from tests.identification.vehicle_fit.flown import ARM, MASS, inertial_flights
from windwrench.cli import main
from windwrench.commands.identifying import parse_window
from windwrench.dynamics import load_vehicle
from windwrench.identification.logs.flight_log import write_log
from windwrench.runtime.errors import InputError


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("flights") / "flight.csv.gz"
    ((flight, speeds),) = inertial_flights([3], seconds=12.0)
    write_log(replace(flight, command=None, rotor_speeds=speeds), path)
    return path


def call(monkeypatch, capsys, *arguments):
    monkeypatch.setattr(sys, "argv", ["windwrench", *map(str, arguments)])
    with pytest.raises(SystemExit) as ended:
        main()
    said = capsys.readouterr()
    return ended.value.code or 0, said.out, said.err


def test_identify_writes_a_vehicle_that_loads(log, tmp_path, monkeypatch, capsys):
    out = tmp_path / "mine.yaml"
    code, text, _ = call(
        monkeypatch,
        capsys,
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


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--mass", "0"), "--mass 0: expected the vehicle's mass"),
        (("--mass", "0.5", "--geometry", "x"), "--geometry x"),
        (("--mass", "0.5", "--out", "v.txt"), "ends in .yaml"),
        (("--mass", "0.5", "--export", "px5"), "px4"),
        (("--mass", "0.5", "--from", "9", "--to", "3"), "--to 3: expected a time after"),
    ],
)
def test_what_is_asked_wrongly_is_refused(log, tmp_path, monkeypatch, capsys, arguments, says):
    monkeypatch.chdir(tmp_path)
    code, _, error = call(monkeypatch, capsys, "identify", log, *arguments)
    assert code == 2
    assert says in error
    assert list(tmp_path.iterdir()) == []


def test_a_part_of_a_log():
    path, window = parse_window("a/b.csv:35-65.5")
    assert (str(path), window) == ("a/b.csv", (35.0, 65.5))
    assert parse_window("b.csv")[1] == (0.0, math.inf)
    with pytest.raises(InputError, match="FROM before TO"):
        parse_window("b.csv:5-3")
