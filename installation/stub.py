"""Write the types of ``windwrench._core`` anew: ``python installation/stub.py``.

The binding states them; a test compares the file with what the built core says.
"""

import subprocess
import sys
import sysconfig
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
STUB = ROOT / "_core/__init__.pyi"


def stub() -> str:
    """Return the stub of the baseline, as ruff formats it."""
    from nanobind.stubgen import StubGen

    import windwrench._core.baseline as core

    written = StubGen(core)
    written.put(core)
    ruff = Path(sysconfig.get_path("scripts")) / "ruff"
    words = [str(ruff), "format", "--stdin-filename", str(STUB), "-"]
    text = written.get().replace("windwrench._core.baseline", "windwrench._core")
    ended = subprocess.run(words, input=text, capture_output=True, text=True)
    return ended.stdout


if __name__ == "__main__":
    STUB.write_text(stub())
