"""The windwrench command, run as a user runs it."""

import csv
import json
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.support.paths import ROOT
from windwrench.dynamics.effects.__main__ import effects_page

COMMAND = Path(sys.executable).with_name("windwrench")
RECORD = "record --effect constant_force:fx=0.2 --trajectory hover --seconds 8 --out flight.csv"
PNG = b"\x89PNG\r\n\x1a\n"

pytestmark = pytest.mark.skipif(
    not COMMAND.exists(), reason=f"no windwrench command beside {sys.executable}: pip install -e ."
)


def run(folder, arguments):
    return subprocess.run(
        [COMMAND, *shlex.split(arguments)], cwd=folder, capture_output=True, text=True, check=False
    )


def succeed(folder, arguments):
    done = run(folder, arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A recorded flight with a constant force of 0.2 N along x."""
    folder = tmp_path_factory.mktemp("log")
    succeed(folder, RECORD)
    return folder / "flight.csv"


def test_without_a_command_it_prints_its_help(tmp_path):
    assert "Commands:" in succeed(tmp_path, "")


def test_fly_draws_the_episode(tmp_path):
    out = tmp_path / "a" / "folder"
    text = succeed(
        tmp_path, f"fly --scenario static --controller admittance --seed 3 --csv --out {out}"
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
        "benchmark --controllers hover,oracle --scenarios base --episodes 2 --jobs 1 --seed 5 "
        "--out out",
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
    text = succeed(tmp_path, f"estimate {log} --out out")
    assert "RMSE to truth" in text
    with (tmp_path / "out" / "wrench.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    names = "t fx fy fz tx ty tz std_fx std_fy std_fz std_tx std_ty std_tz nis status"
    assert list(rows[0]) == names.split()
    late = [float(row["fx"]) for row in rows if float(row["t"]) > 5.0]
    assert np.mean(late) == pytest.approx(0.2, abs=0.03)


def test_an_estimate_says_its_tuning_and_how_it_used_the_log(log, tmp_path):
    text = succeed(tmp_path, f"estimate {log} --tune --no-smooth --out out --json")
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
    succeed(tmp_path, RECORD)
    assert (tmp_path / "flight.csv").read_bytes() == log.read_bytes()


def test_the_page_of_effects_is_the_one_in_the_docs():
    assert (ROOT / "docs" / "effects.md").read_text(encoding="utf-8") == effects_page()


def test_a_mistake_ends_with_exit_code_2_and_no_traceback(tmp_path):
    done = run(tmp_path, "record --effect rotor_dragg")
    assert done.returncode == 2
    assert "Did you mean 'rotor_drag'" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert done.stdout == ""


def test_an_old_result_survives_a_run_that_fails(log, tmp_path):
    old = tmp_path / "flight.csv"
    old.write_bytes(log.read_bytes())
    done = run(tmp_path, "record --seconds 5 --effect constant_torque:tx=50 --out flight.csv")
    assert done.returncode == 2
    assert old.read_bytes() == log.read_bytes()
    assert [p.name for p in tmp_path.iterdir()] == ["flight.csv"]
