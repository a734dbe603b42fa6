"""The command at the edges of its surroundings: terminals, full disks, encodings, interrupts,
displays and kills. Each ends in one clear line, the right exit code, and no half file or process.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.support.parameters import mostly_slow
from tests.support.programs import started, until
from windwrench.commands.terminal import console, show_table
from windwrench.runtime.printable import printable
from windwrench.runtime.whole_files import replaced

pytestmark = pytest.mark.skipif(
    not (Path("/dev/full").exists() and Path("/proc/self/stat").exists()),
    reason="needs Linux's devices and its /proc",
)
COMMAND = [sys.executable, "-m", "windwrench"]


def run(*arguments, folder=None, **options):
    changes = options.pop("environment", {})
    unset = ("DISPLAY", "WAYLAND_DISPLAY", "MUJOCO_GL")
    environment = {name: value for name, value in os.environ.items() if name not in unset}
    return subprocess.run(
        [*COMMAND, *arguments],
        cwd=folder,
        env={**environment, **changes},
        stderr=subprocess.PIPE,
        timeout=60,
        check=False,
        **({"stdout": subprocess.PIPE} | options),
    )


def assert_one_line(done, *words):
    lines = done.stderr.strip().splitlines()
    assert (done.returncode, len(lines)) == (2, 1), done.stderr
    assert lines[0].startswith(b"error: ")
    for word in words:
        assert word in lines[0]


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("plain text, 3 %", "plain text, 3 %"),
        ("\x1b[31mred\x1b]0;title\x07", r"\x1b[31mred\x1b]0;title\x07"),
        ("over\rwritten\x08\x7f", r"over\rwritten\x08\x7f"),
        ("\x9b31m", r"\x9b31m"),
        ("turned \u202e round \u200b", r"turned \u202e round \u200b"),
        (os.fsdecode(b"name\xff"), r"name\xff"),
        ("lines\nand\ttabs\u2028", "lines\nand\ttabs\\u2028"),
        ("µ é 漢 ─ 😀", "µ é 漢 ─ 😀"),
    ],
)
def test_what_a_terminal_acts_on_is_shown(text, shown):
    assert printable(text) == shown


@pytest.mark.parametrize("width", [5, 40, 60, 80, 120])
def test_a_table_cuts_no_interval_and_no_name(width, monkeypatch, capsys):
    monkeypatch.setattr(console, "width", width)
    law = "admittance-tuned-slow-filter"
    cells = [law, "0.160 (0.150-0.170)", "0 of 40", "0.83 (0.80-0.85)", "+0.012 (-0.003-0.034)"]
    show_table(("controller", "RMSE (m), 95 %", "lost", "score", "against the best"), [cells])
    said = capsys.readouterr().out
    if width >= 60:
        assert set(" ".join(cells).split()) <= set(said.split())
    assert "…" not in said
    assert all(len(line) <= max(width, 8) for line in said.splitlines())


@pytest.mark.parametrize(
    "arguments",
    mostly_slow([["estimate", "--help"], ["--version"], ["--help"]], ["--version"].__eq__),
)
def test_a_full_disk_ends_in_one_line(arguments):
    with open("/dev/full", "wb") as full:
        done = run(*arguments, stdout=full)
    assert_one_line(done, b"standard output cannot be written: No space left on device")


def test_a_full_disk_for_errors_keeps_the_exit_code():
    done = subprocess.run(
        f"{' '.join(COMMAND)} estimate absent.csv 2>/dev/full", shell=True, check=False
    )
    assert done.returncode == 2


def test_hostile_names_are_shown_and_never_sent(call, tmp_path):
    name = b"a\x1b[31m\xff\xc3\xa9\r.csv"
    assert r"error: a\x1b[31m\xffé\r.csv: cannot" in call("estimate", os.fsdecode(name))[2]
    ascii_only = {"PYTHONIOENCODING": "ascii"}
    done = run(b"estimate", name, environment=ascii_only)
    assert_one_line(done, rb"a\x1b[31m\xff\xe9\r.csv: cannot be read")
    header = b"t,\x1b[2Jpx,\x1b]0;title\x07\n1,2,3\n"
    (tmp_path / "log.csv").write_bytes(header)
    code, _, said = call("estimate", "log.csv")
    assert code == 2
    assert r"found t, \x1b[2Jpx, \x1b]0;title\x07" in said
    assert "\x1b" not in said
    done = run("estimate", "--help", environment=ascii_only)
    assert done.returncode == 0
    assert done.stdout.isascii()


@pytest.mark.parametrize(
    "arguments",
    [
        "estimate LONG.csv",
        f"estimate {__file__} --reader rosbag:LONG.yaml",
        "estimate LONG --reader rosbag",
        f"estimate {__file__} --vehicle LONG.yaml",
        "record --seconds 1 --out LONG.csv",
        "fly --controller LONG.npz",
        "fly --controller LONG.py:A",
        "fly --out LONG/LONG",
    ],
)
def test_a_name_that_is_too_long_is_refused(call, arguments, tmp_path):
    code, _, said = call(*arguments.replace("LONG", "n" * 300).split())
    assert (code, len(said.splitlines())) == (2, 1)
    assert "nnnnnnnn" in said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "display",
    mostly_slow([{}, {"DISPLAY": ":4711"}, {"WAYLAND_DISPLAY": "none"}], {}.__eq__),
)
def test_a_window_without_a_display_is_an_error(display, tmp_path):
    done = run("fly", "--view", folder=tmp_path, environment=display)
    assert_one_line(done, b"render: no window without a display", b"rgb_array")
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_way_to_draw_is_named(tmp_path):
    done = run("fly", folder=tmp_path, environment={"MUJOCO_GL": "bogus"})
    assert_one_line(done, b"MUJOCO_GL=bogus", b"expected egl, osmesa, glfw or disable")


@pytest.mark.parametrize("delay", mostly_slow([0.0, 0.15, 0.45, 0.85, 1.35], {0.45}.__contains__))
def test_an_interrupt_ends_in_one_word_at_any_time(delay, tmp_path):
    words = ("benchmark", "--controllers", "hover", "--episodes", "500")
    child = started(*words, cwd=tmp_path, stderr=subprocess.PIPE)
    # Before that Python itself starts: its answer to an interrupt is not ours.
    until(lambda: "numpy" in Path(f"/proc/{child.pid}/maps").read_text())
    time.sleep(delay)
    child.send_signal(signal.SIGINT)
    said = child.communicate(timeout=60)[1]
    assert (child.returncode, said.strip().splitlines()[-1]) == (130, b"interrupted")
    assert b"Traceback" not in said


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


def test_the_workers_of_a_killed_run_end(tmp_path):
    (tmp_path / "work.py").write_text(WORK)
    run = started("work.py", cwd=tmp_path, of=())
    marks = tmp_path / "one", tmp_path / "two"
    until(lambda: all(mark.exists() for mark in marks) or run.poll() is not None)
    assert run.poll() is None
    os.kill(run.pid, signal.SIGKILL)  # alone: what becomes of its workers is the question
    run.wait()
    until(lambda: not processes_of(run.pid))


def test_a_reader_who_goes_away_costs_no_results(tmp_path):
    """As a pipe to ``head`` does: what is written comes before what is said."""
    words = ["record", "--seconds", "2", "--out", "flight.csv"]
    run = started(*words, cwd=tmp_path, stdout=subprocess.PIPE)
    run.stdout.close()
    run.wait()
    assert (tmp_path / "flight.csv").read_text().count("\n") == 402


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
