"""Vehicles identified from flights in the simulator, beside the truth.

Each vehicle flies three trajectories of 20 s. Slow unmeasured moments turn the body: a random walk
with a pull to zero (Ornstein-Uhlenbeck). The measured rotor speeds have white noise,
and are early by an offset of the clocks. ``identify`` is told the mass and the arm, as a user
would. Beside this stand the least squares of
its start: turning against the rotors' torque at .5 to 8 Hz, at the likeliest one of nine delays.
"""

from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.random import default_rng

from windwrench import __version__
from windwrench.dynamics.vehicle import Vehicle
from windwrench.dynamics.vehicle_file import load_vehicle
from windwrench.envs.plant import TICK
from windwrench.envs.recording import record_flight
from windwrench.evidence.kept_results import DOCS
from windwrench.evidence.runner import start
from windwrench.evidence.scoring import share
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.logs.table import Array
from windwrench.identification.vehicle_fit.geometry import parse_geometry
from windwrench.identification.vehicle_fit.identify import checked_pieces, identify
from windwrench.identification.vehicle_fit.model import Model
from windwrench.identification.vehicle_fit.parameters import first_model
from windwrench.identification.vehicle_fit.result import IDENTIFIED
from windwrench.runtime.page_files import write_json
from windwrench.runtime.provenance import commit

RESULTS = "results/simulated_vehicles.json"  # below docs/
VEHICLES = ("ardrone2", "crazyflie", "hummingbird")
TRAJECTORIES = ("excite", "shake", "yaw")
NOISES = (0.005, 0.01, 0.02, 0.03)  # of the rotor speeds, share
OFFSETS = (0.0, 0.04)  # s, by which the rotor speeds are early
NEAR = 0.05  # of Jxx
_SECONDS = 20.0
# standard deviation of each slow moment over weight times arm, as of a centre of mass off by 1 %
_MOMENT = 0.01
_SLOW = 1.0  # s, correlation time of the moments


def flight(vehicle: Vehicle, trajectory: str, noise: float, offset: float, seed: int) -> FlightLog:
    """Return a flight with slow moments, noisy rotor speeds and an offset of the clocks."""
    rng = default_rng(seed)
    moment = np.zeros(6)
    keep = np.exp(-TICK / _SLOW)
    size = _MOMENT * vehicle.weight * vehicle.arm_l * np.sqrt(1.0 - keep**2)

    def push(_: object) -> Array:
        moment[3:] = keep * moment[3:] + size * rng.standard_normal(3)
        return moment

    flown = record_flight(vehicle, (), trajectory, _SECONDS, seed, push=push)
    speeds = flown["rotor_speeds"][round(offset / np.diff(flown["t"]).mean()) :]
    speeds = speeds * (1.0 + noise * rng.standard_normal(speeds.shape))
    rows = slice(0, len(speeds))
    pose = flown["position"][rows], flown["quaternion"][rows]
    return FlightLog(flown["t"][rows], *pose, speeds, name=trajectory)


def judged(name: str, noise: float, offset: float, seed: int) -> dict[str, Any]:
    """Return estimates of a vehicle by ``identify`` and least squares, beside the truth."""
    vehicle = load_vehicle(name)
    numbers = range(seed, seed + len(TRAJECTORIES))
    logs = [
        flight(vehicle, kind, noise, offset, number)
        for kind, number in zip(TRAJECTORIES, numbers, strict=True)
    ]
    arm = parse_geometry(str(vehicle.arm_l))
    found = identify(logs, vehicle.mass, arm)
    pieces, sources = checked_pieces(logs)
    plain, _ = first_model(pieces, Model(vehicle.mass, arm, sources), "delay")
    moments = np.diag(vehicle.inertia).tolist()
    truth = dict(zip(("Jxx", "Jyy", "Jzz"), moments, strict=True))
    truth |= {"k": vehicle.k[0], "p": vehicle.p[0], "time_offset": offset}
    return {
        "vehicle": name,
        "noise": noise,
        "offset": offset,
        "truth": {n: float(x) for n, x in truth.items()},
        "identified": {n: e[1:4] for n in truth if (e := found.estimates[n]).status == IDENTIFIED},
        "least_squares": {"Jxx": plain.scale["Jx"]},
        "force": found.vehicle.status.force,
        "torque": found.vehicle.status.torque,
    }


def near(rows: Sequence[dict[str, Any]], offset: float | None = None) -> tuple[int, int, int]:
    """Return the numbers of vehicles with an identified ``Jxx`` near the truth, with least squares
    near it, and of all.
    """
    some = [row for row in rows if offset is None or row["offset"] == offset]

    def count(key: str) -> int:
        values = [(np.ravel(row[key].get("Jxx", 0.0))[0], row["truth"]["Jxx"]) for row in some]
        return sum(abs(x / truth - 1.0) <= NEAR for x, truth in values)

    return count("identified"), count("least_squares"), len(some)


def held(rows: Sequence[dict[str, Any]]) -> tuple[int, int]:
    """Return the numbers of 95 % intervals that hold the truth, and of all."""
    every = [
        low <= row["truth"][name] <= high
        for row in rows
        for name, (_, low, high) in row["identified"].items()
    ]
    return int(sum(every)), len(every)


def missed(rows: Sequence[dict[str, Any]]) -> str:
    """Return the losses in words."""
    right, _, count = near(rows)
    return (
        f"leaves `Jxx` assumed or more than {100 * NEAR:g} % off on {share(count - right, count)}; "
        f"95 % intervals hold the truth {share(*held(rows))}."
    )


def page_rows(rows: Sequence[dict[str, Any]]) -> Iterator[tuple[str, str, str]]:
    """Yield the rows of the page: subject, figure and target."""
    right, plain, count = near(rows)
    yield (
        f"Simulated vehicles: `Jxx` within {100 * NEAR:g} % of the truth",
        f"{share(right, count)}; least squares {share(plain, count)}",
        "all",
    )
    yield "Simulated vehicles: 95 % intervals hold the truth", share(*held(rows)), "92 to 99 %"


def study(out: Annotated[Path, typer.Option(help="Results file.")] = DOCS / RESULTS) -> None:
    """Identify simulated vehicles from flights with noise, offsets and slow moments."""
    rows: list[dict[str, Any]] = []
    for number, case in enumerate(product(VEHICLES, NOISES, OFFSETS)):
        rows.append(row := judged(*case, seed=100 * number))
        write_json({"version": __version__, "commit": commit(), "vehicles": rows}, out)
        said = ", ".join(
            f"{n} {100.0 * (x[0] / row['truth'][n] - 1.0):+.1f} %"
            for n, x in row["identified"].items()
            if row["truth"][n]
        )
        print(*case, said, row["force"], row["torque"], held([row]), flush=True)
    print(*page_rows(rows), sep="\n")


if __name__ == "__main__":
    start(study)
