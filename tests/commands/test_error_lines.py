"""What the command says of every bad input: one line and an exit code, kept as golden lines.

``tests/golden/error_lines.json`` holds command lines with the exit code and the last line on
standard error. A new case is a new key; ``python -m tests.commands.test_error_lines`` writes all
lines anew.
"""

import contextlib
import io
import json
import os
import shlex
import sys
import tempfile
from pathlib import Path

import pytest

from tests.support.bad_inputs import write_bad_inputs
from tests.support.paths import ROOT
from windwrench.cli import main

GOLDEN = ROOT / "tests" / "golden" / "error_lines.json"
CASES = json.loads(GOLDEN.read_bytes())


def refusal(command, folder):
    """Return the exit code of a command in a folder, and the line that says what is wrong."""
    said = io.StringIO()
    before = Path.cwd(), sys.argv
    try:
        os.chdir(folder)
        sys.argv = ["windwrench", *shlex.split(command)]
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
            main()
    except SystemExit as ended:
        code = ended.code
    finally:
        os.chdir(before[0])
        sys.argv = before[1]
    errors = [line for line in said.getvalue().splitlines() if line.startswith("error: ")]
    assert len(errors) == 1, said.getvalue()
    line = errors[0].replace(str(folder.resolve()), "FOLDER").replace(str(ROOT), "CHECKOUT")
    return [code, line]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder of bad inputs."""
    made = tmp_path_factory.mktemp("bad")
    write_bad_inputs(made)
    return made


@pytest.mark.parametrize("command", CASES)
def test_a_bad_input_ends_in_its_golden_line(command, folder):
    before = names(folder)
    assert refusal(command, folder) == CASES[command]
    assert names(folder) == before


def names(folder):
    """Return what a folder holds, but for the bytecode that Python keeps of a user's own file."""
    return sorted(path.name for path in folder.iterdir() if path.name != "__pycache__")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        write_bad_inputs(Path(made))
        lines = {}
        for case in CASES:
            try:
                lines[case] = refusal(case, Path(made))
            except AssertionError as problem:
                sys.exit(f"{case}: expected one error line, found {str(problem)!r}")
    GOLDEN.write_text(json.dumps(lines, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
