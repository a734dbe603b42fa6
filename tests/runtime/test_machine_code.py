"""Machine code is never older than the sources it comes from, and a place for it is not needed."""

import ctypes
import os
import shutil
import sys
import time

import pytest

from tests.support.paths import ROOT
from tests.support.programs import said
from windwrench.runtime.compile_notice import LINE, NOT_KEPT, CompileNotice

CALLEE = """
from windwrench.runtime.compiled import compiled
FACTOR = 2
@compiled
def scaled(x):
    return FACTOR * x
"""
CALLER = """
from windwrench.runtime.compiled import compiled
from {callee} import scaled
@compiled
def one_more(x):
    return scaled(x) + 1
"""
PROGRAM = """
import windwrench.runtime.compiled as c
functions = []
c.notice.begin = lambda: functions.append(1)
from {caller} import one_more
print(one_more(3), len(functions))
"""


@pytest.fixture
def package(tmp_path):
    """The folder above a copy of the package's lowest floor, with two compiled functions more."""
    package = tmp_path / "place" / "windwrench"
    shutil.copytree(ROOT / "runtime", package / "runtime", ignore=lambda *_: {"__pycache__"})
    shutil.copy(ROOT / "__init__.py", package)
    (package / "runtime" / "callee.py").write_text(CALLEE)
    (package / "runtime" / "caller.py").write_text(CALLER.format(callee=".callee"))
    return package.parent


PLACES = ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "PYTHONPYCACHEPREFIX")


def run(package, program=None, **options):
    """What a program says, which finds the copied package before any other."""
    environment = {k: v for k, v in os.environ.items() if k not in PLACES}
    environment |= {"PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": str(package)}
    environment |= options.pop("env", {})
    program = program or PROGRAM.format(caller="windwrench.runtime.caller")
    return said(sys.executable, "-c", program, env=environment, **options)


def edit(path, old, new):
    """Change a file and leave its size and its time as they were."""
    found = path.stat()
    text = path.read_text()
    assert old in text
    assert len(old) == len(new)
    path.write_text(text.replace(old, new))
    os.utime(path, ns=(found.st_atime_ns, found.st_mtime_ns))


def folders(package):
    return sorted((package / "windwrench" / "__pycache__").glob("windwrench-*"))


def test_an_edit_of_what_is_called_changes_what_calls_it(package):
    assert run(package) == "7 2\n"
    assert run(package) == "7 0\n"  # from the disk
    edit(package / "windwrench" / "runtime" / "callee.py", "FACTOR = 2", "FACTOR = 5")
    assert run(package) == "16 2\n"
    assert len(folders(package)) == 2
    edit(package / "windwrench" / "runtime" / "callee.py", "FACTOR = 5", "FACTOR = 2")
    assert run(package) == "7 0\n"  # that of before is still there


def test_an_edit_during_a_run_leaves_nothing_behind(package):
    callee = package / "windwrench" / "runtime" / "callee.py"
    program = f"""
import pathlib, time
import windwrench.runtime.addresses
time.sleep(.1)
pathlib.Path({str(callee)!r}).write_text({CALLEE.replace("FACTOR = 2", "FACTOR = 5")!r})
""" + PROGRAM.format(caller="windwrench.runtime.caller")
    assert run(package, program) == "16 2\n"
    edit(callee, "FACTOR = 5", "FACTOR = 2")
    assert run(package) == "7 2\n"


def test_an_edit_beside_a_users_own_file_counts(package, tmp_path):
    own = tmp_path / "own"
    own.mkdir()
    (own / "helper.py").write_text(CALLEE)
    (own / "effect.py").write_text(CALLER.format(callee="helper"))
    program = f"import sys; sys.path.append({str(own)!r})\n" + PROGRAM.format(caller="effect")
    assert run(package, program) == "7 2\n"
    assert run(package, program) == "7 0\n"
    edit(own / "helper.py", "FACTOR = 2", "FACTOR = 5")
    assert run(package, program) == "16 2\n"
    assert len(folders(package)) == 1


