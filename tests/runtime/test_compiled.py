"""A first call that compiles says so; the next one does not."""

import os
import sys

import pytest

from tests.support.programs import said
from windwrench.runtime.compile_notice import LINE, CompileNotice


@pytest.fixture
def told():
    """A notice whose time never comes by itself."""
    notice = CompileNotice(patience=1e6)
    yield notice
    if notice._timer is not None:
        notice._timer.cancel()


def test_a_long_wait_is_told_once(told, capsys):
    told.begin()
    told.begin()
    told._tell()
    told.begin()
    told._tell()
    assert capsys.readouterr().err == f"{LINE}\n"


def test_a_short_wait_and_a_quiet_one_are_not_told(told, capsys):
    told.begin()
    told.end()
    told._tell()
    told.quiet = True
    told.begin()
    told._tell()
    assert capsys.readouterr().err == ""


def test_numba_tells_what_it_compiles_and_not_what_it_loads(tmp_path):
    (tmp_path / "loops.py").write_text(
        "from windwrench.runtime.compiled import compiled, notice\n"
        "@compiled\ndef double(x):\n    return 2 * x\n"
        "begun = []\nnotice.begin = lambda: begun.append('double')\n"
        "print(double(3), begun)\n"
    )
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    runs = [said(sys.executable, "loops.py", cwd=tmp_path, env=environment) for _ in range(2)]
    assert runs == ["6 ['double']\n", "6 []\n"]
