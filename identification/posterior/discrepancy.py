"""What an effect that is in no library may depend on: a dictionary of columns, of which it follows
one.

They are of the state as the filter predicts it, so none knows the noise of the pose to come.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .causal_filter import Track

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DiscrepancySettings:
    """How large an effect outside the library is, and how it varies with height."""

    # shares of the weight, and of the weight at a quarter of the arm: standard deviations of what a
    # column adds
    sizes: tuple[float, ...] = (0.001, 0.003, 0.01, 0.03)
    torque_arm: float = 0.25
    heights: tuple[float, ...] = (0.2, 0.6)  # m above the lowest place: where a bump falls off


DISCREPANCY = DiscrepancySettings()
GROUPS = ("velocity", "place", "time", "rotors")


@dataclass(frozen=True, eq=False)
class State:
    """A piece of flight (n samples)."""

    position: Array  # (n, 3) m, world
    rotation: Array  # (n, 3, 3) body to world
    velocity: Array  # (n, 3) m/s, world
    angular_velocity: Array  # (n, 3) rad/s, body
    rotors: Array  # (n, 4) thrust (N) and torques (Nm) of the rotors


def _scaled(x: Array) -> Array:
    x = x - x.mean()
    size = float(np.sqrt(np.mean(np.square(x))))
    return x / size if size > 1e-9 else np.zeros_like(x)


def discrepancy_columns(
    tracks: Sequence[State | Track], times: list[Array], weight: float, arm: float, inertias: Array
) -> dict[tuple[str, str], list[Array]]:
    """Return accelerations (n, 6) of each piece by group and name, each of a standard deviation of
    the weight, or of the weight times the arm.

    Args:
        tracks: the pieces.
        times: (n,) s of each.
        weight: N.
        arm: m.
        inertias: (6,) mass (kg) three times, and moments of inertia (kg m2).
    """
    ends = np.cumsum([len(track.position) for track in tracks])[:-1]

    def joined(name: str) -> Array:
        return np.concatenate([getattr(track, name) for track in tracks])

    rotation, velocity, position = joined("rotation"), joined("velocity"), joined("position")
    rate, rotors, t = joined("angular_velocity"), joined("rotors"), np.concatenate(times)
    body = np.einsum("nij,ni->nj", rotation, velocity)
    above = position[:, 2] - position[:, 2].min()
    shapes: dict[str, list[tuple[str, Array, tuple[int, ...]]]] = {group: [] for group in GROUPS}
    every = tuple(range(6))
    for i, axis in enumerate("xyz"):
        shapes["velocity"] += [
            (f"velocity {axis}", body[:, i], every),
            (f"squared velocity {axis}", body[:, i] * np.abs(body[:, i]), every),
        ]
        shapes["rotors"] += [
            (f"angular velocity {axis}", rate[:, i], every),
            (f"torque {axis}", rotors[:, 1 + i], (3, 4, 5)),
            (f"change of torque {axis}", np.gradient(rotors[:, 1 + i]), (3 + i,)),
        ]
    shapes["rotors"] += [
        ("thrust", rotors[:, 0], every),
        ("change of thrust", np.gradient(rotors[:, 0]), (2, 3, 4, 5)),
    ]
    heading = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
    places = [("x", position[:, 0]), ("y", position[:, 1]), ("height", position[:, 2])]
    places += [(f"height below {h:g} m", np.exp(-above / h)) for h in DISCREPANCY.heights]
    places += [("heading's sine", np.sin(heading)), ("heading's cosine", np.cos(heading))]
    shapes["place"] += [(name, x, every) for name, x in places]
    span = max(float(t[-1] - t[0]), 1e-9)
    for i in (1, 2, 3):
        shapes["time"].append((f"time {i}", np.cos(np.pi * i * (t - t[0]) / span), every))
    out: dict[tuple[str, str], list[Array]] = {}
    for group, found in shapes.items():
        for name, x, channels in found:
            z = _scaled(x)
            if not z.any():
                continue
            for channel in channels:
                column = np.zeros((len(z), 6))
                if channel < 3:
                    column[:, :3] = (weight / inertias[0]) * z[:, None] * rotation[:, :, channel]
                else:
                    size = weight * DISCREPANCY.torque_arm * arm / inertias[channel]
                    column[:, channel] = size * z
                out[group, f"{name} in {channel}"] = np.split(column, ends)
    return out
