"""What a user gets on a public benchmark: ``identify`` and ``predict`` on flights of a Crazyflie.

The task is that of *Nonlinear System Identification for a Nano-drone Benchmark* (Control
Engineering Practice 172, 2026): from the state at a sample and the rotor speeds after it, 50 steps
of 10 ms. The score is the mean over starts of the error's norm at each step, summed over the steps.
The vehicle of all paths but one predicts this path. It starts from the logged state, from the
state of causal filters, or from poses of the last 0.2 s. Beside it stand its thrust and drag with
an unchanged body rate, and no change.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.lib.stride_tricks import sliding_window_view
from scipy.signal import savgol_coeffs

from windwrench import __version__
from windwrench.dynamics.vehicle import Vehicle
from windwrench.evidence.kept_results import DOCS
from windwrench.evidence.runner import start
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.logs.reading import read_log
from windwrench.identification.logs.table import Array
from windwrench.identification.logs.text_table import open_table
from windwrench.identification.motion.smoothing import continuous, runs_of
from windwrench.identification.prediction import (
    QUANTITIES,
    distances,
    errors_of_models,
    predict,
)
from windwrench.identification.vehicle_fit.closed_loop import UNITS
from windwrench.identification.vehicle_fit.geometry import parse_geometry
from windwrench.identification.vehicle_fit.held_out import NO_CHANGE, SIMPLEST, models_of
from windwrench.identification.vehicle_fit.identify import identify
from windwrench.identification.vehicle_fit.result import IDENTIFIED, Identified
from windwrench.runtime.page_files import write_json
from windwrench.runtime.provenance import commit, made_by

MAP = Path(__file__).with_name("nanodrone_map.yaml")
MASS, ARM = 0.045, 0.0353  # kg, m: as the benchmark states them
_ALOFT = 0.3  # m
_HORIZON = 0.5  # s
VEHICLE, FORCE = "identified vehicle", "its thrust and drag"
WAYS = (VEHICLE, FORCE, NO_CHANGE)
PAST = "identified vehicle, from 0.2 s of poses"
_PAST = 0.2  # s


def identified(logs: Sequence[FlightLog]) -> Identified:
    """Return the vehicle of some flights."""
    return identify(logs, MASS, parse_geometry(str(ARM)))


def ways_of(vehicle: Vehicle) -> list[Vehicle]:
    """Return the models of ``WAYS``."""
    models = models_of(vehicle)
    return [vehicle, models[SIMPLEST], models[NO_CHANGE]]


def logged_states(path: Path, log: FlightLog) -> Array:
    """Return the states (N, 13) of a file at each row of its log, NaN outside the longest stretch
    above 0.3 m.
    """
    columns = ["x", "y", "z", "qw", "qx", "qy", "qz", "vx", "vy", "vz", "wx", "wy", "wz"]
    table = open_table(path).read(["t", *columns])
    t = table["t"] - table["t"][0]
    rows = np.clip(np.searchsorted(t, log.t - log.t[0] - 0.5 * log.period), 0, len(t) - 1)
    states: Array = np.column_stack([table[name] for name in columns])[rows]
    states[:, 3:7] /= np.linalg.norm(states[:, 3:7], axis=1, keepdims=True)
    first, last = max(runs_of(states[:, 2] > _ALOFT), key=lambda run: run[1] - run[0])
    states[:first], states[last:] = np.nan, np.nan
    return states


def past_states(states: Array, period: float) -> Array:
    """Return states (N, 13) by the poses of logged states alone: velocity and body rate are slopes
    of parabolas through the last 0.2 s, at their end.
    """
    count = round(_PAST / period) + 1
    weights = savgol_coeffs(count, 2, deriv=1, delta=period, pos=count - 1, use="dot")
    flown = np.isfinite(states[:, 0])
    pose = states[flown, :7]
    pose[:, 3:] = continuous(pose[:, 3:])
    slopes = sliding_window_view(pose, count, axis=0) @ weights
    pose = pose[count - 1 :]
    scalar, vector, turn = pose[:, 3:4], pose[:, 4:], slopes[:, 4:]
    rate = 2.0 * (scalar * turn - slopes[:, 3:4] * vector - np.cross(vector, turn))
    out = np.full_like(states, np.nan)
    out[np.flatnonzero(flown)[count - 1 :]] = np.hstack([pose, slopes[:, :3], rate])
    return out


def errors_ahead(
    log: FlightLog, truth: Array, vehicle: Vehicle, every: int, begin: Array | None = None
) -> Array:
    """Return a vehicle's mean errors (4, steps) against logged states (N, 13), from states (N, 13);
    None: the logged ones.
    """
    made = predict(log, vehicle, _HORIZON, every, truth if begin is None else begin)
    parts = made.position, made.quaternion, made.velocity, made.angular_velocity
    path = np.concatenate(parts, axis=2)
    ahead = truth[made.start[:, None] + np.arange(1, path.shape[1] + 1)]
    whole = np.isfinite(ahead).all(axis=(1, 2))
    return distances(path[whole], ahead[whole])


def sums(
    log: FlightLog, truth: Array, vehicle: Vehicle, every: int = 2, begin: Array | None = None
) -> list[float]:
    """Return the benchmark's score (4); arguments as of ``errors_ahead``."""
    found: list[float] = errors_ahead(log, truth, vehicle, every, begin).sum(axis=1).tolist()
    return found


