"""Write the types of ``windwrench._core`` anew: ``python installation/stub.py``.

The binding states them; a test compares the file with what the built core says.
"""

import subprocess
import sysconfig
from importlib import import_module
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
STUB = ROOT / "_core/__init__.pyi"


def stub() -> str:
    """Return the stub of the chosen set, as ruff fixes and formats it."""
    from nanobind.stubgen import StubGen

    import windwrench._core as chosen

    name = f"windwrench._core.{chosen.instruction_set()}"
    core = import_module(name)
    written = StubGen(core)
    written.put(core)
    text = written.get().replace(name, "windwrench._core")
    ruff = str(Path(sysconfig.get_path("scripts")) / "ruff")
    for words in ("check --fix-only --unsafe-fixes --quiet", "format"):
        words = [ruff, *words.split(), "--stdin-filename", str(STUB), "-"]
        text = subprocess.run(words, input=text, capture_output=True, text=True).stdout
    return text


if __name__ == "__main__":
    STUB.write_text(stub())
