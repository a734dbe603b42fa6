"""``windwrench fleet``: every log gets its outcome, and none stops the others."""

import csv
import json

import pytest
from pebble import ProcessExpired

from tests.support.diagnoses import fleet_row
from windwrench.identification.fleet.flight import key_of
from windwrench.identification.fleet.manifest import find_logs
from windwrench.identification.fleet.outcomes import Outcomes
from windwrench.identification.fleet.running import OUTCOMES
from windwrench.runtime import workers


class Here:
    """Workers in this process, so that nothing has to start: they do, or lose, a task."""

    count = 1

    def __init__(self, work, count, most_seconds):
        self.work = work

    def start(self, task):
        future = workers.Future()
        if "killer" in task.name:
            future.set_exception(ProcessExpired("gone", -9))
        elif "endless" in task.name:
            future.set_exception(TimeoutError("Task timeout"))
        else:
            future.set_result(self.work(task))
        return future

    def wait(self, running, seconds):
        return set(running)

    def end(self):
        pass


@pytest.fixture
def here(monkeypatch):
    monkeypatch.setattr(workers, "_Local", Here)


@pytest.fixture
def logs(tmp_path):
    """A folder of logs of which one is diagnosed already, and none other can be read."""
    folder = tmp_path / "logs"
    (folder / "alpha").mkdir(parents=True)
    for name in ("alpha/flight2.csv", "alpha/killer.csv", "alpha/endless.csv", "done.csv"):
        (folder / name).write_text(f"t,px\n0,{name}\n")
    (folder / "alpha" / "copy.csv").write_bytes((folder / "alpha" / "flight2.csv").read_bytes())
    found, _ = find_logs([folder], vehicle="ardrone2")
    out = tmp_path / "out"
    out.mkdir()
    outcomes = Outcomes(out / OUTCOMES)
    outcome = fleet_row("", 0, (0.04, 0.001))
    del outcome["id"], outcome["flight"]  # a fleet says them
    outcomes.add({"key": key_of(next(x for x in found if x.name == "done.csv"), ()), **outcome})
    return folder


def outcomes_in(folder):
    lines = map(json.loads, (folder / OUTCOMES).read_text().splitlines())
    return [(line["status"], line.get("kind")) for line in lines]


def test_no_log_stops_the_others(call, here, logs, tmp_path):
    arguments = ("fleet", "logs", "--vehicle", "ardrone2", "--out", "out", "--limit", "1")
    code, said, _ = call(*arguments, "--json")
    assert code == 0
    result = json.loads(said)["result"]
    assert result["logs"] == 5
    assert result["refused"] == {"input": 2, "died": 1, "time": 1}
    assert result["individuals"]["ardrone2"] == {"diagnosed": 1, "refused": 0}
    table = list(csv.DictReader(open(tmp_path / "out" / "fleet.csv", newline="")))  # noqa: SIM115
    reasons = {line["log"]: line["reason"] for line in table}
    assert reasons["alpha/killer.csv"].endswith(
        "its process was ended by SIGKILL, as where memory runs out"
    )
    assert reasons["alpha/endless.csv"].endswith("it took more than 1 s")
    assert "missing column(s)" in reasons["alpha/copy.csv"]
    assert "the same flight as alpha/copy.csv" in reasons["alpha/flight2.csv"]
    assert reasons["done.csv"] == ""
    for name in ("fleet.html", "fleet.json", "fleet.png", "run.json"):
        assert (tmp_path / "out" / name).exists()
    once = outcomes_in(tmp_path / "out")
    assert len(once) == 5
    assert call(*arguments)[0] == 0  # nothing is done again
    assert outcomes_in(tmp_path / "out") == once
    again = call(*arguments[:-1], "2")  # but what a limit had ended
    assert again[0] == 0
    assert sorted(outcomes_in(tmp_path / "out")[5:]) == [("refused", "died"), ("refused", "time")]


def test_a_fleet_of_which_nothing_is_left_says_so(call, here, logs):
    code, _, error = call("fleet", "logs/alpha/flight2.csv", "--out", "other")
    assert code == 2
    assert "none of 1 logs could be diagnosed" in error
    assert "fleet.html" in error
