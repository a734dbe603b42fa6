"""The example scripts and the notebooks do what they say, each script in a short version."""

import importlib
import json
import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from tests.live.stream import flight, standard_input
from tests.support.data_paths import data_file
from tests.support.exported_c.compiled import needs
from tests.support.fake_vehicles import install_cflib, install_rclpy
from tests.support.own_effects import joined
from tests.support.paths import ROOT
from windwrench.cli import app
from windwrench.dynamics import effects as library
from windwrench.dynamics import load_vehicle
from windwrench.dynamics.vehicle import EffectSetting
from windwrench.envs.recording import record_flight
from windwrench.identification.logs.flight_log import FlightLog, write_log

FOLDER = ROOT / "examples"


@pytest.fixture
def example(monkeypatch, tmp_path):
    """Return what imports a script; its folder is on the path, so that worker processes find it
    too.
    """
    monkeypatch.syspath_prepend(FOLDER)
    monkeypatch.chdir(tmp_path)
    return importlib.import_module


def test_every_script_is_tested_and_in_the_table():
    scripts = {path.stem for path in FOLDER.glob("*.py")}
    table = (FOLDER / "README.md").read_text(encoding="utf-8")
    tests = Path(__file__).read_text(encoding="utf-8")
    assert [name for name in scripts if f"]({name}.py)" not in table] == []
    assert [name for name in scripts if f'example("{name}")' not in tests] == []


def test_a_controller_of_ones_own_follows_the_fan(example, capsys):
    found = example("own_controller").main(episodes=2, scenario="static")
    assert found["own"] < 0.6 * found["hover"]
    assert f"own        {found['own']:.3f} m" in capsys.readouterr().out


def test_stable_baselines3_trains_on_the_plain_environment(example):
    pytest.importorskip("stable_baselines3", reason="pip install 'windwrench[rl]'")
    found = example("sb3_ten_lines").main(steps=60, episodes=1)
    assert all(0.0 < reward <= 250.0 for reward in found.values())
    assert found["learned"] != found["hover"]


@pytest.mark.measured
def test_a_log_becomes_a_vehicle_and_two_controllers_in_c(example, monkeypatch):
    """64 steps train nothing: the policy is lost in Python and in C."""
    pytest.importorskip("stable_baselines3", reason="pip install 'windwrench[rl]'")
    needs("g++")
    logs = data_file("crazyflie_imu/log15").parent
    script = example("own_vehicle")
    monkeypatch.setattr(script.Hover, "episode_s", 5.0)
    found = script.main(logs, 64, episodes=1, aboard=1, parts="log15:20-29")
    assert found["lqg in C"] < 0.3
    assert found["policy in C"] == pytest.approx(found["policy"], rel=0.1)


def test_fans_on_paths_of_ones_own_are_followed_and_drawn(example, tmp_path):
    script = example("fan_path")
    t = np.linspace(0.0, 20.0, 4001)
    assert abs(np.gradient(script.chirp(t), t)).max() < 0.4  # m/s, what the law can follow
    assert set(np.unique(script.steps(t))) == {0.0, 0.35}
    followed = script.main(tmp_path / "followed")
    left_alone = script.main(tmp_path / "hover", controller="hover")
    assert all(followed[name] < left_alone[name] for name in script.PATHS)
    assert (tmp_path / "followed" / "fan_path.png").read_bytes().startswith(b"\x89PNG")


def asks_for(monkeypatch, script, *effects):
    """Let a script's diagnoses ask for its own and a few of the kit's effects."""
    others = {*library.names()} - {*effects}
    monkeypatch.setattr(script, "diagnose", partial(script.diagnose, without=tuple(others)))


def test_an_effect_of_ones_own_is_found_with_its_coefficient(
    example, tmp_path, capsys, monkeypatch
):
    with joined(tmp_path):  # and leaves the library again
        assert "tether" not in library.names()
        script = example("custom_effect")
        asks_for(monkeypatch, script, "tether", "constant_force", "rotor_drag")
        found = script.main(seconds=14.0, stiffness=0.12, seed=1)
    assert found.verdict == "explained"
    assert [effect.name for effect in found.effects] == ["tether"]
    assert found.effects[0].coefficients["k"] == pytest.approx(0.12, rel=0.08)
    assert found.after.force_rms < 0.8 * found.before.force_rms
    assert "tether: k = 0.1" in capsys.readouterr().out


@pytest.mark.slow  # of a drag's coefficient in tests/identification/diagnosis, once for each flight
def test_a_coefficient_is_regressed_on_the_time_of_flights(example, tmp_path, capsys, monkeypatch):
    script = example("drift_over_flights")
    asks_for(monkeypatch, script, "rotor_drag")
    regress = script.main
    flights = tmp_path / "flights"
    flights.mkdir()
    for day in range(1, 5):
        drag = EffectSetting("rotor_drag", dict.fromkeys(("kdx", "kdy"), (1.0 + 0.2 * day) * 1e-4))
        flown = record_flight(load_vehicle("ardrone2"), (drag,), "circle", 12.0, day)
        write_log(FlightLog(**flown, name=""), flights / f"2026-03-0{day}T1000.csv")
    (flights / "notes.txt").write_text("no log\n", encoding="utf-8")
    slope, low, high = regress(flights, "ardrone2", "rotor_drag", "kdx")
    assert slope == pytest.approx(0.2e-4, rel=0.1)
    assert 0.0 < low < slope < high
    said = capsys.readouterr().out
    assert "notes.txt: left out: " in said
    assert f"kdx of rotor_drag: {slope:.3g} a day, 95 % [{low:.3g}, {high:.3g}]" in said
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(SystemExit, match="0 flights name rotor_drag"):
        regress(empty, "ardrone2", "rotor_drag", "kdx")