def test_a_function_of_a_prompt_is_compiled_and_not_kept(package):
    assert run(package, f"exec({CALLEE!r}); print(scaled(4))") == "8\n"


def test_code_not_used_for_longest_is_removed(package):
    run(package)
    cache = package / "windwrench" / "__pycache__"
    for age in range(1, 12):
        other = cache / f"windwrench-{age:016x}"
        other.mkdir()
        os.utime(other, (time.time() - 1800 * age,) * 2)
    (cache / "another").mkdir()
    edit(package / "windwrench" / "runtime" / "callee.py", "FACTOR = 2", "FACTOR = 5")
    run(package)
    left = {path.name for path in folders(package)}
    assert len(left) == 8
    assert {f"windwrench-{age:016x}" for age in range(1, 7)} <= left
    assert (cache / "another").is_dir()


def without_place(package):
    """Take the place beside the sources from anyone, even from root."""
    (package / "windwrench" / "__pycache__").write_text("")


def test_the_users_choice_comes_first_then_the_users_cache(package, tmp_path):
    def kept(folder):
        return list(folder.rglob("*one_more*.nbc"))

    for name in ("chosen", "user", "home"):
        (tmp_path / name).mkdir()
    home = {"HOME": str(tmp_path / "home")}
    run(package, env=home | {"NUMBA_CACHE_DIR": str(tmp_path / "chosen")})
    assert kept(tmp_path / "chosen")
    assert not folders(package)
    without_place(package)
    run(package, env=home | {"XDG_CACHE_HOME": str(tmp_path / "user")})
    assert kept(tmp_path / "user" / "windwrench")
    run(package, env=home)
    assert kept(tmp_path / "home" / ".cache" / "windwrench")


# the second as a user without a home is told
@pytest.mark.parametrize("home", ["/dev/null", "~"])
def test_without_a_home_it_lies_in_a_temporary_folder_of_the_users(package, tmp_path, home):
    without_place(package)
    environment = {"TMPDIR": str(tmp_path), "HOME": home}
    assert [run(package, env=environment) for _ in range(2)] == ["7 2\n", "7 0\n"]
    (folder,) = tmp_path.glob("windwrench-*")
    assert folder.stat().st_mode & 0o777 == 0o700
    folder.chmod(0o777)  # as of someone who waits for a user to run his code
    assert run(package, env=environment) == "7 2\n"


def test_without_any_place_it_is_compiled_at_each_start(package):
    without_place(package)
    program = "import tempfile; tempfile.tempdir = '/dev/null'\n" + PROGRAM.format(
        caller="windwrench.runtime.caller"
    )
    program += "print(c.notice.is_kept)"
    environment = {"HOME": "/dev/null"}
    assert [run(package, program, env=environment) for _ in range(2)] == ["7 2\nFalse\n"] * 2


def as_anyone():
    """Have root write no more than permissions say, in this process."""
    drop = 24
    may_write_all = 1
    assert ctypes.CDLL(None).prctl(drop, may_write_all, 0, 0, 0) == 0


@pytest.mark.skipif(sys.platform != "linux", reason="takes from root what it may, as Linux does")
def test_a_read_only_installation(package, tmp_path):
    home = tmp_path / "home"
    home.mkdir()
    for path in (home, *package.rglob("*")):
        path.chmod(0o555 if path.is_dir() else 0o444)
    options = {"preexec_fn": as_anyone} if os.getuid() == 0 else {}
    options["env"] = {"HOME": str(home), "TMPDIR": str(tmp_path)}
    assert run(package, **options) == "7 2\n"
    assert list(tmp_path.glob("windwrench-*/windwrench-*"))
    assert not list(home.iterdir())


def test_the_notice_says_whether_code_is_kept(capsys):
    for is_kept, line in ((True, LINE), (False, NOT_KEPT)):
        told = CompileNotice(patience=1e6)
        told.is_kept = is_kept
        told.begin()
        told._timer.cancel()
        told._tell()
        assert capsys.readouterr().err == f"{line}\n"
