"""What is published of measured flights, beside what this project's commands make of the flights.

* Force and torque on flights of a racer (NeuroBEM, Bauersfeld and others, RSS 2021): vector RMSE of
  the published network and of estimators (NeuroMHE; TR-NeuroMHE).
* Pull of a tracked load of 4.7 g on a cable under a Crazyflie 2.1 Brushless
  (IMRCLab/crazyflie-data-collection), beside the load's weight and acceleration; and the thrust
  coefficient, beside two thrust stands of the same source, named as its folders. The source does
  not state whether a stand held the vehicle that flew, or whether guards flew.
* Coefficients of a Crazyflie (Eschmann, Albani, Loianno, arXiv 2404.07837: sysid.tools), by the
  same parts of the same logs.

Flights are no part of the project: each table is left out without a folder with its data.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.stats import sem
from scipy.stats import t as student

from windwrench import __version__
from windwrench.dynamics.vehicle import Vehicle
from windwrench.dynamics.vehicle_file import load_vehicle
from windwrench.evidence.kept_results import DOCS
from windwrench.evidence.runner import start
from windwrench.evidence.scoring import share
from windwrench.identification.logs.magnitudes import motor_doubts
from windwrench.identification.logs.reading import read_log
from windwrench.identification.logs.text_table import open_table
from windwrench.identification.motion.smoothing import derivative, low_pass
from windwrench.identification.vehicle_fit.geometry import parse_geometry
from windwrench.identification.vehicle_fit.identify import identify
from windwrench.identification.wrench_series import estimate_log, tune_to_log
from windwrench.runtime.page_files import write_json
from windwrench.runtime.provenance import commit

Array = NDArray[np.float64]
RESULTS = "results/published.json"  # below docs/

RACES = ("c", "e", "g")
_EDGE = 0.5  # s at either end, where the filter starts
# vector RMSE as published, N and mNm
PUBLISHED = {
    "NeuroMHE, force": (0.079, 0.366, 0.068),
    "TR-NeuroMHE, force": (0.078, 0.396, 0.067),
    "NeuroBEM, torque": (5.9, 20.0, 3.4),
    "TR-NeuroMHE, torque": (3.1, 15.9, 2.5),
}
# parts of the logs, s after their start, and the result of the notebook of sysid.tools. A motor's
# thrust in N at a command u is 0.0212656 - 0.0111750 u + 0.1201299 u^2
PARTS = {
    "log10": [(8.67, 38.67)],
    "log15": [(15.76, 50.76)],
    "log16": [(15.1, 21.1), (28.1, 32.1)],
}
CRAZYFLIE_MASS, CRAZYFLIE_ARM = 0.027, 0.028  # kg, m
FREE, CARRYING = ("00", "02", "04"), ("06", "12")  # flights without and with a load
FREE_MASS, CARRIER, LOAD, ARM = 0.037, 0.0397, 0.0047, 0.0325  # kg, m, as their README states
_PULL_HZ = 2.0
_NEAR = 0.1  # of the rotor speed in hover: rows of a thrust stand to compare with a flight
_RPM = np.pi / 30.0  # rad/s
OF_SYSID_TOOLS = {
    "Jxx": 1.0286e-5,
    "Jyy": 1.1052e-5,
    "thrust(0.5)": 0.04571,
    "thrust(0.75)": 0.08046,
    "lag without offset": 0.072,
}


def race(data: Path, name: str) -> dict[str, list[float]]:
    """Return the vector RMSE of force (N) and torque (mNm) on one flight, by the estimate from
    poses and rotor speeds and by the published network.

    Truth is mass times specific force, and inertia times the derivative of the angular velocity
    with its gyroscopic part.
    """
    path = data / f"flight_{name}.csv.gz"
    vehicle = load_vehicle(str(data / "vehicle.yaml"))
    log = read_log(path, vehicle=vehicle)
    assert log.accelerometer is not None
    assert log.gyro is not None
    turning = derivative(log.gyro, log.period)
    momentum = log.gyro @ vehicle.inertia
    truth = np.hstack(
        [vehicle.mass * log.accelerometer, turning @ vehicle.inertia + np.cross(log.gyro, momentum)]
    )
    posed = replace(log, accelerometer=None, gyro=None)
    tuning = tune_to_log(posed, vehicle).tuning
    off = {}
    for way, smooth in (("filter", False), ("smoothed", True)):
        found = estimate_log(posed, vehicle, tuning, smooth=smooth)
        inverse = Rotation.from_quat(log.quaternion, scalar_first=True).inv()
        made = vehicle.rotor_wrench(log.rotor_speeds)
        body = np.hstack([inverse.apply(found.force), inverse.apply(found.torque)])
        body[:, 2:] += made
        off[way] = body - truth
    columns = [f"network_{kind}_{a}" for kind in ("force", "torque") for a in "xyz"]
    table = open_table(path).read(["timestamp_s", *columns])
    network = np.column_stack([table[column] for column in columns])
    rows = np.searchsorted(table["timestamp_s"], log.t)
    off["network"] = network[np.minimum(rows, len(network) - 1)] - truth
    inner = (log.t > log.t[0] + _EDGE) & (log.t < log.t[-1] - _EDGE)
    return {way: _sizes(x[inner]) for way, x in off.items()}


def _sizes(off: Array) -> list[float]:
    """Return the vector RMSE of force (N) and torque (mNm) of differences (N, 6)."""
    squares = np.mean(np.square(off), axis=0).reshape(2, 3).sum(axis=1)
    sizes: list[float] = (np.sqrt(squares) * [1.0, 1e3]).tolist()
    return sizes


def crazyflie(data: Path) -> dict[str, list[float]]:
    """Return value and 95 % interval of coefficients by the parts of the logs."""
    parts = [(data / name, window) for name, windows in PARTS.items() for window in windows]
    logs = [read_log(path) for path, _ in parts]
    found = identify(
        logs, CRAZYFLIE_MASS, parse_geometry(str(CRAZYFLIE_ARM)), [window for _, window in parts]
    )
    named = {name: found.estimates[name] for name in OF_SYSID_TOOLS}
    return {name: [e.value, e.low, e.high] for name, e in named.items()}


def brushless(data: Path) -> dict[str, Any]:
    """Return what flights and thrust stands of a brushless Crazyflie show: ``k`` (value and 95 %
    interval) of flights without and with a load, ``stands``, and ``pull`` by the former.
    """
    free, carrying = (
        identify([read_log(folder / f"eckart{n}") for n in some], mass, parse_geometry(str(ARM)))
        for folder, some, mass in (
            (data / "brushless_flights" / "data", FREE, FREE_MASS),
            (data / "brushless_flights_payload" / "data", CARRYING, CARRIER + LOAD),
        )
    )
    known = free.vehicle
    k = {
        name: [e.value, e.low, e.high]
        for name, e in (("free", free.estimates["k"]), ("carrying", carrying.estimates["k"]))
    }
    return {
        "k": k,
        "stands": stands(data, known),
        "pull": pull(data / "brushless_flights_payload" / "data", replace(known, mass=CARRIER)),
    }


def stands(data: Path, vehicle: Vehicle) -> dict[str, list[float]]:
    """Return the mean thrust coefficients (N/(rad/s)^2) of two stands near a vehicle's rotor speed
    in hover, and the numbers of their rows.
    """
    guarded = np.loadtxt(
        data / "system-id/data/cf21bl_guards/feb25_2026_0.csv", delimiter=",", skiprows=1
    )
    folder = data / "brushless_calibration/data"
    weighed = np.loadtxt(folder / "manual_data_calib_brushless.csv", delimiter=",", skiprows=1)
    logged = np.loadtxt(folder / "data_calib_brushless.csv", delimiter=",", skiprows=1)
    # rotor 4 alone: the source calls the others' readings inconsistent
    turned = np.array([logged[logged[:, 1] == pwm, 6].mean() for pwm in weighed[:, 0]])
    found = {}
    for name, grams, squares in (
        ("cf21bl_guards", guarded[:, 6], np.square(_RPM * guarded[:, 2:6]).sum(axis=1)),
        ("brushless_calibration", weighed[:, 1], 4.0 * np.square(_RPM * turned)),
    ):
        near = np.abs(np.sqrt(squares / 4.0) / vehicle.hover_rate - 1.0) < _NEAR
        k = 1e-3 * vehicle.gravity * grams[near] / squares[near]
        found[name] = [float(k.mean()), len(k)]
    return found


def pull(folder: Path, vehicle: Vehicle) -> dict[str, dict[str, Any]]:
    """Return the pull of a cable on each flight whose load is tracked throughout: ``estimated``
    mean and ``rms_off`` the tracked one (N, x, y, z), and the load ``felt`` (kg), by least squares
    on gravity and tracked acceleration. Flights with doubtful motors are left out.
    """
    found = {}
    for path in sorted(folder.iterdir()):
        log = read_log(path)
        tracked = log.extra["payload_position"]
        if motor_doubts(log) or not np.isfinite(tracked).all():
            continue
        made = estimate_log(log, vehicle, tune_to_log(log, vehicle).tuning, smooth=True)
        place = low_pass(tracked, _PULL_HZ, log.period)
        speed = np.gradient(place, log.period, axis=0)
        moves = np.gradient(speed, log.period, axis=0)
        moves[:, 2] += vehicle.gravity
        inner = slice(round(1.0 / log.period), -round(1.0 / log.period))
        moves, force = moves[inner], low_pass(made.force, _PULL_HZ, log.period)[inner]
        size = np.sqrt(np.square(force + LOAD * moves).mean(axis=0))
        found[path.name.removeprefix("eckart")] = {
            "estimated": force.mean(axis=0).tolist(),
            "rms_off": size.tolist(),
            "felt": float(-(force * moves).sum() / np.square(moves).sum()),
        }
        print(path.name, found[path.name.removeprefix("eckart")]["felt"], flush=True)
    return found


def load_felt(result: Mapping[str, Any]) -> str:
    """Return the mean load felt, its 95 % interval by the flights' scatter, and on how many flights
    it is within 10 % of the weighed one.
    """
    loads = _loads(result)
    wide = student.ppf(0.975, len(loads) - 1) * sem(loads)
    low, high = loads.mean() - wide, loads.mean() + wide
    near = int(np.sum(np.abs(loads / LOAD - 1.0) <= 0.1))
    return (
        f"{1e3 * loads.mean():.2f} g ({1e3 * low:.2f}–{1e3 * high:.2f}); "
        f"within 10 % on {share(near, len(loads))} flights"
    )


def brushless_rows(result: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Return what was measured of the brushless Crazyflie, the result, and what stands beside."""
    k, on_stands = result["k"], result["stands"]
    said = {
        name: f"{1e8 * value:.2f} ({1e8 * low:.2f}–{1e8 * high:.2f})"
        for name, (value, low, high) in k.items()
    }
    stand = on_stands["brushless_calibration"][0]
    # the thrust carries vehicle and load: a factor on it is one on both
    scaled = stand / k["free"][0] * (CARRIER + _loads(result).mean()) - CARRIER
    beside = "; ".join(
        f"thrust stand {name} {1e8 * value:.2f} ({count} rows)"
        for name, (value, count) in on_stands.items()
    )
    measured = (
        f"Crazyflie 2.1 Brushless: `k` (1e-8 N/(rad/s)²) of flights by {1e3 * FREE_MASS:g} g; "
        f"with a load, by {1e3 * (CARRIER + LOAD):.3g} g"
    )
    return [
        (
            f"Load of {1e3 * LOAD:g} g on a cable under a Crazyflie: felt",
            load_felt(result),
            f"{1e3 * LOAD:g} g weighed; by the stand's `k` {1e3 * scaled:.1f} g",
        ),
        (measured, f"{said['free']}; {said['carrying']}", beside),
    ]


