"""What the core is built of, by content; and its build anew in a checkout after an edit.

``windwrench._core`` calls :func:`build_changed` when a checkout imports it.
"""

import fcntl
import hashlib
import os
import subprocess
import sys
import sysconfig
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SOABI = sysconfig.get_config_var("SOABI")


def sources() -> list[Path]:
    """Return the core's headers, its binding, and the files that say how they are compiled."""
    core = [p for p in (ROOT / "core").rglob("*") if p.suffix in (".hpp", ".cpp")]
    return sorted([*core, ROOT / "installation/build_core.py"])


def digest() -> str:
    """Return one digest of all sources: 2 ms for 5,000 lines."""
    sha = hashlib.sha256()
    for path in sources():
        text = path.read_bytes()
        sha.update(f"{path.relative_to(ROOT).as_posix()} {len(text)}\n".encode() + text)
    return sha.hexdigest()


def built(name: str) -> Path:
    """Return the file with the digest of the sources that an instruction set was built of."""
    return ROOT / "_core" / f"built.{name}.{SOABI}.txt"


def is_built(name: str) -> bool:
    """Return whether an instruction set in the checkout is built of today's sources."""
    return built(name).is_file() and built(name).read_text() == digest()


def build_changed(name: str) -> None:
    """Build an instruction set in the checkout where a source changed; one process builds, others
    wait.

    Raises ``ImportError`` with the compiler's words where the build fails.
    """
    if is_built(name):
        return
    with open(ROOT / "_core/.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if is_built(name):
            return
        print(f"windwrench: the core for {name} is built anew", file=sys.stderr)
        ended = subprocess.run(
            [sys.executable, "setup.py", "--quiet", "build_ext", "--inplace"],
            cwd=ROOT,
            env=os.environ | {"WINDWRENCH_CORE": name},
            capture_output=True,
            text=True,
        )
    if ended.returncode:
        raise ImportError(
            f"{ended.stderr}\nthe core could not be built in {ROOT}: expected C++ that compiles, "
            "and `pip install nanobind setuptools`, or once more `pip install -e .`"
        )
