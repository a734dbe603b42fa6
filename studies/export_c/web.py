"""An exported C filter as WebAssembly, run by node: for a page that estimates in the browser.

The filter calls nothing but four functions of libm. Clang's own target ``wasm32`` compiles it
without a C library: two are instructions there, and JavaScript gives sine and cosine.
"""

import json
import subprocess
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from windwrench.live.export_c import Exported
from windwrench.studies.export_c.compiled import missing, run, write

Array = NDArray[np.float64]
TOOLS = ("clang", "wasm-ld", "node")
_FOLDER = Path(__file__).parent / "web"
_EXPORTS = ("inputs", "outputs", "start", "step")


def tools_missing() -> list[str]:
    """Return which of the tools are not installed."""
    return missing(*TOOLS)


def build(exported: Exported, folder: Path) -> Path:
    """Compile a filter to WebAssembly; return the file.

    Raises:
        RuntimeError: it does not compile.
    """
    write(exported, folder)
    for source in _FOLDER.iterdir():
        (folder / source.name).write_text(source.read_text(encoding="utf-8"), encoding="utf-8")
    run(
        *("clang", "--target=wasm32", "-std=c99", "-O2", "-ffreestanding", "-nostdlib", "-I."),
        *("-Wl,--no-entry", "-Wl,--allow-undefined"),
        *(f"-Wl,--export={name}" for name in _EXPORTS),
        *("windwrench_filter.c", "fly.c", "-o", "filter.wasm"),
        cwd=folder,
    )
    return folder / "filter.wasm"


def fly(program: Path, flight: Mapping[str, Array]) -> Array:
    """Return the estimates (n, 19) of a compiled filter along a flight of ``flights``: position,
    quaternion, velocity, angular velocity, torque and force as ``ww_get`` writes them.

    Raises:
        RuntimeError: node or the filter fails.
    """
    names = ("dt", "rotor_speeds", "position", "quaternion")
    rows = np.concatenate([np.atleast_2d(flight[name].T).T for name in names], axis=1)
    given = [[x if np.isfinite(x) else None for x in row] for row in rows.tolist()]
    done = subprocess.run(
        ["node", str(program.with_name("fly.mjs")), str(program)],
        input=json.dumps(given),
        capture_output=True,
        text=True,
        timeout=600.0,
    )
    if done.returncode != 0:
        raise RuntimeError(f"node ended with {done.returncode}: {done.stderr[-3000:]}")
    # what is not known is NaN, which JSON writes as null
    return np.array(json.loads(done.stdout), dtype=np.float64)
