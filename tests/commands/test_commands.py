"""What every command shares: help with an example, --json, --quiet, --dry-run, run.json,
completion, exit codes.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import typer
import yaml

from tests.commands.conftest import recorded
from tests.support.paths import ROOT
from windwrench.cli import app
from windwrench.commands.options import listed, names_of, offering
from windwrench.commands.running import write_run
from windwrench.dynamics.effects.__main__ import effects_page
from windwrench.runtime.plain_values import plain

COMMANDS = sorted(command.name for command in app.registered_commands)
EXPENSIVE = ("benchmark", "reproduce")
COMMAND = Path(sys.executable).with_name("windwrench")
needs_command = pytest.mark.skipif(
    not COMMAND.exists(), reason=f"no windwrench command beside {sys.executable}: pip install -e ."
)


def hovered(path):
    """Record a hover with a constant force of 0.2 N along x."""
    return recorded(path, "--trajectory", "hover", seconds=8)


def ended(folder, *words, **environment):
    """Run the installed command with some variables, and others of them unset."""
    changed = {k: v for k, v in (os.environ | environment).items() if v is not None}
    return subprocess.run(
        [COMMAND, *words], env=changed, cwd=folder, capture_output=True, text=True
    )


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return hovered(tmp_path_factory.mktemp("log") / "flight.csv")


@pytest.mark.parametrize("name", COMMANDS)
def test_help_has_an_example_and_the_options_that_all_share(call, name):
    code, text, _ = call(name, "--help")
    assert code == 0
    words = " ".join(text.split())
    assert f"Example: windwrench {name} " in words
    assert "--json" in words
    assert "--quiet" in words


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_says_what_it_is_for(name):
    command = typer.main.get_command(app).commands[name]
    assert [p.name for p in command.params if not getattr(p, "help", None)] == []


def test_the_list_of_commands_has_whole_sentences_at_80_columns(call, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    _, text, _ = call("--help")
    listed = text.split("Commands:")[1].split("Exit codes")[0].strip().splitlines()
    assert len(listed) > 12
    assert [line for line in listed if not line.endswith(".") or line.endswith("...")] == []


def test_help_says_what_exit_codes_mean(call):
    code, text, _ = call("--help")
    assert code == 0
    for words in (
        "Exit codes: 0 success",
        "2 invalid option or input file",
        "130 interrupted",
        "NO_COLOR",
    ):
        assert words in " ".join(text.split())
    assert call("--version")[1].startswith("windwrench ")


def test_json_is_one_object_and_nothing_else(call):
    arguments = "record --seconds 2 --trajectory hover --effect mass:dm=0.01 --out log.csv --json"
    code, text, _ = call(*arguments.split())
    assert code == 0
    assert json.loads(text) == {
        "command": "record",
        "written": ["log.csv", "log.run.json"],
        "result": {
            "samples": 401,
            "vehicle": "ardrone2",
            "trajectory": "hover",
            "effects": {"mass": {"dm": 0.01}},
        },
    }


def test_an_episode_is_drawn_and_its_time_series_written(call, tmp_path):
    out = tmp_path / "a" / "folder"
    code, text, _ = call("fly", "--scenario", "static", "--seed", 3, "--csv", "--out", out)
    assert code == 0
    assert {p.name for p in out.iterdir()} == {"fly.png", "fly.csv", "run.json"}
    flight = np.genfromtxt(out / "fly.csv", delimiter=",", names=True)
    assert len(flight) == 250
    assert (np.diff(flight["t"]) > 0.0).all()
    assert np.hypot(flight["qw"], flight["qz"]) == pytest.approx(1.0, abs=0.02)
    assert abs(flight["px"] - 2.3).max() < 0.5
    # what is felt is what acts, but for noise and the filter's delay
    assert np.corrcoef(flight["fx"][50:], flight["true_fx"][50:])[0, 1] > 0.3
    assert "fly.png" in text


SCENARIO = "motions: [sine]\nspeed: [0.1, 0.2]\nvaried: true\nvariation: {mass: [1.1, 1.2]}\n"


def test_a_scenario_of_one_s_own_is_a_file(call, tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(SCENARIO)
    env = gym.make("windwrench/FanTracking-v1", scenario=str(path)).unwrapped
    _, info = env.reset(seed=1)
    assert (info["fan_motion"], env.scenario.rise_time) == ("sine", 0.45)
    assert 1.1 < env.drawn["mass"] < 1.2
    assert call("fly", "--scenario", path, "--json")[0] == 0
    assert call("benchmark", "--scenarios", path, "--dry-run")[0] == 0


def test_results_go_into_a_folder_or_a_file_that_is_named(call, tmp_path):
    assert call("record", "--seconds", 2, "--out", "there")[0] == 0
    assert {p.name for p in (tmp_path / "there").iterdir()} == {"flight.csv", "flight.run.json"}
    assert call("record", "--seconds", 2, "--out", "there/other.csv.gz")[0] == 0
    assert (tmp_path / "there" / "other.run.json").is_file()


def test_an_option_s_earlier_name_is_taken_and_not_shown(call):
    assert "--view" not in call("live", "--help")[1]
    assert "unknown scenario 'none'" in call("live", "sim:none", "--view")[2]


def test_a_recorded_flight_can_be_estimated(call, log, tmp_path):
    code, text, _ = call("estimate", log, "--no-smooth", "--out", "out", "--json")
    assert code == 0
    said = json.loads(text)
    found = said["result"]
    assert found["smoothed"] is False
    assert found["tuning"]["nis_band"][0] < found["tuning"]["nis_after"]
    assert found["status"]["tracking"] == found["samples"]
    assert found["restarts"] == 0
    assert len(found["force_rmse_to_truth_N"]) == 3
    assert set(said["written"]) == {
        f"out/{name}" for name in ("wrench.csv", "wrench.png", "tuning.yaml", "run.json")
    }
    wrench = np.genfromtxt(tmp_path / "out" / "wrench.csv", delimiter=",", names=True)
    track = tmp_path / "track.mcap"
    assert call("estimate", log, "--no-smooth", "--no-tune", "--out", track)[0] == 0
    beside = {"track.png", "track.tuning.yaml", "track.run.json", track.name}
    assert beside == {p.name for p in tmp_path.glob("track.*")}
    assert np.mean(wrench["fx"][wrench["t"] > 5.0]) == pytest.approx(0.2, abs=0.03)


def test_a_recording_repeats_with_its_seed(log, tmp_path):
    assert hovered(tmp_path / "flight.csv").read_bytes() == log.read_bytes()


def test_the_page_of_effects_is_the_one_in_the_docs():
    assert (ROOT / "docs" / "effects.md").read_text(encoding="utf-8") == effects_page()


def test_json_of_a_mistake_leaves_standard_output_empty(call):
    code, out, err = call("estimate", "nowhere.csv", "--json")
    assert (code, out) == (2, "")
    assert err.startswith("error: nowhere.csv")


def test_quiet_says_nothing_but_errors(call, tmp_path):
    assert call("record", "--seconds", 2, "--out", "log.csv", "--quiet") == (0, "", "")
    assert (tmp_path / "log.csv").is_file()
    code, out, err = call("record", "--seconds", 2, "--effect", "mas", "-q")
    assert (code, out) == (2, "")
    assert "Did you mean 'mass'" in err
    assert (
        "wrote" in call("record", "--seconds", 2, "--out", "log.csv")[1]
    )  # the next one speaks again


@pytest.mark.parametrize("name", EXPENSIVE)
def test_a_dry_run_says_what_would_be_done_and_does_nothing(call, tmp_path, name):
    code, text, _ = call(name, "--dry-run", "--out", "there")
    assert code == 0
    assert text.startswith(f"{name} would do\n")
    assert "there" in text
    said = json.loads(call(name, "--dry-run", "--json")[1])
    assert said["dry_run"] is True
    assert said["would"]
    assert list(tmp_path.iterdir()) == []


def test_a_benchmark_writes_its_leaderboard_and_how_it_came_about(call, tmp_path):
    command = "benchmark --controllers hover,oracle --scenarios static --episodes 1 --jobs 1 "
    arguments = f"{command}--seed 7 --out out".split()
    assert call(*arguments)[0] == 0
    out = tmp_path / "out"
    files = ("leaderboard.json", "leaderboard.md", "leaderboard.png", "submission.json", "run.json")
    assert sorted(p.name for p in out.iterdir()) == sorted(files)
    rows = json.loads((out / "leaderboard.json").read_bytes())
    said = [(row["controller"], row["scenario"], row["episodes"], row["seed"]) for row in rows]
    assert said == [("oracle", "static", 1, 7), ("hover", "static", 1, 7)]
    noted = json.loads((out / "run.json").read_bytes())["benchmark"]
    assert noted["command"] == "windwrench " + " ".join(arguments)
    assert (noted["seed"], noted["options"]["jobs"]) == (7, 1)
    assert {"numpy", "mujoco", "scipy"} <= set(noted["packages"])


def test_a_broken_note_is_written_anew(tmp_path):
    path = tmp_path / "run.json"
    path.write_text("[1, ")
    write_run(path, "fly", {"seed": 3, "out": Path("x"), "far": float("inf")})
    first = path.read_bytes()
    assert json.loads(first)["fly"]["options"] == {"seed": 3, "out": "x", "far": None}
    path.unlink()
    write_run(path, "fly", {"seed": 3, "out": Path("x"), "far": float("inf")})
    assert path.read_bytes() == first  # no time stands in it
    write_run(path, "record", {})
    assert set(json.loads(path.read_bytes())) == {"fly", "record"}  # they may share a folder


def test_plain_values_are_strict_json():
    value = {
        "a": np.array([1.0, np.nan]),
        "b": np.float64(2.0),
        "c": (Path("x"), None, True),
        3: "\udcff",
    }
    assert plain(value) == {"a": [1.0, None], "b": 2.0, "c": ["x", None, True], "3": "?"}


def test_completion_offers_names():
    complete = offering(["controllers:CONTROLLERS", "controllers.registry:shipped_policies"])
    assert complete("hov") == ["hover"]
    assert complete("hover,adm")[0] == "hover,admittance"
    assert "sac-0" in complete("sac")
    assert complete("x") == []
    assert listed("a, b,,a", "--x") == ["a", "b"]


def test_every_entry_of_the_options_is_an_option_and_its_names_are_there():
    used = {(c, p.name) for c in COMMANDS for p in typer.main.get_command(app).commands[c].params}
    names = {name for _, name in used}
    table = yaml.safe_load((ROOT / "commands" / "options.yaml").read_text(encoding="utf-8"))
    for command, options in table.items():
        for name, said in options.items():
            assert (command, name) in used or (command == "common" and name in names), name
            if isinstance(said, dict) and "names" in said:
                assert names_of(said["names"]), name


@needs_command
def test_a_shell_completes_names(tmp_path):
    words = "windwrench fly --vehicle ar"
    asked = {"_WINDWRENCH_COMPLETE": "complete_bash", "COMP_WORDS": words}
    done = ended(tmp_path, **asked, COMP_CWORD=str(words.count(" ")))
    assert done.stdout.split() == ["ardrone2"]


@needs_command
@pytest.mark.parametrize("no_color", [None, "1"])
def test_no_color_is_honoured(tmp_path, no_color):
    coloured = {"FORCE_COLOR": "1", "TERM": "xterm-256color", "NO_COLOR": no_color}
    assert ("\x1b[3" in ended(tmp_path, "flie", **coloured).stderr) == (no_color is None)