def _loads(result: Mapping[str, Any]) -> Array:
    return np.array([flight["felt"] for flight in result["pull"].values()])


def section(result: dict[str, Any]) -> str:
    """Return the tables, as Markdown."""
    lines = []
    if races := result.get("races"):
        lines += ["| flight | " + " | ".join(races) + " |", "| --- " * (1 + len(races)) + "|"]
        for i, (kind, unit) in enumerate((("force", "N"), ("torque", "mNm"))):
            for way in next(iter(races.values())):
                cells = " | ".join(f"{of[way][i]:.3g}" for of in races.values())
                lines.append(f"| {kind} ({unit}), {way} | {cells} |")
        lines += [f"| {way} | " + " | ".join(map(str, of)) + " |" for way, of in PUBLISHED.items()]
    if known := result.get("crazyflie"):
        lines += ["", "| Crazyflie | found | 95 % interval | published |", "| --- " * 4 + "|"]
        for name, (value, low, high) in known.items():
            said = f"{OF_SYSID_TOOLS[name]:.4g}"
            lines.append(f"| {name} | {value:.3g} | {low:.3g}–{high:.3g} | {said} |")
    if cables := result.get("brushless"):
        lines += ["", *(": ".join(row) for row in brushless_rows(cables))]
        lines += ["", "| flight | mean pull, N (x, y, z) | off, RMS, N | g |", "| --- " * 4 + "|"]
        for name, row in cables["pull"].items():
            numbers = (" ".join(f"{x:.4f}" for x in row[key]) for key in ("estimated", "rms_off"))
            lines.append(f"| {name} | {' | '.join(numbers)} | {1e3 * row['felt']:.2f} |")
    return "\n".join(lines)


def study(
    racer: Annotated[Path, typer.Option(help="Folder of flights c, e, g.")] = Path(
        "../shared/data/racer"
    ),
    imu: Annotated[Path, typer.Option(help="Folder of a Crazyflie's logs.")] = Path(
        "../shared/data/crazyflie_imu"
    ),
    crazyflies: Annotated[
        Path, typer.Option(help="Folder of flights with and without a load, and thrust stands.")
    ] = Path("../shared/data/crazyflies"),
    out: Annotated[Path, typer.Option(help="Results file.")] = DOCS / RESULTS,
) -> None:
    """Compare with what is published. Tables without their flights are left out."""
    result: dict[str, Any] = {"version": __version__, "commit": commit()}
    if racer.is_dir():
        result["races"] = {name: race(racer, name) for name in RACES}
    if imu.is_dir():
        result["crazyflie"] = crazyflie(imu)
    if crazyflies.is_dir():
        result["brushless"] = brushless(crazyflies)
    write_json(result, out)
    print(section(result))


if __name__ == "__main__":
    start(study)
