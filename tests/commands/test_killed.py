"""Commands that are killed (no chance to clean up) leave no half file and no process; run again
they give the same result.
"""

import gzip
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from windwrench.dynamics import load_vehicle
from windwrench.envs.recording import record_flight
from windwrench.identification.logs.flight_log import FlightLog, write_log
from windwrench.runtime.whole_files import replaced

START = "from windwrench.cli import main; main()"
STUDY = """
from pathlib import Path
from windwrench.studies.probabilities.flights import recorded
from windwrench.studies.runner import run_tasks
if __name__ == "__main__":
    run_tasks(recorded, [("own", "nothing", 1)], Path("out/study.jsonl"), jobs=2)
"""
COMMANDS = {
    "benchmark": "benchmark --controllers hover --scenarios static --episodes 6 --jobs 2 --out out",
    "diagnose": "diagnose flight.csv --out out",
    "fleet": "fleet . --jobs 1 --out out",
    "reproduce": "reproduce fig6 --seeds 1 --out out",
}

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/stat").exists(), reason="looks for processes in Linux's /proc"
)


def start(folder, name, **options):
    words = ["-c", START, *COMMANDS[name].split()] if name in COMMANDS else ["study.py"]
    streams = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL} | options
    return subprocess.Popen([sys.executable, *words], cwd=folder, start_new_session=True, **streams)


def processes_of(session):
    """Return those processes of a session that still run."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == session and fields[0] != "Z":
            found.append(int(path.parent.name))
    return found


def assert_ends(session, seconds=20.0):
    deadline = time.monotonic() + seconds
    while processes_of(session) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert processes_of(session) == []


def assert_whole(folder):
    """Every result that is there is whole; a temporary file has a name that no one takes for a
    result.
    """
    for path in folder.rglob("*"):
        if path.name.startswith("."):
            continue
        if path.suffix == ".json":
            json.loads(path.read_text(encoding="utf-8"))
        elif path.suffix == ".gz":
            assert gzip.decompress(path.read_bytes()).endswith(b"\n"), path
        elif path.suffix == ".png":
            assert path.read_bytes().endswith(b"IEND\xaeB`\x82"), path
        elif path.suffix in (".svg", ".html"):
            assert path.read_text(encoding="utf-8").rstrip().endswith(("</svg>", "</html>")), path


def results(folder):
    """Return what a run has written; times of the flights' diagnoses are no result."""
    kept = {}
    for path in sorted(folder.rglob("*")):
        if path.is_dir():
            continue
        if path.suffix == ".jsonl":
            lines = [json.loads(line) for line in path.read_text().splitlines()]
            kept[path.name] = sorted(json.dumps(timeless(line)) for line in lines)
        elif path.name != "run.json":
            kept[path.name] = path.read_bytes()
    return kept


def timeless(value):
    """Return a kept value without the times that the work took."""
    if isinstance(value, dict):
        return {k: timeless(v) for k, v in value.items() if k not in ("cost", "seconds", "cpu_s")}
    return [timeless(v) for v in value] if isinstance(value, list) else value


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """The bytes of a short flight log."""
    path = tmp_path_factory.mktemp("flight") / "flight.csv"
    flown = record_flight(load_vehicle("ardrone2"), trajectory="gentle", seconds=12.0)
    write_log(FlightLog(**flown, vehicle="ardrone2"), path)
    return path.read_bytes()


@pytest.mark.parametrize("name", [*COMMANDS, "study"])
@pytest.mark.slow
def test_a_killed_run_leaves_nothing_half_and_can_be_run_again(tmp_path, flight, name):
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    for folder in (whole, cut):
        folder.mkdir()
        (folder / "flight.csv").write_bytes(flight)
        (folder / "study.py").write_text(STUDY)
    begun = time.monotonic()
    assert start(whole, name).wait() == 0
    lasted = time.monotonic() - begun
    run = start(cut, name)
    time.sleep(random.uniform(0.3, 0.95) * lasted)
    # the command alone: what becomes of its workers is the question
    os.kill(run.pid, signal.SIGKILL)
    run.wait()
    assert_whole(cut)
    assert_ends(run.pid)
    assert start(cut, name).wait() == 0
    assert results(cut) == results(whole)


def test_a_reader_who_goes_away_costs_no_results(tmp_path, flight):
    """As a pipe to ``head`` does: what is written comes before what is said."""
    (tmp_path / "flight.csv").write_bytes(flight)
    run = start(tmp_path, "diagnose", stdout=subprocess.PIPE)
    run.stdout.close()
    run.wait()
    assert {path.name for path in (tmp_path / "out").iterdir()} >= {
        "report.json",
        "report.html",
        "vehicle.yaml",
    }
    assert_whole(tmp_path / "out")


def test_what_a_killed_writer_left_is_swept_away(tmp_path):
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    (tmp_path / f".a.json.{gone.pid}.tmp").write_text("half")
    (tmp_path / f".a.json.{os.getppid()}.tmp").write_text("someone's who still writes")
    (tmp_path / ".a.json.tmp").write_text("not one of ours")
    with replaced(tmp_path / "a.json") as partial:
        partial.write_text("whole")
    assert {p.name for p in tmp_path.iterdir()} == {
        "a.json",
        f".a.json.{os.getppid()}.tmp",
        ".a.json.tmp",
    }
    assert (tmp_path / "a.json").read_text() == "whole"
