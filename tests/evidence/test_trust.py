"""One command measures again what the page of trust shows, where code has changed."""

import subprocess

import pytest

from tests.support.outcomes import refused
from tests.support.paths import ROOT
from windwrench.evidence import trust, trust_page


def test_studies_of_other_code_run_and_others_are_left_out(tmp_path, monkeypatch, capsys):
    ran, written = [], []

    def run(words, **_):
        ran.append(words[2])
        return subprocess.CompletedProcess(words, 0)

    monkeypatch.setattr(trust.subprocess, "run", run)
    monkeypatch.setattr(trust, "is_current", lambda name: name == "recovery")
    monkeypatch.setattr(trust, "write_text", lambda text, path: written.append(path.name))
    trust.study(None, tmp_path)
    out = capsys.readouterr().out
    assert list(trust.STUDIES) == list(trust_page.RESULTS)
    needless = ("simulated_vehicles", "other_engines")  # all others need a folder
    assert ran == [f"windwrench.evidence.{name}" for name in needless]
    assert written == ["trust.md"]
    assert "recovery: kept result is of this code" in out
    assert "fan_wall: no folder" in out
    assert "0 of 2 done, 0.1 h of one core left" in out
    with refused("study"):
        trust.study(["fan"], tmp_path)


def test_a_result_is_of_this_code_until_the_code_changes(monkeypatch):
    if not (ROOT / ".git").exists():
        pytest.skip("needs a checkout")
    commit = {"commit": "HEAD"}
    monkeypatch.setattr(trust, "kept", lambda _: commit)
    monkeypatch.setattr(trust, "ROOMS", ("LICENSE",))
    one = trust.STUDIES["published"]._replace(module="none")
    monkeypatch.setattr(trust, "STUDIES", {"published": one, "perfect": one})
    monkeypatch.setattr(trust, "RESULTS", {"published": "trust.md", "perfect": "none.json"})
    assert trust.is_current("published")
    assert not trust.is_current("perfect")  # nothing is kept
    commit["commit"] = "0123456-dirty"
    assert not trust.is_current("published")
