"""Spoiled inputs: read, or refused with a message that names them; nothing runs, hangs, grows or is
written.
"""

import contextlib
import os
import pickle
import resource
import signal
import sys
import warnings
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from pyarrow import chunked_array, parquet
from pyarrow import table as arrow_table

from tests.fuzz.forms import Form, forms, lay_out
from tests.fuzz.spoiling import LAUGHS
from tests.support.compiling import compile_estimates
from windwrench.cli import main
from windwrench.controllers.trained_policy import load_policy
from windwrench.dynamics import InputError, load_vehicle
from windwrench.identification.logs.reading import read_log
from windwrench.identification.logs.tables import open_table
from windwrench.runtime.yaml_file import parse_yaml

FORMS = forms()
# of each form; more are tried with WINDWRENCH_FUZZ_INPUTS=1000 python -m pytest -n0 tests/fuzz
INPUTS = int(os.environ.get("WINDWRENCH_FUZZ_INPUTS", "15"))
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


def attempt(call, *arguments):
    """Return what a call makes of its input, and the words by which it refuses it."""
    said = None
    try:
        return call(*arguments), ""
    except InputError as error:
        said = str(error)
    assert said.strip()
    return None, said


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
    before, limits = signal.signal(signal.SIGVTALRM, stop), resource.getrlimit(resource.RLIMIT_DATA)
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
        _, said = attempt(form.use, path)
    assert not said or not form.command or path.stem in said
    return bool(said)


def assert_command_refuses(form, path, monkeypatch, capsys):
    """The form's command ends with exit code 2 and one line, and writes nothing."""
    before = set(path.parent.iterdir())
    monkeypatch.chdir(path.parent)
    monkeypatch.setattr(sys, "argv", ["windwrench", *form.command, path.name])
    capsys.readouterr()
    with pytest.raises(SystemExit) as ended:
        main()
    said = capsys.readouterr()
    assert (ended.value.code, said.out) == (2, "")
    (line,) = said.err.strip().splitlines()
    assert line.startswith("error: ")
    assert set(path.parent.iterdir()) == before


@pytest.fixture(scope="module", autouse=True)
def compiled():
    """The first use of compiled code is its slowest, and no fault of an input's."""
    compile_estimates()


@pytest.mark.parametrize("name", FORMS)
def test_spoiled_inputs_are_read_or_refused(name, tmp_path, monkeypatch, capsys):
    form, refused = FORMS[name], []
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


# what a stranger's file could do


def test_aliases_that_write_out_to_billions_are_refused(tmp_path):
    path = tmp_path / "laughs.yaml"
    path.write_text(LAUGHS)
    with pytest.raises(InputError, match="values, its aliases written out"):
        load_vehicle(path)
    with pytest.raises(InputError, match="within what it stands for"):
        parse_yaml("a: &a [*a]", "round.yaml")
    assert parse_yaml("k: &k [1, 2]\np: *k", "good.yaml") == {"k": [1, 2], "p": [1, 2]}


def test_a_parquet_file_that_claims_a_billion_rows_is_refused(tmp_path):
    path = tmp_path / "claim.parquet"
    # constant columns pack to almost nothing, and a small file unpacks to all its rows
    zeros = chunked_array([np.zeros(2_500_000)] * 10)
    parquet.write_table(arrow_table({"t": zeros}), path)
    assert path.stat().st_size < 1_000_000
    with pytest.raises(InputError, match="more than 4000000 rows; expected one flight"):
        open_table(path)


def test_a_ulog_that_holds_no_message_for_long_is_refused(tmp_path):
    """Each byte of the filling seems to begin a message of 64 kB."""
    form = FORMS["px4_ulog"]
    path = lay_out(form, form.good()[:400] + 300_000 * b"\xff", tmp_path / "input")
    with bounded(LONGEST), pytest.raises(InputError, match="places hold no message"):
        form.use(path)


def test_weights_that_are_pickles_are_refused(tmp_path):
    form = FORMS["policy, weights"]
    path = lay_out(form, form.good(), tmp_path / "input")

    class Harm:
        def __reduce__(self):
            return (Path.touch, (tmp_path / "gone",))

    with zipfile.ZipFile(path, "w") as archive:
        header = (
            b"\x93NUMPY\x01\x00v\x00{'descr': '|O', 'fortran_order': False, 'shape': (1,), }".ljust(
                127
            )
            + b"\n"
        )
        archive.writestr("weight0.npy", header + pickle.dumps(Harm()))
    assert is_refused(form, path)
    path.write_bytes(pickle.dumps(Harm()))
    with pytest.raises(InputError):
        load_policy(path)
    assert not (tmp_path / "gone").exists()
