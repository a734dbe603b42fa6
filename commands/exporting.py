"""The filter for a flight controller."""

from pathlib import Path
from typing import Any

from ..runtime.errors import InputError
from .terminal import command_line, console, gate_of, results_folder, say, working


def export_c(
    vehicle: str,
    estimator: str = "ukf",
    effects: str = "declared",
    controller: str | None = None,
    policy: str | None = None,
    rate: float | None = None,
    rise_time: float = 1.0,
    gate: float | None = None,
    precision: str = "single",
    out: Path = Path("results/export_c"),
    overwrite: bool = False,
) -> dict[str, Any]:
    """Write the filter as C++ for a flight controller.

    The core's C++17 headers, one header of numbers and a C interface, without a heap; an
    example and a CMake file.

    Example: windwrench export-c --vehicle ardrone2 --estimator ukf --out filter
    """
    from dataclasses import replace

    from ..dynamics.vehicle_file import load_vehicle
    from ..live.export_c import export_c as export
    from ..live.export_c import exportable_policy
    from ..runtime.page_files import write_text

    model = load_vehicle(vehicle)
    if effects == "none":
        model = replace(model, effects=())
    flown = exportable_policy(policy) if policy else None
    with working("exporting"):
        found = export(
            model,
            estimator,
            rate,
            rise_time,
            gate_of(gate),
            flown,
            command_line(),
            precision,
            controller,
        )
    paths = {out / name: text for name, text in found.files.items()}
    there = next(filter(Path.exists, paths), None)
    if there and not overwrite:
        raise InputError(f"{there}: is there already; expected a new folder, or --overwrite")
    results_folder(out, vehicle=model.name, estimator=estimator, files=list(found.files))
    for path, text in paths.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(text, path)
    console.print(
        f"{estimator} of {model.name} for {1.0 / found.filter.period:g} poses a second, with "
        f"{', '.join(found.effects) or 'no effects'}.",
    )
    say(*(path for path in paths if path.parent == out))
    return {
        "vehicle": model.name,
        "estimator": estimator,
        "effects": list(found.effects),
        "policy": policy,
        "precision": precision,
        "period_s": found.filter.period,
        "files": [str(path) for path in paths],
    }
