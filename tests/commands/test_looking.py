"""``windwrench LOG``: all that a log allows, in one go."""

import json
import re
from pathlib import Path

import pytest

from tests.commands.conftest import recorded


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return recorded(tmp_path_factory.mktemp("look") / "flight.csv", "--trajectory", "excite")


def test_a_log_in_place_of_a_command_ends_with_a_sentence_and_a_page(call, log):
    code, out, _ = call(log, "--out", "all", "--no-open")
    assert code == 0
    last = " ".join(out.split()).rpartition("page: file://")[2].partition(" ")[2]
    assert re.search(r"\d m?N\b", last)
    assert "constant force" in last
    page = Path("all/log.html").read_text(encoding="utf-8")
    for name in ("check", "estimate", "diagnose"):
        command = f"windwrench {name} {log}"
        assert command in out
        assert command in page
    assert "diagnose/report.html" in page
    effects = json.loads(Path("all/diagnose/report.json").read_text())["effects"]
    assert [e["name"] for e in effects] == ["constant_force"]
    assert "look" in json.loads(Path("all/run.json").read_text())


def test_a_log_of_an_unknown_vehicle_is_told_how_one_is_made(call, log, tmp_path):
    text = log.read_text().replace("ardrone2", "nobodys")
    (tmp_path / "theirs.csv").write_text(text)
    code, out, _ = call("theirs.csv", "--out", "all", "--no-open")
    assert code == 0
    assert "windwrench identify theirs.csv --mass KG" in out
    assert "12.0 s" in out.strip().splitlines()[-1]
    assert not Path("all/estimate").exists()
