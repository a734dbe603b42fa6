"""Starting points of effects with nonlinear coefficients; each is tried as a column of fixed
shape.
"""

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...dynamics.vehicle import EffectSetting
from ..motion.residual import residual_wrench
from ..motion.signals import Signals
from .regression import Flights, typical_size

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StartingSettings:
    """The grids of starting points of effects with nonlinear coefficients."""

    cable_lengths: tuple[float, ...] = (0.15, 0.25, 0.4, 0.65, 1.0, 1.5)  # m
    fan_headings: tuple[float, ...] = tuple(2 * math.pi * k / 8 for k in range(8))  # rad
    fan_sample_step: int = 20  # every so many samples are enough for a map of the jet
    most_fan_starts: int = 4
    least_speed: float = 1e-9  # m/s, against a division by zero
    most_damping_ratio: float = 0.2  # of a load that swings in air


STARTING = StartingSettings()


def slung_payload(
    flights: Flights, residual: Array, stated: Mapping[str, float]
) -> list[dict[str, float]]:
    """Return loads of typical mass on cables of several lengths, or of the length that is fixed."""
    mass = typical_size(("slung_payload", "m"), flights.vehicle)
    lengths = (stated["l"],) if "l" in stated else STARTING.cable_lengths
    return [
        {"m": mass, "l": length, "damping": stated.get("damping", damping)}
        for length in lengths
        for damping in ((0.3, 2.0) if "damping" not in stated else (0.0,))
    ]


def overdamped_load(setting: Mapping[str, Mapping[str, float]], gravity: float) -> bool:
    """Return whether a fitted load is damped more than any load in air: it imitates a drag then."""
    load = setting.get("slung_payload")
    return (
        load is not None
        and load["l"] > 0
        and load["damping"] > 2.0 * STARTING.most_damping_ratio * math.sqrt(gravity / load["l"])
    )


def wind(flights: Flights, residual: Array, stated: Mapping[str, float]) -> list[dict[str, float]]:
    """Return winds along the mean force, and along the part of the force that goes like a slow
    wind's part of a drag.

    That is, for the wind w, |v| w + v (v . w) / |v|, beside which a steady force may act.
    """
    speed = typical_size(("wind", "wx"), flights.vehicle)
    drag = typical_size(("wind", "cd"), flights.vehicle)
    force = residual[flights.fit_rows, :2]
    velocity = np.concatenate([p.signals.velocity[p.rows] for p in flights.pieces({})])[
        flights.fit_rows
    ]
    v = np.linalg.norm(velocity, axis=1) + STARTING.least_speed
    steady = np.tile(np.eye(2), (len(v), 1))
    with_wind = (
        v[:, None, None] * np.eye(2)
        + velocity[:, :2, None] * velocity[:, None, :2] / v[:, None, None]
    )
    slope = np.linalg.lstsq(
        np.column_stack([with_wind.reshape(-1, 2), steady]), force.ravel(), rcond=None
    )[0][:2]
    return [
        {
            "wx": scale * speed * math.cos(heading),
            "wy": scale * speed * math.sin(heading),
            "wz": 0.0,
            "cd": drag,
        }
        for heading in (math.atan2(y, x) for x, y in (force.mean(axis=0), slope))
        for scale in (0.5, 1.0, 2.0)
    ]


def fan_jet(
    flights: Flights, residual: Array, stated: Mapping[str, float]
) -> list[dict[str, float]]:
    """Return the fans around the flight whose force maps resemble the residual most."""
    thin, wanted = [], []
    row = 0
    for piece in flights.pieces({}):
        s = piece.signals
        at = piece.rows[
            :: max(1, STARTING.fan_sample_step // max(1, int(piece.rows[1] - piece.rows[0])))
        ]
        wanted.append(row + np.searchsorted(piece.rows, at))
        row += len(piece.rows)
        thin.append(
            Signals(
                s.t[at],
                s.period,
                s.position[at],
                s.rotation[at],
                s.velocity[at],
                s.acceleration[at],
                s.angular_velocity[at],
                s.angular_acceleration[at],
                s.rotor_speeds[at],
                None if s.voltage is None else s.voltage[at],
            )
        )
    rows = np.concatenate(wanted)
    seen = flights.fit_rows[rows]
    target = residual[rows][seen]
    scale = 1.0 / np.maximum(np.sqrt(np.mean(np.square(target), axis=0)), 1e-12)
    bare = replace(flights.vehicle, effects=())
    base = [residual_wrench(s, bare) for s in thin]
    centre = np.concatenate([s.position for s in thin]).mean(axis=0)
    speed, kd, area = (
        typical_size(("fan_jet", name), flights.vehicle) for name in ("u0", "kd", "area")
    )
    found: list[tuple[float, int, dict[str, float]]] = []
    for heading, distance, across in itertools.product(
        STARTING.fan_headings, (1.5, 2.5, 3.5), (-0.6, 0.0, 0.6)
    ):
        along = np.array([math.cos(heading), math.sin(heading)])
        x, y = centre[:2] - distance * along + across * np.array([-along[1], along[0]])
        start = {
            "u0": speed,
            "x": float(x),
            "y": float(y),
            "z": float(centre[2]),
            "heading": heading,
            "kd": kd,
            "area": area,
        }
        vehicle = bare.with_effects(EffectSetting("fan_jet", start))
        shape = (
            np.concatenate(
                [b - residual_wrench(s, vehicle) for b, s in zip(base, thin, strict=True)]
            )[seen]
            * scale
        )
        size = float(np.sum(shape * shape))
        if size > 0:
            found.append(
                (float(np.sum(shape * target * scale)) / math.sqrt(size), len(found), start)
            )
    found.sort(reverse=True)
    return [start for _, _, start in found[: STARTING.most_fan_starts]]


STARTING_POINTS: dict[
    str, Callable[[Flights, Array, Mapping[str, float]], list[dict[str, float]]]
] = {
    "slung_payload": slung_payload,
    "wind": wind,
    "fan_jet": fan_jet,
}