def judged(found: Identified, logs: Mapping[Path, FlightLog]) -> list[dict[str, Any]]:
    """Return the errors of flights that a vehicle has not seen, flight by flight: after 0.5 s by
    its own starts, and the benchmark's sums.
    """
    ways, rows = ways_of(found.vehicle), []
    for path, log in logs.items():
        states = logged_states(path, log)
        errors = errors_of_models([log], ways)
        rows.append(
            {
                "flight": path.stem,
                "starts": errors[0].starts,
                "after_half_a_second": dict(
                    zip(WAYS, (e.model[:, -1].tolist() for e in errors), strict=True)
                ),
                "sums": {
                    **{way: sums(log, states, v) for way, v in zip(WAYS, ways, strict=True)},
                    PAST: sums(log, states, found.vehicle, begin=past_states(states, log.period)),
                },
            }
        )
    return rows


def section(result: Mapping[str, Any]) -> str:
    """Return what the page shows of a study's result, as Markdown."""
    errors = " | ".join(f"{name} {unit}" for name, unit in QUANTITIES.items())
    lines = [f"| path held out | predicted by | {errors} |", "| --- " * 6 + "|"]
    for path, rows in result["paths"].items():
        for way in rows[0]["sums"]:
            cells = " | ".join(f"{x:.3g}" for x in mean(rows, "sums", way))
            lines.append(f"| {path} | {way} | {cells} |")
    made = made_by("python -m evidence.nanodrone_benchmark", [result["commit"]], result["version"])
    return "\n".join([made, "", *lines, ""])


def mean(rows: Sequence[Mapping[str, Any]], kind: str, way: str) -> list[float]:
    """Return the mean errors (4) of flights."""
    values: list[float] = np.mean([row[kind][way] for row in rows], axis=0).tolist()
    return values


def study(
    data: Annotated[Path, typer.Option(help="Folder of the 13 training flights.")] = Path(
        "../shared/data/idsia"
    ),
    test: Annotated[
        list[Path] | None, typer.Option(help="Flights to predict, in place of the paths held out.")
    ] = None,
    paths: Annotated[
        list[str] | None, typer.Option(help="Paths to hold out; default: each of them.")
    ] = None,
    runs: Annotated[int, typer.Option(help="Flights of each path, the first ones.")] = 4,
    out: Annotated[
        Path | None,
        typer.Option(help="Results file; default: the page's, if no flights are given."),
    ] = None,
) -> None:
    """Identify a vehicle from all paths but one, and predict that one. Results are written after
    each path.
    """
    files = [path for path in sorted(data.glob("*.parquet")) if int(path.stem[-1]) <= runs]
    if not files:
        print(f"{data}: no flights (*.parquet); skipped")
        return
    code = commit()
    logs = {path: read_log(path, map=MAP) for path in files}
    result: dict[str, Any] = {"version": __version__, "commit": code, "runs": runs, "paths": {}}
    result["closed_loop"] = {}
    every = dict.fromkeys(path.stem.split("_")[0] for path in files)
    for name in ["none"] if test else paths or every:
        unseen = {path: log for path, log in logs.items() if path.stem.startswith(name)}
        found = identified([log for path, log in logs.items() if path not in unseen])
        held = {path: read_log(path, map=MAP) for path in test} if test else unseen
        result["paths"][name] = judged(found, held)
        result["closed_loop"][name] = {
            c: (e.value, 0.5 * (e.high - e.low))
            for c in UNITS
            if (e := found.estimates.get(f"closed_loop {c}")) and e.status == IDENTIFIED
        }
        for way in (*WAYS, PAST):
            print(name, way, np.round(mean(result["paths"][name], "sums", way), 2), flush=True)
        if out is not None or not test:
            write_json(result, out or DOCS / "identify" / "nanodrone.json")
    print(section(result))


if __name__ == "__main__":
    start(study)
