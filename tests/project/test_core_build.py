"""The core is built by what lies in a checkout, with a compiler and without; an edit is built."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.paths import ROOT
from tests.support.programs import said
from tests.support.sources import copied

sys.path.insert(0, str(ROOT / "installation"))
compilers = pytest.importorskip("compilers")
pytest.importorskip("nanobind")
HEADER = "#pragma once\nconstexpr int edited = {};\n"
UNIT = """#include <nanobind/nanobind.h>
#include "../../edited.hpp"
NB_MODULE(WINDWRENCH_MODULE, m) { m.attr("edited") = edited; }
"""
needs_compiler = pytest.mark.skipif(
    compilers.system_compiler() is None, reason="there is no C++ compiler on this machine"
)


def before(folder):
    """The environment in which Python finds what is in a folder first."""
    path = os.pathsep.join([str(folder), *filter(None, [os.environ.get("PYTHONPATH")])])
    return os.environ | {"PYTHONPATH": path}


def imported(checkout, what):
    """Start a program that prints a value of a checkout's core."""
    words = [sys.executable, "-c", f"from windwrench import _core; print(_core.{what})"]
    return subprocess.run(words, env=before(checkout.parent), capture_output=True, text=True)


@needs_compiler
def test_an_edit_of_a_header_changes_the_next_run(tmp_path):
    """Of a core of one small unit, which is built as the whole is, for each instruction set."""
    checkout = tmp_path / "windwrench"
    copied(checkout, objects=True)
    header = checkout / "core/edited.hpp"
    header.write_text(HEADER.format(1))
    for unit in (checkout / "core/binding/units").iterdir():
        unit.unlink()
    (checkout / "core/binding/units/small.cpp").write_text(UNIT)
    assert imported(checkout, "edited").stdout == "1\n"
    assert len([*checkout.glob("_core/*.so")]) == 1  # this machine's set
    (nanobind,) = checkout.glob("build/core/*/nanobind/*.o")
    compiled = nanobind.stat()
    header.write_text(HEADER.format(2))
    first = imported(checkout, "edited")
    assert first.stdout == "2\n"
    assert "built anew" in first.stderr
    assert nanobind.stat() == compiled
    assert imported(checkout, "edited").stderr == ""
    header.write_text("no C++\n")
    failed = imported(checkout, "edited").stderr
    assert "edited.hpp:1:1: error: " in failed
    assert "expected C++ that compiles" in failed.splitlines()[-1]


def required(path, **variables):
    """What a wheel's build requires with these compilers on the path."""
    code = "import backend; print(backend.get_requires_for_build_wheel())"
    environment = {"PATH": str(path), "PYTHONPATH": str(ROOT / "installation"), **variables}
    return said(sys.executable, "-c", code, cwd=ROOT, env=environment)


def test_zig_is_required_where_no_compiler_is(tmp_path):
    assert "'ziglang>=" in required(tmp_path)
    assert "zig" not in required(tmp_path, CXX="my-own c++")
    # GCC without the parts for C++
    (tmp_path / "g++").write_text("#!/bin/sh\necho cmath: No such file or directory; exit 1\n")
    (tmp_path / "g++").chmod(0o755)
    assert "'ziglang>=" in required(tmp_path)


@needs_compiler
def test_a_compiler_of_the_machine_is_taken():
    assert "zig" not in required(os.environ["PATH"])


def test_the_stub_says_what_the_core_says():
    stub = ROOT / "_core/__init__.pyi"
    code = "import stub; print(stub.stub(), end='')"
    path = os.pathsep.join([str(ROOT / "installation"), *sys.path[1:]])
    assert (
        said(sys.executable, "-c", code, env=os.environ | {"PYTHONPATH": path}) == stub.read_text()
    )


@needs_compiler
@pytest.mark.slow  # a build of its own: .ci/run asks for it by name
@pytest.mark.skipif(sys.platform != "linux", reason="the sanitizers are loaded first, as on Linux")
def test_the_core_s_tests_pass_under_sanitizers(tmp_path):
    """Built with the sanitizers of addresses and of undefined behaviour."""
    compiler = compilers.compiler()
    library = said(*compiler, "-print-file-name=libasan.so").strip()
    if not Path(library).is_absolute():
        pytest.skip(f"{compiler[0]} has no library for the sanitizers")
    checkout = tmp_path / "windwrench"
    copied(checkout, objects=True)
    flags = "-O0 -UNDEBUG -fsanitize=address,undefined -fno-sanitize-recover=all"
    environment = before(tmp_path) | {"CXXFLAGS": flags, "WINDWRENCH_CORE": "baseline"}
    build = ("setup.py", "--quiet", "build_ext", "--inplace")
    said(sys.executable, *build, cwd=checkout, env=environment)
    environment |= {"LD_PRELOAD": library, "ASAN_OPTIONS": "detect_leaks=0"}
    # tests/live/test_export_c.py compiles the headers alone with the sanitizers
    words = ["-m", "pytest", "-p", "no:cacheprovider", "-k", "forced or precision", "tests/core"]
    assert " passed" in said(sys.executable, *words, cwd=checkout, env=environment)