def estimated(capsys, *words):
    """What live says of the lines that a script has printed."""
    with standard_input(capsys.readouterr().out):
        app(["live", "-", *words, "--json"], standalone_mode=False)
    found = json.loads(capsys.readouterr().out)["result"]
    found["counts"].pop("stops", None)  # of a busy machine
    return found


def test_a_crazyflies_log_is_estimated(example, monkeypatch, capsys):
    install_cflib(monkeypatch, flight(6.0, "gentle", "crazyflie"))
    example("live_crazyflie").main("radio://0/80/2M")
    found = estimated(capsys, "--vehicle", "crazyflie", "--map", "cflib")
    assert (found["estimates"], found["counts"], found["messages"]) == (601, {}, {"row": 601})
    assert found["seconds"] == pytest.approx(6.0)
    weight = 9.81 * 0.03
    assert np.abs(found["force_mean_N"]).max() < 0.03 * weight  # its weak turbulence apart


def test_topics_of_ros_2_are_estimated(example, monkeypatch, capsys):
    install_rclpy(monkeypatch, flight())
    example("live_ros2").main("/p", "/m")
    found = estimated(capsys, "--vehicle", "ardrone2")
    assert found["messages"] == {"motors": 1601, "pose": 1601}
    assert found["counts"].keys() <= {"waiting"}
    assert found["estimates"] >= 1599
    assert np.abs(found["force_mean_N"] - flight()["force"].mean(axis=0)).max() < 0.1


NOTEBOOKS = FOLDER / "notebooks"


@pytest.fixture
def run(example, monkeypatch):
    """Return a function that runs a notebook in an empty folder, compares all but numbers and
    pixels with the notebook in the checkout, and returns the names of its cells.
    """
    monkeypatch.setenv("MPLBACKEND", "Agg")

    def run_one(name):
        names = {"__name__": "__main__"}
        made = example("render_notebooks").notebook(NOTEBOOKS / f"{name}.py", names)
        there = json.loads((NOTEBOOKS / f"{name}.ipynb").read_text(encoding="utf-8"))
        assert without_numbers(made) == without_numbers(there), "run render_notebooks.py"
        assert Path(f"{name}.png").read_bytes().startswith(b"\x89PNG")
        return names

    return run_one


def without_numbers(notebook):
    return re.sub(r'"image/png": "[^"]*"|[\d.e-]+', "", json.dumps(notebook))


def test_a_script_with_cells_becomes_a_notebook(example, tmp_path):
    script = "# %% [markdown]\n# # Title\n#\n# Text.\n\n# %%\nx = 1\n\n# %%\nprint(x)\n"
    (tmp_path / "small.py").write_text(script, encoding="utf-8")
    example("render_notebooks").main(tmp_path)
    text, _, code = json.loads((tmp_path / "small.ipynb").read_text(encoding="utf-8"))["cells"]
    assert (text["cell_type"], "".join(text["source"])) == ("markdown", "# Title\n\nText.")
    assert (code["cell_type"], code["outputs"][0]["text"]) == ("code", ["1\n"])


def test_every_notebook_is_in_the_table_the_gallery_and_these_tests():
    names = {"estimator", "environment", "your_log"}
    table = (FOLDER / "README.md").read_text(encoding="utf-8")
    for ending in ("py", "ipynb"):
        assert names == {path.stem for path in NOTEBOOKS.glob(f"*.{ending}")}
        assert names == set(re.findall(rf"\(notebooks/(\w+)\.{ending}\)", table))
    gallery = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    assert names == set(re.findall(r"examples/notebooks/(\w+)\.py", gallery))


@pytest.mark.parametrize("path", sorted(NOTEBOOKS.glob("*.py")), ids=lambda path: path.stem)
def test_links_of_a_notebook_lead_somewhere(path):
    targets = re.findall(r"\]\s*\(([^)]+)\)", path.read_text(encoding="utf-8"))
    assert targets
    assert [target for target in targets if not (path.parent / target).exists()] == []


def test_the_filter_finds_a_force_that_nobody_measures(run):
    names = run("estimator")
    true = names["flight"]["force"][names["settled"], 1].mean()
    assert 0.2 < true < 0.4
    for force in names["estimates"].values():
        assert force[names["settled"]].mean() == pytest.approx(true, abs=0.05)


def test_the_papers_law_stays_in_the_jet_and_hovering_does_not(run):
    rmse = run("environment")["rmse"]
    assert rmse["admittance"] < 0.3 * rmse["hover"]


@pytest.mark.slow  # a diagnosis names a drag in tests/identification, the other notebooks run here
def test_the_diagnosis_of_a_log_names_what_was_added(run):
    diagnosis = run("your_log")["diagnosis"]
    assert [effect.name for effect in diagnosis.effects] == ["rotor_drag"]
    assert diagnosis.effects[0].coefficients["kdx"] == pytest.approx(1.2e-4, rel=0.1)
    assert diagnosis.after.force_rms < 0.5 * diagnosis.before.force_rms
