"""Commands that are killed (no chance to clean up) leave no half file and no process."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.commands.conftest import recorded
from tests.support.programs import started
from windwrench.runtime.whole_files import replaced

WORK = """
import time
from pathlib import Path
from windwrench.runtime.workers import every

def work(mark):
    Path(mark).touch()
    time.sleep(600.0)

if __name__ == "__main__":
    list(every(work, ["one", "two"], jobs=2))
"""

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/stat").exists(), reason="looks for processes in Linux's /proc"
)


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


def test_the_workers_of_a_killed_run_end(tmp_path):
    (tmp_path / "work.py").write_text(WORK)
    run = started("work.py", cwd=tmp_path, of=())
    while not ((tmp_path / "one").exists() and (tmp_path / "two").exists()):
        assert run.poll() is None
        time.sleep(0.05)
    os.kill(run.pid, signal.SIGKILL)  # alone: what becomes of its workers is the question
    run.wait()
    assert_ends(run.pid)


def test_a_reader_who_goes_away_costs_no_results(tmp_path):
    """As a pipe to ``head`` does: what is written comes before what is said."""
    recorded(tmp_path / "flight.csv", "--trajectory", "gentle")
    words = ["estimate", "flight.csv", "--no-tune", "--out", "out"]
    run = started(*words, cwd=tmp_path, stdout=subprocess.PIPE)
    run.stdout.close()
    run.wait()
    out = tmp_path / "out"
    assert (out / "wrench.csv").read_bytes().endswith(b"\n")
    assert (out / "wrench.png").read_bytes().endswith(b"IEND\xaeB`\x82")


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
