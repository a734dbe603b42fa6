"""Write the types of ``windwrench._core`` anew: ``python installation/stub.py``.

The binding states them; a test compares the file with what the built core says.
"""

import os
import re
import subprocess
import sysconfig
from importlib import import_module
from pathlib import Path

from nanobind.stubgen import StubGen

ROOT = Path(__file__).resolve().parent.parent
STUB = ROOT / "_core/__init__.pyi"


def stub() -> str:
    """Return the stub of the baseline, without values, as ruff fixes and formats it."""
    os.environ["WINDWRENCH_CORE"] = "baseline"
    core = import_module("windwrench._core.baseline")
    written = StubGen(core)
    written.put(core)
    text: str = written.get().replace("windwrench._core.baseline", "windwrench._core")
    text = re.sub(r"^(\w+: \w+) = .*$", r"\1", text, flags=re.MULTILINE)
    ruff = str(Path(sysconfig.get_path("scripts")) / "ruff")
    for action in (["check", "--fix-only", "--unsafe-fixes", "--quiet"], ["format"]):
        words = [ruff, *action, "--stdin-filename", str(STUB), "-"]
        text = subprocess.run(words, input=text, capture_output=True, text=True).stdout
    return text


if __name__ == "__main__":
    STUB.write_text(stub())
