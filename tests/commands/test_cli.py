"""The windwrench command, run as a user runs it."""

import csv
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.support.paths import ROOT
from windwrench.cli import main
from windwrench.dynamics.effects.__main__ import effects_page

COMMAND = Path(sys.executable).with_name("windwrench")
PNG = b"\x89PNG\r\n\x1a\n"

pytestmark = pytest.mark.skipif(
    not COMMAND.exists(), reason=f"no windwrench command beside {sys.executable}: pip install -e ."
)


def run(folder, *arguments):
    return subprocess.run(
        [COMMAND, *map(str, arguments)], cwd=folder, capture_output=True, text=True, check=False
    )


def succeed(folder, *arguments):
    done = run(folder, *arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout


def only_error(text):
    lines = text.strip().splitlines()
    assert len(lines) == 1, text
    assert lines[0].startswith("error: ")
    return lines[0]


@pytest.fixture
def fail(tmp_path, monkeypatch, capfd):
    """Run what must fail in ``tmp_path``, in this process to save its start; return the message."""

    def run_here(*arguments):
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["windwrench", *map(str, arguments)])
        capfd.readouterr()
        with pytest.raises(SystemExit) as ended:
            main()
        assert ended.value.code == 2
        return only_error(capfd.readouterr().err)

    return run_here


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A recorded flight with a constant force of 0.2 N along x."""
    folder = tmp_path_factory.mktemp("log")
    succeed(
        folder,
        "record",
        "--effect",
        "constant_force:fx=0.2",
        "--trajectory",
        "hover",
        "--seconds",
        8,
        "--out",
        "flight.csv",
    )
    return folder / "flight.csv"


@pytest.mark.parametrize("command", ["fly", "benchmark", "estimate", "record"])
def test_every_command_has_help(tmp_path, command):
    assert command in succeed(tmp_path, "--help")
    text = succeed(tmp_path, command, "--help")
    assert f"Usage: windwrench {command}" in text


def test_without_a_command_it_prints_its_help(tmp_path):
    assert "Commands:" in succeed(tmp_path)


def test_fly_draws_the_episode(tmp_path):
    out = tmp_path / "a" / "folder"
    text = succeed(
        tmp_path,
        "fly",
        "--scenario",
        "static",
        "--controller",
        "admittance",
        "--seed",
        3,
        "--csv",
        "--out",
        out,
    )
    assert (out / "fly.png").read_bytes().startswith(PNG)
    assert {p.name for p in out.iterdir()} == {"fly.png", "fly.csv", "run.json"}
    flight = np.genfromtxt(out / "fly.csv", delimiter=",", names=True)
    assert len(flight) == 250
    assert np.all(np.diff(flight["t"]) > 0.0)
    assert np.hypot(flight["qw"], flight["qz"]) == pytest.approx(1.0, abs=0.02)
    assert abs(flight["px"] - 2.3).max() < 0.5
    # what is felt is what acts, but for noise and the filter's delay
    assert np.corrcoef(flight["fx"][50:], flight["true_fx"][50:])[0, 1] > 0.3
    assert f"wrote {out / 'fly.png'}" in text


def test_benchmark_writes_the_leaderboard(tmp_path):
    succeed(
        tmp_path,
        "benchmark",
        "--controllers",
        "hover,oracle",
        "--scenarios",
        "base",
        "--episodes",
        2,
        "--jobs",
        1,
        "--seed",
        5,
        "--out",
        "out",
    )
    rows = json.loads((tmp_path / "out" / "leaderboard.json").read_text(encoding="utf-8"))
    assert [(row["controller"], row["scenario"], row["episodes"], row["seed"]) for row in rows] == [
        ("oracle", "base", 2, 5),
        ("hover", "base", 2, 5),
    ]
    assert (tmp_path / "out" / "leaderboard.png").read_bytes().startswith(PNG)
    assert {p.name for p in (tmp_path / "out").iterdir()} == {
        "leaderboard.json",
        "leaderboard.md",
        "leaderboard.png",
        "run.json",
    }


def test_a_recorded_flight_can_be_estimated(log, tmp_path):
    text = succeed(tmp_path, "estimate", log, "--out", "out")
    assert "RMSE to truth" in text
    with (tmp_path / "out" / "wrench.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == [
        "t",
        "fx",
        "fy",
        "fz",
        "tx",
        "ty",
        "tz",
        "std_fx",
        "std_fy",
        "std_fz",
        "std_tx",
        "std_ty",
        "std_tz",
        "nis",
        "status",
    ]
    late = [float(row["fx"]) for row in rows if float(row["t"]) > 5.0]
    assert np.mean(late) == pytest.approx(0.2, abs=0.03)


def test_an_estimate_says_its_tuning_and_how_it_used_the_log(log, tmp_path):
    text = succeed(tmp_path, "estimate", log, "--tune", "--no-smooth", "--out", "out", "--json")
    found = json.loads(text)["result"]
    assert found["smoothed"] is False
    assert found["tuning"]["nis_band"][0] < found["tuning"]["nis_after"]
    assert found["status"]["tracking"] == found["samples"]
    assert found["restarts"] == 0
    assert {p.name for p in (tmp_path / "out").iterdir()} == {
        "wrench.csv",
        "wrench.png",
        "run.json",
    }


def test_a_recording_repeats_with_its_seed(log, tmp_path):
    succeed(
        tmp_path,
        "record",
        "--effect",
        "constant_force:fx=0.2",
        "--trajectory",
        "hover",
        "--seconds",
        8,
        "--out",
        "again.csv",
    )
    assert (tmp_path / "again.csv").read_bytes() == log.read_bytes()


def test_the_page_of_effects_is_the_one_in_the_docs():
    assert (ROOT / "docs" / "effects.md").read_text(encoding="utf-8") == effects_page()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("fly", "--scenario", "bas"), "Did you mean 'base'"),
        (("fly", "--controller", "admitance"), "Did you mean 'admittance'"),
        (("fly", "--vehicle", "ardrone"), "Did you mean 'ardrone2'"),
        (("fly", "--vehicle", "nowhere.yaml"), "nowhere.yaml"),
        (("fly", "--effect", "rotor_drag:kdx=-1"), "between"),
        (("fly", "--seed", "-1"), "--seed"),
        (("fly", "--nothing"), "No such option"),
        (("flyy",), "Did you mean 'fly'"),
        (("fly", "--sceanrio", "base"), "--scenario"),
        (("benchmark", "--controllers", "hovre"), "Did you mean 'hover'"),
        (("benchmark", "--scenarios", "bsae"), "Did you mean 'base'"),
        (("benchmark", "--scenarios", ","), "--scenarios"),
        (("benchmark", "--episodes", "0"), "--episodes"),
        (("benchmark", "--episodes", "many"), "--episodes"),
        (("benchmark", "--seed", "4294967296"), "--seed"),
        (("estimate", "nowhere.csv"), "nowhere.csv"),
        (("estimate", "nowhere.txt"), "nowhere.txt: cannot be read"),
        (("estimate",), "argument"),
        (("estimate", "log.csv", "--gate", "1.5"), "--gate: expected 0, or a probability"),
        (("record", "--out", "out/log.txt"), ".csv.gz"),
        (("record", "--out", "out/log.csv", "--seconds", "0"), "--seconds"),
        (("record", "--out", "out/log.csv", "--seconds", "nan"), "--seconds"),
        (
            ("record", "--out", "out/log.csv", "--trajectory", "spiral"),
            "unknown trajectory 'spiral'",
        ),
        (
            ("record", "--out", "out/log.csv", "--effect", "rotor_dragg"),
            "Did you mean 'rotor_drag'",
        ),
        (("record", "--out", "out/log.csv", "--effect", "rotor_drag:kdx"), "NAME:coef=value"),
        (("record", "--out", "out/log.csv", "--effect", "mass:dm=-5"), "dm"),
        (
            (
                "record",
                "--out",
                "out/log.csv",
                "--seconds",
                "5",
                "--effect",
                "constant_torque:tx=50",
            ),
            "crashed",
        ),
    ],
)
def test_a_mistake_ends_in_one_line_and_leaves_nothing_behind(tmp_path, arguments, words, fail):
    assert words in fail(*arguments)
    assert list(tmp_path.iterdir()) == []


def test_a_mistake_ends_with_exit_code_2_and_no_traceback(tmp_path):
    done = run(tmp_path, "record", "--effect", "rotor_dragg")
    assert done.returncode == 2
    assert "Did you mean 'rotor_drag'" in only_error(done.stderr)
    assert done.stdout == ""


def test_a_bad_vehicle_file_is_named_with_its_field(tmp_path, fail):
    (tmp_path / "v.yaml").write_text(
        "name: v\nmass: -1\ninertia: [1, 1, 1]\narm_l: 1\nk: [1,1,1,1]\np: [1,1,1,1]\n"
    )
    message = fail("record", "--vehicle", "v.yaml", "--out", "log.csv")
    assert "v.yaml: mass must be a positive number, got -1" in message
    assert [p.name for p in tmp_path.iterdir()] == ["v.yaml"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("t,px\n0,1\n", "missing column"),
        ("", "empty file"),
        (
            "t,px,py,pz,qw,qx,qy,qz,omega1,omega2,omega3,omega4\n0,0,0,1,1,0,0,0,400,400,400,400\n",
            "only one row",
        ),
    ],
)
def test_a_bad_log_is_named_and_nothing_is_written(tmp_path, text, words, fail):
    (tmp_path / "log.csv").write_text(text, encoding="utf-8")
    message = fail("estimate", "log.csv", "--out", "out")
    assert "log.csv" in message
    assert words in message
    assert [p.name for p in tmp_path.iterdir()] == ["log.csv"]


def test_an_out_that_is_a_file_is_named(log, tmp_path, fail):
    (tmp_path / "taken").write_text("mine", encoding="utf-8")
    assert "--out taken" in fail("estimate", log, "--out", "taken")
    assert "--out taken" in fail("fly", "--out", "taken")
    assert "taken/log.csv" in fail("record", "--seconds", 1, "--out", "taken/log.csv")
    assert (tmp_path / "taken").read_text(encoding="utf-8") == "mine"
    assert [p.name for p in tmp_path.iterdir()] == ["taken"]


def test_an_old_result_survives_a_run_that_fails(log, tmp_path, fail):
    old = tmp_path / "flight.csv"
    old.write_bytes(log.read_bytes())
    fail("record", "--seconds", 5, "--effect", "constant_torque:tx=50", "--out", "flight.csv")
    assert old.read_bytes() == log.read_bytes()
    assert [p.name for p in tmp_path.iterdir()] == ["flight.csv"]
