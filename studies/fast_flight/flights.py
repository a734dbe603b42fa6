"""The racer's flights: columns of its files, as this kit has them.

A file has one row each 5 ms: ``timestamp_s``; ``pos_*`` m and ``quat_*``, body to world;
``vel_body_*`` m/s, ``spec_force_*`` m/s2 and ``gyro_*`` rad/s, body; ``rpm_front_left`` and so on;
``battery_v``; ``network_force_*`` N, what a published network predicts. Force is mass times the
specific force. The files may be measured with, and are not part of the project.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

from windwrench.dynamics import Vehicle
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.motion.signals import Signals
from windwrench.identification.motion.smoothing import derivative
from windwrench.runtime.errors import InputError

Array = NDArray[np.float64]

_ROTORS = ("rpm_front_left", "rpm_rear_left", "rpm_rear_right", "rpm_front_right")
_RPM = 2.0 * np.pi / 60.0
_DELAYS = np.arange(0.0, 0.0201, 0.0025)  # s


@dataclass(frozen=True, eq=False)
class Flight:
    """One flight (n samples)."""

    name: str
    log: FlightLog
    signals: Signals
    force: Array  # (n, 3) N, body: mass times specific force
    network: Array | None  # (n, 3) N, body: what the published network predicts


def read_flight(path: Path, vehicle: Vehicle) -> Flight:
    """Return a flight of the racer.

    The gyro is put earlier by what its signal lags the attitude's rate (``gyro_delay``).

    Raises:
        InputError: there is no such file, or it lacks a column.
    """
    try:
        table: Any = np.genfromtxt(path, delimiter=",", names=True, dtype=np.float64)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as a flight of the racer: {error}") from error
    known = table.dtype.names or ()

    def columns(names: Iterable[str]) -> Array:
        names = tuple(names)
        lacking = [name for name in names if name not in known]
        if lacking:
            raise InputError(
                f"{path}: expected the columns of the racer's flights, lacks {', '.join(lacking)}"
            )
        out: Array = np.column_stack([table[name] for name in names])
        return out

    def axes(prefix: str) -> Array:
        return columns(f"{prefix}_{axis}" for axis in "xyz")

    t = columns(("timestamp_s",))[:, 0]
    if len(t) < 100 or not np.all(np.diff(t) > 0) or np.any(~np.isfinite(t)):
        raise InputError(f"{path}: timestamp_s: expected at least 100 increasing times in s")
    quaternion = columns(f"quat_{axis}" for axis in "wxyz")
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    rotation = Rotation.from_quat(quaternion, scalar_first=True)
    specific, gyro = axes("spec_force"), axes("gyro")
    speeds, voltage = _RPM * columns(_ROTORS), columns(("battery_v",))[:, 0]
    period = float(np.median(np.diff(t)))
    delay = gyro_delay(t, rotation, gyro)
    rate = np.column_stack([np.interp(t + delay, t, column) for column in gyro.T])
    velocity = rotation.apply(axes("vel_body"))
    gravity = np.array([0.0, 0.0, vehicle.gravity])
    name = path.name.partition(".")[0]
    log = FlightLog(
        t,
        axes("pos"),
        quaternion,
        speeds,
        voltage,
        accelerometer=specific,
        gyro=gyro,
        name=name,
        source=str(path),
    )
    signals = Signals(
        t,
        period,
        log.position,
        rotation.as_matrix(),
        velocity,
        rotation.apply(specific) - gravity,
        rate,
        derivative(rate, period),
        speeds,
        voltage,
    )
    network = axes("network_force") if "network_force_x" in known else None
    return Flight(name, log, signals, vehicle.mass * specific, network)


def pose_log(flight: Flight) -> FlightLog:
    """Return a flight's log with pose and rotor speeds alone, as motion capture has them."""
    return replace(flight.log, accelerometer=None, gyro=None)


def velocity_log(flight: Flight) -> FlightLog:
    """Return that log with the integral of the logged velocity in place of the position.

    A filter that knows its motion from positions alone so measures the velocity: force depends on
    no position, and what the integral drifts is slow.
    """
    s = flight.signals
    moved = cumulative_trapezoid(s.velocity, s.t, axis=0, initial=0.0)
    return replace(pose_log(flight), position=s.position[0] + moved)


def gyro_delay(t: Array, rotation: Rotation, gyro: Array) -> float:
    """Return by how much (s) a gyro (n, 3) lags the rate of the attitude, of those in ``_DELAYS``
    the one that leaves least.
    """
    between = 0.5 * (t[1:] + t[:-1])
    rate = (rotation[:-1].inv() * rotation[1:]).as_rotvec() / np.diff(t)[:, None]
    left = [
        sum(
            float(np.mean(np.square(np.interp(between + delay, t, gyro[:, i]) - rate[:, i])))
            for i in range(3)
        )
        for delay in _DELAYS
    ]
    return float(_DELAYS[int(np.argmin(left))])
