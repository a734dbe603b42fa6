"""Flights in a fan wall that others have measured: does a diagnosis name the wind?

Data: Neural-Fly (M. O'Connell, G. Shi and others, Science Robotics 7(66), 2022), folder
``data/experiment`` of its repository, for personal and educational use: it is read where it lies
and never kept. A quadrotor of 2.6 kg flies a figure of eight, with the thrust that its controller
asks for as the only word of its rotors. Files are named by the controller and by how much of the
wall's power was on: 70 % are 8.5 m/s.
"""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from windwrench.dynamics.vehicle import Vehicle
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.logs.flight_log import FlightLog

MASS, GRAVITY = 2.6, 9.81  # kg, m/s2
FLIGHTS = {"nowind": 0.0, "70wind": 8.5}  # m/s, by what ends the file's name
CONTROLLERS = ("baseline", "indi")
_K = 1e-5  # N/(rad/s)^2: a scale alone, since thrust is what the log has


def vehicle() -> Vehicle:
    """Return the vehicle without any aerodynamics. Of its rotors a scale is assumed, and of its
    inertia nothing is used.
    """
    return Vehicle(
        name="fan_wall",
        mass=MASS,
        inertia=np.diag([0.03, 0.03, 0.05]),
        arm_l=0.2,
        k=np.full(4, _K),
        p=np.full(4, 1.5e-7),
        rotor_radius=0.14,
        omega_lsb=1.0,
        voltage_ref=14.8,
    )


def read(path: Path) -> FlightLog:
    """Return a flight; its rotor speeds are those of the thrust that was asked for."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))

    def numbers(column: str) -> NDArray[np.float64]:
        return np.array([json.loads(row[column]) for row in rows], dtype=np.float64)

    thrust = numbers("T_sp")[:, 0] / numbers("hover_throttle")[:, 0] * MASS * GRAVITY
    speed = np.sqrt(np.maximum(thrust, 0.0) / (4.0 * _K))
    t = numbers("t")
    new = np.concatenate([[True], np.diff(t) > 0.0])
    return FlightLog(
        t[new],
        numbers("p")[new],
        Rotation.from_matrix(numbers("R")[new]).as_quat(scalar_first=True),
        np.repeat(speed[new, None], 4, axis=1),
        name=path.stem.removeprefix("custom_figure8_"),
        commanded=True,
    )


def fan_wall(folder: Path) -> list[dict[str, Any]]:
    """Return what a diagnosis says of each flight of a folder, without any declared drag."""
    rows = []
    for controller in CONTROLLERS:
        for ending, speed in FLIGHTS.items():
            path = folder / f"custom_figure8_{controller}_{ending}.csv"
            if not path.exists():
                continue
            print(f"fan wall: {path.stem}", flush=True)
            found = diagnose([read(path)], vehicle())
            wind = next((e for e in found.effects if e.name == "wind"), None)
            rows.append(
                {
                    "flight": found.logs[0],
                    "label": speed,
                    "wind": wind and [wind.coefficients[x] for x in ("wx", "wy", "wz")],
                    "wind_std": wind and [wind.std[x] for x in ("wx", "wy", "wz")],
                    "wind_probability": found.probabilities.names.get("wind", 0.0),
                    "unknown": found.probabilities.unknown,
                    "names": [(e.name, e.tentative) for e in found.effects],
                    "force_before": found.before.force_rms,
                    "force_after": found.after.force_rms,
                }
            )
    return rows
