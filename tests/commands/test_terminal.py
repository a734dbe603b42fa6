"""The command at the edges of its surroundings: terminals, full disks, encodings, interrupts,
displays. Each ends in one clear line and the right exit code.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.support.parameters import mostly_slow
from tests.support.programs import started
from windwrench.commands.terminal import console, show_table
from windwrench.runtime.printable import printable

pytestmark = pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs Linux's devices")
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
    assert_one_line(run(b"estimate", name), rb"a\x1b[31m\xff" + "é".encode() + rb"\r.csv: cannot")
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
    "display", mostly_slow([{}, {"DISPLAY": ":4711"}, {"WAYLAND_DISPLAY": "none"}], {}.__eq__)
)
def test_a_window_without_a_display_is_an_error(display, tmp_path):
    done = run("fly", "--view", folder=tmp_path, environment=display)
    assert_one_line(done, b"render: no window without a display", b"rgb_array")
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_way_to_draw_is_named(tmp_path):
    done = run("fly", folder=tmp_path, environment={"MUJOCO_GL": "bogus"})
    assert_one_line(done, b"MUJOCO_GL=bogus", b"expected egl, osmesa, glfw or disable")


@pytest.mark.parametrize("delay", mostly_slow([0.25, 0.4, 0.7, 1.1, 1.6], {0.4, 1.1}.__contains__))
def test_an_interrupt_ends_in_one_word_at_any_time(delay, tmp_path):
    words = ("benchmark", "--controllers", "hover", "--episodes", "500")
    child = started(*words, cwd=tmp_path, stderr=subprocess.PIPE)
    time.sleep(delay)
    child.send_signal(signal.SIGINT)
    said = child.communicate(timeout=60)[1]
    assert (child.returncode, said.strip().splitlines()[-1]) == (130, b"interrupted")
    assert b"Traceback" not in said
