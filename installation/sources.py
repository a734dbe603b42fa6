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
# the digest of what the extensions beside were built of
BUILT = ROOT / "_core" / f"built.{sysconfig.get_config_var('SOABI')}.txt"


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


def is_built() -> bool:
    """Return whether the extensions in the checkout are those of today's sources."""
    return BUILT.is_file() and BUILT.read_text() == digest()


def build_changed() -> None:
    """Build all sets in the checkout where a source changed; one process builds, others wait.

    Raises ``ImportError`` with the compiler's words where the build fails.
    """
    if is_built():
        return
    with open(ROOT / "_core/.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if is_built():
            return
        print("windwrench: the core changed and is built anew", file=sys.stderr)
        ended = subprocess.run(
            [sys.executable, "setup.py", "--quiet", "build_ext", "--inplace"],
            cwd=ROOT,
            env={name: value for name, value in os.environ.items() if name != "WINDWRENCH_CORE"},
            capture_output=True,
            text=True,
        )
    if ended.returncode:
        raise ImportError(
            f"{ended.stderr}\nthe core could not be built in {ROOT}: expected C++ that compiles, "
            "and `pip install nanobind setuptools`, or once more `pip install -e .`"
        )
