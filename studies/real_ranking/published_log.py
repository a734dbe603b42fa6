"""The control law of the published flights, from one of their logs.

Logs of these flights are published as CSV with a list in each cell: ``p``, ``p_d``, ``v``, ``v_d``
(m, m/s, world, desired with _d), ``q_sp`` (commanded attitude, scalar last), ``T_sp`` and
``hover_throttle`` (commanded thrust, and what hovers, in one unit). A command is an acceleration;
what it adds to the reference's is feedback.
"""

import csv
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from windwrench.dynamics.motion import Array
from windwrench.runtime.errors import InputError

_GRAVITY = 9.81
_COLUMNS = ("t", "p", "p_d", "v", "v_d", "q_sp", "T_sp", "hover_throttle")


@dataclass(frozen=True)
class ControlGains:
    """Gains of ``a = a_d - position e - velocity de/dt - integral (sum of e)`` along one axis, with
    standard deviations.
    """

    position: float  # 1/s2
    velocity: float  # 1/s
    integral: float  # 1/s3
    std: tuple[float, float, float]
    left: float  # m/s2, RMS that the law does not explain
    rows: int


def _column(path: Path, rows: list[dict[str, str]], name: str) -> Array:
    try:
        return np.array([np.atleast_1d(json.loads(row[name])) for row in rows], dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{path}: {name} must be a number or a list in each row") from error


def control_gains(path: Path) -> tuple[ControlGains, ControlGains]:
    """Return the gains, along x and along z, that a log's commands follow.

    Raises:
        InputError: no such table.
    """
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    missing = [name for name in _COLUMNS if not rows or name not in rows[0]]
    if missing:
        raise InputError(f"{path}: no column {missing[0]}; a published flight's table is expected")
    t, p, p_d, v, v_d, q, thrust, hover = (_column(path, rows, name) for name in _COLUMNS)
    x, y, z, w = q.T
    of_thrust = _GRAVITY * (thrust / hover)[:, 0]
    commands = (of_thrust * 2.0 * (x * z + w * y), of_thrust * (1.0 - 2.0 * (x * x + y * y)))
    time = t[:, 0]
    along_x = _fit(time, p[:, 0] - p_d[:, 0], v[:, 0] - v_d[:, 0], v_d[:, 0], commands[0])
    up = _fit(time, p[:, 2] - p_d[:, 2], v[:, 2] - v_d[:, 2], v_d[:, 2], commands[1] - _GRAVITY)
    return along_x, up


def _fit(time: Array, error: Array, rate: Array, v_d: Array, command: Array) -> ControlGains:
    steps = np.diff(time)
    total = np.concatenate([[0.0], np.cumsum(0.5 * steps * (error[1:] + error[:-1]))])
    regressors = -np.column_stack([error, rate, total, np.ones_like(error)])
    target = command - np.gradient(v_d, time)
    found = np.linalg.lstsq(regressors, target, rcond=None)[0]
    left = target - regressors @ found
    variance = float(left @ left) / (len(target) - 4)
    std = np.sqrt(variance * np.diag(np.linalg.inv(regressors.T @ regressors)))
    return ControlGains(
        float(found[0]),
        float(found[1]),
        float(found[2]),
        (float(std[0]), float(std[1]), float(std[2])),
        float(np.sqrt(np.mean(left * left))),
        len(time),
    )
