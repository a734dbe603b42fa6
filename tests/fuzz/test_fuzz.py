"""Spoiled inputs: read, or refused with a message that names them; nothing runs, hangs, grows or is
written. Files of a stranger who means harm are in ``tests/runtime/test_hostile_files.py``.
"""

import contextlib
import os
import resource
import signal
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from tests.fuzz.forms import Form, forms, lay_out
from windwrench.cli import main
from windwrench.dynamics import InputError
from windwrench.identification.logs.reading import read_log

FORMS = forms()
# of each form; more are tried with WINDWRENCH_FUZZ_INPUTS=1000 python -m pytest -n0 tests/fuzz
INPUTS = int(os.environ.get("WINDWRENCH_FUZZ_INPUTS", "10"))
LONGEST = 10.0  # s of processor time, for one input
MOST_MEMORY = 4 * 2**30  # bytes, beside what the process has
COMMANDED = 20  # refused inputs, of which one goes through the whole command
MANY = settings(
    max_examples=INPUTS,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=list(HealthCheck),
)


class TooLong(BaseException):
    """Not an Exception: code that catches every Exception must not catch it."""


@contextlib.contextmanager
def bounded(longest):
    """End the block after ``longest`` seconds of processor time or at 4 GiB more memory; a warning
    of numbers that overflow is an error.
    """

    def stop(*_):
        raise TooLong(f"more than {longest:g} s")

    held = int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
    before = signal.signal(signal.SIGVTALRM, stop)
    limits = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (held + MOST_MEMORY, limits[1]))
    signal.setitimer(signal.ITIMER_VIRTUAL, longest)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", category=RuntimeWarning)
            yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)
        resource.setrlimit(resource.RLIMIT_DATA, limits)


def is_refused(form, path, longest=LONGEST):
    """Use a file; return whether it is refused, in words that name the file."""
    with bounded(longest):
        try:
            form.use(path)
            return False
        except InputError as error:
            said = str(error)
    assert path.stem in said or (said.strip() and not form.command)
    return True


def assert_command_refuses(form, path, monkeypatch, capsys):
    """The form's command ends with exit code 2 and one line, and writes nothing."""
    before = set(path.parent.iterdir())
    monkeypatch.chdir(path.parent)
    monkeypatch.setattr(sys, "argv", ["windwrench", *form.command, path.name])
    capsys.readouterr()
    with pytest.raises(SystemExit) as ended:
        main()
    said = capsys.readouterr()
    assert ended.value.code == 2
    assert said.out[:7] in ("", "# A map")  # so far
    (line,) = said.err.strip().splitlines()
    assert line.startswith("error: ")
    assert set(path.parent.iterdir()) == before


@pytest.mark.parametrize("name", FORMS)
def test_spoiled_inputs_are_read_or_refused(name, tmp_path, monkeypatch, capsys):
    form = FORMS[name]
    refused = []
    assert not is_refused(form, lay_out(form, form.good(), tmp_path / "input"), longest=900.0)

    @MANY
    @given(form.spoiled)
    def every(data):
        if is_refused(form, lay_out(form, data, tmp_path / "input")):
            refused.append(data)

    every()
    assert refused
    for data in refused[::COMMANDED] if form.command else ():
        path = lay_out(form, data, tmp_path / "input")
        assert_command_refuses(form, path, monkeypatch, capsys)


def hang(path):
    while True:
        pass


@pytest.mark.parametrize(
    ("use", "seen"),
    [
        (lambda path: 1 / 0, ZeroDivisionError),
        (hang, TooLong),
        (lambda path: np.float64(1e308) * 10, RuntimeWarning),
        (lambda path: np.ones(MOST_MEMORY), MemoryError),
        (lambda path: read_log(path.parent / "other.csv"), AssertionError),
    ],
    ids=["trips", "hangs", "overflows", "grows", "names another file"],
)
def test_faults_are_seen(use, seen, tmp_path):
    form = Form("bad", "spoiled.txt", bytes, (), use, ("estimate",))
    with pytest.raises(seen):
        is_refused(form, tmp_path / "spoiled.txt", longest=0.2)


def test_a_command_that_takes_its_input_is_seen(tmp_path, monkeypatch, capsys):
    good = FORMS["CSV"]
    path = lay_out(good, good.good(), tmp_path / "input")
    with pytest.raises((AssertionError, pytest.fail.Exception)):
        assert_command_refuses(good, path, monkeypatch, capsys)
