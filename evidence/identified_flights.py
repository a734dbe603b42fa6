"""What a user gets: vehicles that ``identify`` makes of public flights, and how well they predict.

The flights are those of ``nanodrone_benchmark``. The vehicle of all paths but one predicts this
path for 0.5 s, from a start every 0.25 s. Beside it stand the guess that nothing changes, and the
vehicle's thrust and drag with a body rate that stays.
"""

from pathlib import Path
from typing import Annotated, Any

import typer

from windwrench import __version__
from windwrench.evidence.kept_results import DOCS
from windwrench.evidence.nanodrone_benchmark import ARM, MASS
from windwrench.evidence.runner import start
from windwrench.identification.logs.reading import read_log
from windwrench.identification.prediction import PredictionErrors, errors_of_models
from windwrench.identification.vehicle_fit.geometry import parse_geometry
from windwrench.identification.vehicle_fit.held_out import models_of
from windwrench.identification.vehicle_fit.identify import identify
from windwrench.runtime.page_files import write_json
from windwrench.runtime.provenance import commit, made_by

MAP = Path(__file__).with_name("nanodrone_map.yaml")
# what predicts: the vehicle; its thrust and drag while the body rate stays; nothing changes
WAYS = ("identified vehicle", "its thrust and drag", "no change")


def row(path: str, vehicle: PredictionErrors, held_rate: PredictionErrors) -> dict[str, Any]:
    """Return the mean errors (position, velocity, attitude, rate) 0.5 s after the starts."""
    ends = [errors[:, -1].tolist() for errors in (vehicle.model, held_rate.model, vehicle.still)]
    return {"path": path, "starts": vehicle.starts} | dict(zip(WAYS, ends, strict=True))


def section(result: dict[str, Any]) -> str:
    """Return a study's result as Markdown."""
    errors = "position m | velocity m/s | attitude rad | rate rad/s"
    lines = [f"| path held out | starts | predicted by | {errors} |", "| --- " * 7 + "|"]
    for found in result["paths"]:
        for way in WAYS:
            cells = " | ".join(f"{x:.3g}" for x in found[way])
            lines.append(f"| {found['path']} | {found['starts']} | {way} | {cells} |")
    made = made_by("python -m evidence.identified_flights", [result["commit"]], result["version"])
    return "\n".join([made, "", *lines, ""])


def study(
    data: Annotated[Path, typer.Option(help="Folder of the 13 training flights.")] = Path(
        "../shared/data/idsia"
    ),
    out: Annotated[Path, typer.Option(help="Results file.")] = DOCS / "identify" / "flights.json",
) -> None:
    """Identify a vehicle from all paths but one, and predict that one."""
    files = sorted(data.glob("*.parquet"))
    if not files:
        print(f"{data}: no flights (*.parquet); skipped")
        return
    code, rows, parts = commit(), [], []
    flights = {path: read_log(path, map=MAP) for path in files}
    for held in dict.fromkeys(path.stem.split("_")[0] for path in files):
        seen = [log for path, log in flights.items() if not path.stem.startswith(held)]
        unseen = [log for path, log in flights.items() if path.stem.startswith(held)]
        vehicle = identify(seen, MASS, parse_geometry(str(ARM))).vehicle
        print(f"{held}: {vehicle.status.force} force, {vehicle.status.torque} torque", flush=True)
        parts.append(errors_of_models(unseen, [vehicle, models_of(vehicle)[2]]))
        rows.append(row(held, *parts[-1]))
    rows.append(row("all", *(PredictionErrors.pooled(of) for of in zip(*parts, strict=True))))
    result = {"version": __version__, "commit": code, "paths": rows}
    print(section(result))
    write_json(result, out)


if __name__ == "__main__":
    start(study)
