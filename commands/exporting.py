"""The filter for a flight controller, as C."""

import shlex
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from ..runtime.errors import InputError
from .terminal import (
    Gate,
    VehicleOption,
    checked_gate,
    console,
    offering,
    results_folder,
    say,
    working,
)

_EFFECTS = ("declared", "none")


def _policy_path(name: str) -> Path | None:
    """Return the file of a trained policy, by its path or its name; None for a law.

    Raises:
        InputError: there is none of this name.
    """
    from ..controllers.registry import shipped_policies
    from ..live.export_c.policies import LAWS

    shipped = shipped_policies()
    if name in LAWS:
        return None
    if name.endswith((".npz", ".json")):
        return Path(name)
    if name not in shipped:
        raise InputError(
            f"--policy {name}: no such policy; expected {', '.join((*LAWS, *shipped))}, or the "
            "path of a trained one"
        )
    return shipped[name]


def export_c(
    vehicle: VehicleOption,
    estimator: Annotated[
        str,
        typer.Option(
            help="constant-gain (the least work), ekf or ukf.",
            autocompletion=offering("live.export_c:ESTIMATORS"),
        ),
    ] = "ekf",
    effects: Annotated[
        str,
        typer.Option(
            help="declared: the effects in the vehicle file are part of the filter's model; none: "
            "they are left out.",
            autocompletion=offering("commands.exporting:_EFFECTS"),
        ),
    ] = "declared",
    policy: Annotated[
        str | None,
        typer.Option(
            help="Also a policy that tracks a fan: lead, tracker, the name of a trained one "
            "(sac-0), or its path.",
            autocompletion=offering(
                "live.export_c.policies:LAWS", "controllers.registry:shipped_policies"
            ),
        ),
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(help="Poses a second; default: the vehicle's mocap rate_hz."),
    ] = None,
    rise_time: Annotated[
        float, typer.Option(help="Rise time of force and torque, 10-90 %, s.")
    ] = 1.0,
    gate: Gate = None,
    precision: Annotated[
        str,
        typer.Option(
            help="single (float), or double, where the processor has a unit for it.",
            autocompletion=offering("live.export_c:PRECISIONS"),
        ),
    ] = "single",
    out: Annotated[
        Path, typer.Option("--out", help="Folder for the C files; created if it does not exist.")
    ] = Path("results/export_c"),
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace C files that are there already.")
    ] = False,
) -> dict[str, Any]:
    """Write the filter as C for a flight controller. One header and one C99 source, in single
    precision unless said otherwise, and without a heap; with an example and a CMake file.

    Example: windwrench export-c --vehicle ardrone2 --estimator ekf --out filter
    """
    from dataclasses import replace

    from ..dynamics.vehicle_file import load_vehicle
    from ..live.export_c import ESTIMATORS, PRECISIONS, exportable_policy
    from ..live.export_c import export_c as export
    from ..live.export_c.export import FILES
    from ..runtime.errors import unknown_name
    from ..runtime.whole_files import replaced

    if estimator not in ESTIMATORS:
        raise unknown_name("estimator", estimator, ESTIMATORS)
    if precision not in PRECISIONS:
        raise unknown_name("precision", precision, PRECISIONS)
    if effects not in _EFFECTS:
        raise InputError(f"--effects {effects}: expected {' or '.join(_EFFECTS)}")
    model = load_vehicle(vehicle)
    if effects == "none":
        model = replace(model, effects=())
    flown = None if policy is None else exportable_policy(policy, _policy_path(policy))
    there = [out / name for name in FILES if (out / name).exists()]
    if there and not overwrite:
        raise InputError(f"{there[0]}: is there already; expected a new folder, or --overwrite")
    with working("exporting"):
        found = export(
            model,
            estimator,
            rate,
            rise_time,
            0.9999 if gate is None else checked_gate(gate) or None,
            flown,
            shlex.join(["windwrench", *sys.argv[1:]]),
            precision,
        )
    results_folder(out, vehicle=model.name, estimator=estimator, files=list(FILES))
    for name, text in found.files.items():
        with replaced(out / name) as partial:
            partial.write_text(text, encoding="utf-8")
    console.print(
        f"{estimator} of {model.name} for {1.0 / found.filter.period:g} poses a second, with "
        f"{', '.join(found.effects) or 'no effects'}.",
    )
    say(*(out / name for name in found.files))
    return {
        "vehicle": model.name,
        "estimator": estimator,
        "effects": list(found.effects),
        "policy": policy,
        "precision": precision,
        "period_s": found.filter.period,
        "files": [str(out / name) for name in found.files],
    }
