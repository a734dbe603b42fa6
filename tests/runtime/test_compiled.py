"""A first call that compiles says so; the next one does not."""

import io
import os
import subprocess
import sys
import time

import pytest

from windwrench.runtime.compile_watch import CompileWatch, Lines

CODE = (
    "import gymnasium, windwrench\nenv = "
    "gymnasium.make('windwrench/FanTracking-v0')\nenv.reset(seed=0)\n"
    "print(env.step([0.1])[0].tobytes().hex())"
)


def until(condition, most=20.0):
    end = time.monotonic() + most
    while not condition() and time.monotonic() < end:
        time.sleep(0.01)
    assert condition()


def test_a_wait_is_explained_once_and_then_counted():
    said = []
    watch = CompileWatch(said.append, patience=0.02)
    for name in ("_first", "second"):
        watch.begin(name)
        watch.begin("inner")
        count = len(said)
        until(lambda before=count: len(said) > before + 1)
        watch.end()
        watch.end()
        until(lambda: said[-1] is None)
    assert sum("once for this installation" in (text or "") for text in said) == 1
    assert any(text and text.endswith("now second") for text in said)


def test_a_short_wait_is_not_told():
    said = []
    watch = CompileWatch(said.append, patience=60.0)
    watch.begin("quick")
    watch.end()
    until(lambda: watch._thread is None)
    assert said == []


def test_numba_tells_what_it_compiles_and_not_what_it_loads(tmp_path):
    (tmp_path / "loops.py").write_text(
        "from windwrench.runtime.compiled import compiled, watch\n"
        "@compiled\ndef double(x):\n    return 2 * x\n"
        "begun = []\nwatch.begin, watch.end = begun.append, lambda: None\n"
        "print(double(3), begun)\n"
    )
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    cold, warm = (
        subprocess.run(
            [sys.executable, "loops.py"],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
        )
        for _ in range(2)
    )
    assert cold.stdout == "6 ['double']\n", cold.stderr
    assert warm.stdout == "6 []\n", warm.stderr


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_in_a_terminal_one_line_is_written_over_and_taken_away():
    stream = Terminal()
    lines = Lines(lambda: stream)
    for text in ("compiling: 3 s, now tick", "compiling: 12 s, now step", None):
        lines(text)
    assert stream.getvalue().count("\n") == 0
    assert stream.getvalue().endswith("\r")
    assert stream.getvalue().split("\r")[-2].strip() == ""


def test_elsewhere_lines_come_now_and_then():
    stream = io.StringIO()
    lines = Lines(lambda: stream)
    for text in ("compiling: 3 s, now tick", "compiling: 3 s, now tick", None):
        lines(text)
    assert stream.getvalue() == "windwrench: compiling: 3 s, now tick\n"


@pytest.mark.slow
def test_a_cold_and_a_warm_start_give_the_same_bits(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    cold, *warm = (
        subprocess.run(
            [sys.executable, "-c", CODE],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
        )
        for _ in range(4)
    )
    assert cold.returncode == 0, cold.stderr
    assert "compiling" in cold.stderr
    assert cold.stderr.count("once for this installation") == 1
    assert not any("compiling" in run.stderr for run in warm)
    assert all(cold.stdout == run.stdout for run in warm)
