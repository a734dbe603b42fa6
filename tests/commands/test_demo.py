"""What a new user sees first: the demonstration, the examples, and all that a log allows."""

import json
import re
from pathlib import Path

import pytest

from tests.commands.conftest import recorded
from windwrench.commands.diagnosing import confronted
from windwrench.dynamics.effects import names
from windwrench.identification.logs.example import example_flight
from windwrench.identification.logs.reading import read_log


def test_the_demo_tells_its_story_on_one_offline_page(call, monkeypatch):
    monkeypatch.setattr("windwrench.demo.story.LAWS", ("hover", "oracle"))
    monkeypatch.setattr("windwrench.demo.story.SECONDS", 18.0)
    code, out, _ = call("demo", "--episodes", 1, "--out", "demo", "--json")
    assert code == 0
    result = json.loads(out)["result"]
    assert result["found"] == ["constant_torque"]
    assert result["verdict"] == "explained"
    assert len(result["steps"]) == 6
    assert {row["controller"] for row in result["leaderboard"]} >= {"hover", "oracle"}
    page = Path(result["page"]).read_text(encoding="utf-8")
    assert not re.findall(r"(?:src|href)=\"https?:", page)
    assert page.count("data:image/png;base64,") == 3
    for step in result["steps"]:
        assert step["title"] in page
        assert step["command"].startswith("windwrench ")
    assert "diagnose/report.html" in page
    words = " ".join(result["steps"][0]["sentences"])
    ours, hover = map(float, re.findall(r"([0-9.]+) m\b", words))
    assert ours < 0.5 * hover
    assert Path("demo/diagnose/report.html").is_file()
    # the log holds no truth that would give the effect away
    assert "fx" not in Path("demo/flight.csv").read_text().splitlines()[0].split(",")


def test_the_example_is_a_measured_flight_with_its_licence():
    with example_flight() as example:
        log = read_log(example.log)
        assert log.t[-1] == pytest.approx(18.0, abs=0.05)
        assert log.voltage[-1] < log.voltage[0]  # as is said to be known
        assert "Syed Izzat Ullah" in example.log.with_name("LICENSE").read_text()
        assert "BSD 3-Clause" in example.source
        assert example.log.stat().st_size < 150_000


def test_what_is_known_is_set_beside_what_was_named():
    with example_flight() as example:
        rows = confronted(
            example,
            [
                {"name": "battery_sag", "indistinguishable_from": []},
                {"name": "constant_force", "indistinguishable_from": ["mass"]},
            ],
        )
    assert [row["named"] for row in rows] == [["battery_sag"], ["constant_force"], []]


def test_the_example_is_diagnosed_beside_what_is_known(call):
    few = {"rotor_drag", "body_drag", "battery_sag", "thrust_scale"}
    few = [word for name in {*names()} - few for word in ("--without", name)]
    code, out, _ = call("diagnose", "--example", *few, "--no-open", "--out", "example")
    assert code == 0
    assert "Known before the diagnosis:" in out
    assert "Known: rotor_drag or body_drag, found as" in out
    assert "page: file://" in out
    assert json.loads(Path("example/report.json").read_bytes())["effects"]


def test_the_example_of_a_comparison_has_the_known_answer(call):
    code, out, _ = call("compare", "--example", "--out", "compared", "--json")
    assert code == 0
    found = json.loads(out)["result"]
    assert found["place"] == "rotor 2 (rear-left)"
    assert found["probabilities"]["rotor 2 (rear-left)"] > 0.95


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("look") / "flight.csv"
    # of less, 12 s do not tell whether it is a force, a tilt or a slow gust
    return recorded(path, "--trajectory", "excite", effect="constant_force:fx=0.6")


def test_a_log_in_place_of_a_command_ends_with_a_page(call, log):
    code, out, _ = call(log, "--out", "all", "--no-open")
    assert code == 0
    said, _, page = " ".join(out.split()).partition("page: file://")
    assert re.search(r"Missing effects: .*constant force.*\d m?N\b", said)
    assert " " not in page  # no sentence is said again
    page = Path("all/log.html").read_text(encoding="utf-8")
    for name in ("check", "estimate", "diagnose"):
        command = f"windwrench {name} {log}"
        assert command in out
        assert command in page
    assert "diagnose/report.html" in page
    effects = json.loads(Path("all/diagnose/report.json").read_bytes())["effects"]
    assert [e["name"] for e in effects] == ["constant_force"]
    assert "look" in json.loads(Path("all/run.json").read_bytes())


def test_a_log_of_an_unknown_vehicle_is_told_how_one_is_made(call, log, tmp_path):
    text = log.read_text().replace("ardrone2", "nobodys")
    (tmp_path / "theirs.csv").write_text(text)
    code, out, _ = call("theirs.csv", "--out", "all", "--no-open")
    assert code == 0
    assert "windwrench identify theirs.csv --mass KG" in out
    assert "Flight of 12 s by nobodys" in " ".join(out.split())
    assert not Path("all/estimate").exists()


def test_no_command_is_proposed_that_refuses_the_log(call, log, tmp_path):
    header, *rows = log.read_text().replace("ardrone2", "nobodys").splitlines()
    columns = [header.split(",").index(f"omega{i}") for i in range(1, 5)]
    for i, row in enumerate(rows):
        cells = row.split(",")
        for column in columns:
            cells[column] = cells[columns[0]]
        rows[i] = ",".join(cells)
    (tmp_path / "theirs.csv").write_text("\n".join([header, *rows]))
    code, out, _ = call("theirs.csv", "--out", "all", "--no-open")
    assert code == 0
    assert "--mass KG" not in out
    told = "identify refuses this log: theirs: rotor speeds of motors 1 and 2 are equal"
    assert told in " ".join(out.split())
    page = Path("all/log.html").read_text(encoding="utf-8")
    assert page.index("Doubt: rotor speeds of motors 1 and 2") < page.index("The log")
