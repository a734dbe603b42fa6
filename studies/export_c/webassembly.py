"""An exported filter as WebAssembly, flown by Node.js: what a page in a browser would run."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from windwrench.live.export_c import Exported
from windwrench.studies.export_c.compiled import CompiledFilter, missing, run, write

Array = NDArray[np.float64]
_FOLDER = Path(__file__).parent / "browser"
TOOLS = ("clang", "wasm-ld", "node")
_COLUMNS = ("dt", "rotor_speeds", "position", "quaternion")


def tools_missing() -> list[str]:
    """Return which of the tools are not installed, clang's target among them."""
    lacking = missing(*TOOLS)
    if not lacking and "wasm32" not in run("clang", "--print-targets", cwd=Path()):
        lacking = ["clang's target wasm32"]
    return lacking


def build(exported: Exported, folder: Path) -> Path:
    """Write the module ``filter.wasm`` into a folder; return it.

    Raises:
        RuntimeError: it does not compile.
    """
    write(exported, folder)
    for file in _FOLDER.iterdir():
        (folder / file.name).write_text(file.read_text(encoding="utf-8"), encoding="utf-8")
    options = ("-std=c99", "-O2", "-fno-math-errno", "-Wall", "-Wextra", "-Werror")
    run(
        *("clang", "--target=wasm32", "-mbulk-memory", "-ffreestanding", "-nostdlib", "-I."),
        *(*options, "page.c", "windwrench_filter.c", "-Wl,--no-entry", "-Wl,--strip-all"),
        *("-o", "filter.wasm"),
        cwd=folder,
    )
    return folder / "filter.wasm"


def fly(exported: Exported, flight: Mapping[str, Array], folder: Path) -> tuple[int, Array]:
    """Return the module's bytes, and (n, 20) status and estimate after each row of a flight but the
    first, at which the filter starts.

    Raises:
        RuntimeError: a tool fails.
    """
    module = build(exported, folder)
    rows = np.concatenate([np.atleast_2d(flight[name].T).T for name in _COLUMNS], axis=1)
    numbers = [[x if np.isfinite(x) else None for x in row] for row in rows.tolist()]
    (folder / "flight.json").write_text(json.dumps(numbers), encoding="utf-8")
    said = json.loads(run("node", "fly.js", cwd=folder))
    return module.stat().st_size, np.array(said, dtype=np.float64)


def apart(
    said: Array, exported: Exported, flight: Mapping[str, Array], folder: Path
) -> tuple[float, int]:
    """Return how far apart, at most, what ``fly`` returned and the same filter compiled for this
    machine are, in standard deviations, and in how many steps the status differs.
    """
    c = CompiledFilter(exported, folder / "here")
    c.reset(flight["position"][0], flight["quaternion"][0])
    worst, statuses = 0.0, 0
    for k, row in enumerate(said, 1):
        c.predict(flight["rotor_speeds"][k], flight["dt"][k])
        c.correct(flight["position"][k], flight["quaternion"][k])
        e = c.estimate
        mine = [*e.position, *e.quaternion, *e.velocity, *e.angular_velocity, *e.torque, *e.force]
        # half an angle is what a quaternion turns by
        std = [*e.std_position, *[0.5 * max(e.std_attitude)] * 4, *e.std_velocity]
        std += [*e.std_angular_velocity, *e.std_torque, *e.std_force]
        worst = max(worst, float(np.max(np.abs(row[1:] - mine) / np.array(std))))
        statuses += int(row[0] != e.status)
    return worst, statuses
