"""The example scripts do what they say, each in a short version."""

import csv
import importlib
from pathlib import Path

import numpy as np
import pytest

from tests.support.own_effects import joined
from tests.support.paths import ROOT
from tests.support.searches import DRAG, recorded
from windwrench.dynamics import InputError, load_vehicle
from windwrench.dynamics import effects as library
from windwrench.identification.logs.flight_log import write_log

FOLDER = ROOT / "examples"


@pytest.fixture
def example(monkeypatch, tmp_path):
    """Return what imports a script; its folder is on the path, so that worker processes find it
    too.
    """
    monkeypatch.syspath_prepend(FOLDER)
    monkeypatch.chdir(tmp_path)
    return importlib.import_module


@pytest.fixture
def own_library(tmp_path):
    """Take effects that a test adds to the library out again."""
    with joined(tmp_path):
        yield


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
    pytest.importorskip(
        "stable_baselines3",
        reason="stable-baselines3 is not installed: pip install 'windwrench[rl]'",
    )
    found = example("sb3_ten_lines").main(steps=60, episodes=1)
    assert all(0.0 < reward <= 250.0 for reward in found.values())
    assert found["learned"] != found["hover"]


def test_rllib_does_an_iteration(example):
    pytest.importorskip("ray", reason="Ray is not installed: pip install 'windwrench[cluster]'")
    pytest.importorskip(
        "ray.rllib.algorithms.ppo", reason="RLlib lacks what it needs: pip install 'ray[rllib]'"
    )
    found = example("rllib").main(iterations=1, steps=260)
    assert found[0]["decisions"] == 260
    assert 0.0 < found[0]["return"] <= 250.0


def test_fans_on_paths_of_ones_own_are_followed_and_drawn(example, tmp_path):
    script = example("fan_path")
    t = np.linspace(0.0, 20.0, 4001)
    assert np.abs(np.gradient(script.chirp(t), t)).max() < 0.4  # m/s, what the law can follow
    assert set(np.unique(script.steps(t))) == {0.0, 0.35}
    followed = script.main(tmp_path / "followed")
    left_alone = script.main(tmp_path / "hover", controller="hover")
    assert all(followed[name] < left_alone[name] for name in script.PATHS)
    assert (tmp_path / "followed" / "fan_path.png").read_bytes().startswith(b"\x89PNG")


def test_an_effect_of_ones_own_is_found_with_its_coefficient(example, own_library, capsys):
    assert "tether" not in library.names()
    found = example("custom_effect").main(seconds=20.0, stiffness=0.12, seed=1)
    assert found.verdict == "explained"
    assert [effect.name for effect in found.effects] == ["tether"]
    assert found.effects[0].coefficients["k"] == pytest.approx(0.12, rel=0.08)
    assert found.after.force_rms < 0.8 * found.before.force_rms
    assert "tether: k = 0.1" in capsys.readouterr().out


def test_the_tether_pulls_to_its_hook_and_only_through_a_lever_turns(own_library):
    library.add_folder(FOLDER / "effects")
    model, base = library.get("tether").model.ctypes, library.base
    double = np.ctypeslib.as_ctypes
    vehicle, state, wrench = np.zeros(base.VEHICLE_SIZE), np.zeros(base.STATE_SIZE), np.zeros(6)
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # yawed by 90 degrees
    state[base.ROTATION : base.ROTATION + 9] = quarter.ravel()
    state[base.POSITION : base.POSITION + 3] = position = np.array([1.0, -2.0, 1.5])
    vehicle[base.COM : base.COM + 3] = com = np.array([0.01, 0.02, -0.03])
    model(double(np.array([0.1])), double(vehicle), double(state), double(wrench))
    force = 0.1 * (np.array([0.0, 0.0, 2.5]) - position)
    np.testing.assert_allclose(wrench[:3], force, rtol=1e-12)
    np.testing.assert_allclose(
        wrench[3:], np.cross(-com, quarter.T @ force), rtol=1e-12, atol=1e-15
    )


def test_the_filter_finds_a_force_in_a_stream_with_late_and_lost_messages(example):
    script = example("filter_on_a_stream")
    np.testing.assert_allclose(
        script.main(seconds=8.0, force=(-0.3, 0.25, 0.1), seed=3), [-0.3, 0.25, 0.1], atol=0.06
    )


def test_the_node_takes_in_a_late_pose_at_its_own_time_and_goes_on_without_any(example):
    vehicle = load_vehicle("ardrone2")
    hover, pose = 4 * [vehicle.hover_rate], ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0])
    node = example("filter_on_a_stream").WrenchNode(vehicle)
    assert node.on_rotor_speeds(0.0, hover) is None  # there is no pose to start from
    assert node.on_pose(0.0, *pose) is not None  # the first one starts the filter
    for k in range(1, 11):
        assert node.on_rotor_speeds(0.005 * k, hover) is not None
    assert node.on_rotor_speeds(0.01, hover) is None  # out of order
    assert node.on_pose(0.03, *pose) is not None
    assert node.on_pose(0.02, *pose) is not None  # both late, and the later of them first
    assert (node.filter.late, node.filter.time) == (2, pytest.approx(0.05))
    assert node.on_pose(0.052, *pose) is None  # before the rotor speeds of its time
    for k in range(11, 101):
        assert node.on_rotor_speeds(0.005 * k, hover) is not None
    assert (node.filter.late, len(node.early)) == (3, 0)
    assert node.on_pose(0.15, *pose) is None  # older than the horizon
    assert node.filter.too_late == 1


def test_a_folder_of_logs_makes_one_table_though_a_log_is_broken(example, tmp_path):
    drag = {"rotor_drag": DRAG}
    for name, effects, seconds in (("plain", {}, 16), ("drag", drag, 16), ("broken", {}, 1)):
        write_log(recorded("excite", seconds, 2, **effects), tmp_path / f"{name}.csv")
    text = (tmp_path / "broken.csv").read_text()
    (tmp_path / "broken.csv").write_text(text.replace("omega4", "rpm4", 1))
    script = example("diagnose_a_folder")
    rows = {row["log"]: row for row in script.main(tmp_path)}
    with open(tmp_path / "diagnoses" / "summary.csv", newline="", encoding="utf-8") as file:
        assert list(csv.DictReader(file)) == list(rows.values())
    assert list(rows) == ["broken.csv", "drag.csv", "plain.csv"]
    assert "missing column(s) omega4" in rows["broken.csv"]["error"]
    assert rows["broken.csv"]["verdict"] == ""
    assert rows["drag.csv"]["effects"].startswith("rotor_drag: kdx = 0.00012")
    assert rows["drag.csv"]["error"] == ""
    after, before = (float(rows["drag.csv"][f"force_{name}_N"]) for name in ("after", "before"))
    assert after < 0.9 * before
    assert rows["plain.csv"]["verdict"] == "nothing to explain"
    with pytest.raises(InputError, match=r"holds no \.csv file"):
        script.main(tmp_path / "diagnoses" / "none")
