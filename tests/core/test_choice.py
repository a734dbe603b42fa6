"""The build of the core that an import takes."""

import os
import re
import shutil
import subprocess
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import pytest

from tests.support.programs import said
from windwrench import _core

SAY = "from windwrench import _core; print(_core.instruction_set())"


def with_core(name):
    return {"env": os.environ | {"WINDWRENCH_CORE": name}, "capture_output": True, "text": True}


@pytest.mark.parametrize(
    ("flags", "chosen"),
    [
        ("fpu sse2", "baseline"),
        ("fpu sse2 avx avx2", "baseline"),
        ("fma avx2", "avx2"),
        ("fma avx2 avx512f", "avx2"),
        ("fma avx2 avx512f avx512dq avx512bw avx512vl", "avx512"),
    ],
)
def test_the_processor_s_flags_choose(flags, chosen):
    assert _core._chosen(_core._runnable(f"flags : {flags}"), "") == chosen


def test_builds_that_are_not_there_are_none():
    with pytest.raises(ImportError, match=r"no compiled core in .*: expected `pip install \.`"):
        _core._chosen(_core._found(["sse9"]), "")


@pytest.mark.parametrize("name", _core._names)
def test_each_build_can_be_forced(name):
    assert said(sys.executable, "-c", SAY, **with_core(name)).strip() == name


@pytest.mark.skipif(shutil.which("objdump") is None, reason="no disassembler")
@pytest.mark.parametrize("name", _core._found(_core._names))
def test_no_build_fuses_a_product_and_a_sum(name):
    """All builds have the same bits. GCC fused a turn of vectors (vfmaddsub), told not to."""
    built = Path(_core.__file__).with_name(name + EXTENSION_SUFFIXES[0])
    listing = said("objdump", "-d", "--no-show-raw-insn", str(built))
    assert len(listing) > 1e6
    assert not re.findall(r"\tvfn?m(?:add|sub)\w+", listing)


def test_a_build_that_cannot_run_is_refused_in_one_line():
    ended = subprocess.run([sys.executable, "-c", SAY], **with_core("sse9"))
    assert ended.returncode == 1
    last = ended.stderr.strip().splitlines()[-1]
    assert last.startswith("ImportError: WINDWRENCH_CORE: 'sse9': expected one of ")
    assert last.endswith("baseline here")
