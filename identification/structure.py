"""Whether what is left after all named effects still has a law in it, and so a name may be another effect's.

A library that lacks the true effect explains it by a neighbour, down to the floor of the residual. What gives the neighbour
away is small: something systematic is left over (columns of a general dictionary), or its own coefficient would rather
change with speed, height, load or time, or its force, in one channel, would rather be larger than in another.
Each column is tried alone, on blocks that are left out in turn.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..dynamics.effects import get
from .findings import CHANNELS, Structure
from .regression import CENTRAL, CUTOFF_HZ, Flights, Setting
from .search import Fit, Search
from .selection import Gram
from .signals import low_pass

Array = NDArray[np.float64]

LEAST_GAIN = 30.0  # whitened energy on blocks left out; the largest of all columns on flights without any effect is some 12
LEAST_SHARE = 0.004  # and as a share of the remainder's energy
LEAST_BLOCKS = 0.55  # share of the blocks that must gain: a law acts everywhere, a push once

_MOVES = {"velocity": 0.05, "speed": 0.05, "height": 0.03, "heading": 0.05, "turn rate": 0.05, "position": 0.1,
          "voltage": 0.05}  # in the drives' units: what varies by less says nothing
_STEPS = 3.0  # rounding steps by which turn rates must vary: below, their rounding is no noise but a law of its own

Drive = tuple[str, Array]  # in words, (rows,)


def drives(flights: Flights, setting: Setting) -> list[Drive]:
    """Return what a force may depend on, with its unit, at the rows."""
    parts: list[list[Drive]] = []
    vehicle = flights.amended(setting)
    for piece in flights.pieces(setting):
        s, at = piece.signals, piece.rows
        body = np.einsum("nij,ni->nj", s.rotation[at], s.velocity[at])
        speed = np.linalg.norm(body, axis=1)
        thrust = vehicle.rotor_wrench(s.rotor_speeds)[:, 0]
        heading = np.arctan2(s.rotation[at, 1, 0], s.rotation[at, 0, 0])
        found: list[Drive] = [(f"body velocity {a} (m/s)", body[:, i]) for i, a in enumerate("xyz")]
        found += [("speed (m/s)", speed), ("squared speed (m2/s2)", speed**2), ("height (m)", s.position[at, 2]),
                  ("thrust (N)", low_pass(thrust, CUTOFF_HZ, s.period)[at]), ("sine of the heading", np.sin(heading)),
                  ("cosine of the heading", np.cos(heading)), ("time (s)", s.t[at])]
        found += [(f"turn rate {a} (rad/s)", low_pass(s.rate[:, i], CUTOFF_HZ, s.period)[at]) for i, a in enumerate("xyz")]
        found += [(f"world position {a} (m)", s.position[at, i]) for i, a in enumerate("xy")]
        if s.voltage is not None:
            found.append(("battery voltage (V)", s.voltage[at]))
        parts.append(found)
    joined = [(name, np.concatenate([p[i][1] for p in parts])) for i, (name, _) in enumerate(parts[0])]
    return [(name, x) for name, x in joined if x.std() > next((least for word, least in _MOVES.items() if word in name), 1e-9)]


def scaled(found: list[Drive]) -> dict[str, Array]:
    """Return drives with mean zero and standard deviation one, by their names without units."""
    return {name.split(" (")[0]: (x - x.mean()) / x.std() for name, x in found}


def dictionary(flights: Flights, fit: Fit) -> Iterator[tuple[str, str, Array]]:
    """Yield general columns (rows, 6), with the channel and what drives it in words."""
    known = scaled(drives(flights, fit.setting))
    shapes = dict(known)
    for a in "xyz":
        u = known.get(f"body velocity {a}")
        w = known.get(f"turn rate {a}")
        if u is not None:
            shapes[f"body velocity {a}, squared with its sign"] = u * np.abs(u)
        if w is not None:
            shapes[f"turn rate {a}, squared with its sign"] = w * np.abs(w)
    for a, b in (("x", "y"), ("y", "z"), ("x", "z")):
        if f"turn rate {a}" in known and f"turn rate {b}" in known:
            shapes[f"turn rates {a} and {b}"] = known[f"turn rate {a}"] * known[f"turn rate {b}"]
            shapes[f"body velocities {a} and {b}"] = known[f"body velocity {a}"] * known[f"body velocity {b}"]
    pieces = flights.pieces(fit.setting)
    rotation = np.concatenate([p.signals.rotation[p.rows] for p in pieces])
    velocity = np.concatenate([p.signals.velocity[p.rows] for p in pieces])
    vehicle = flights.amended(fit.setting)
    wrench = np.concatenate([low_pass(vehicle.rotor_wrench(p.signals.rotor_speeds), CUTOFF_HZ, p.signals.period)[p.rows]
                             for p in pieces])
    for i, a in enumerate("xyz"):
        shapes[f"world velocity {a}"] = velocity[:, i]
        shapes[f"rotor torque {a}"] = wrench[:, 1 + i]
    for i, a in enumerate("xy"):
        shapes[f"tilt {a}"] = rotation[:, 2, i]
    for k in range(6):  # bumps in time and in height
        for name, limits in (("time", flights.t), ("height", np.concatenate([p.signals.position[p.rows, 2] for p in pieces]))):
            low, high = np.quantile(limits, [0.02, 0.98])
            shapes[f"{name} near {low + (high - low) * k / 5:.3g}"] = np.maximum(
                0.0, 1.0 - np.abs(limits - low - (high - low) * k / 5) / (0.2 * (high - low) + 1e-9))
    shapes["nothing (a constant)"] = np.ones(len(rotation))
    for name, x in shapes.items():
        for channel in range(6):
            column = np.zeros((len(x), 6))
            column[:, channel] = x
            yield CHANNELS[channel], name, column
            if channel < 3:
                column = np.zeros((len(x), 6))
                column[:, :3] = rotation[:, :, channel] * x[:, None]
                yield f"force along body {'xyz'[channel]}", name, column


def structure(search: Search, fit: Fit) -> list[Structure]:
    """Return the signs of a law in what a fit leaves, the strongest first; none for a fit that explains it all."""
    flights = search.flights
    if not _lively(flights):
        return []
    regression = search.at(fit)
    error = regression.error(np.arange(len(regression.columns)))
    found: list[Structure] = []

    def test(words: str, where: str, column: Array) -> None:
        gain, share = _gain(search, regression, column)
        if gain > max(LEAST_GAIN, LEAST_SHARE * error) and share >= LEAST_BLOCKS:
            found.append(Structure(words, where, gain / error))

    for channel, drive, column in dictionary(flights, fit):
        test("a general dictionary", f"{channel} with {drive}", column)
    residual = flights.residual(fit.setting)
    known = scaled(drives(flights, fit.setting))
    for effect in fit.effects:
        share = flights.residual(fit.without(effect).setting) - residual
        for name, x in known.items():
            test(f"{effect}'s coefficient is not constant", f"it changes with {name}", share * x[:, None])
        rotorwise = any(c.name == CENTRAL for c in get(effect).coefficients)  # whose moment is free as it is
        for channel in range(3 if rotorwise else 6):
            column = np.zeros_like(share)
            column[:, channel] = share[:, channel]
            test(f"{effect}'s parts do not fit each other", f"{CHANNELS[channel]} differs", column)
    return sorted(found, key=lambda s: -s.gain)


def _lively(flights: Flights) -> bool:
    """Return whether the turn rates vary by enough of their rounding steps."""
    speeds = np.concatenate([p.signals.rotor_speeds[p.rows] for p in flights.pieces({})])
    return float(np.median(speeds.std(axis=0))) > _STEPS * flights.vehicle.omega_lsb


def _gain(search: Search, g: Gram, column: Array) -> tuple[float, float]:
    """Return the energy that one more column (rows, 6) explains on blocks left out, and on what share of the blocks it does."""
    x = search.whiten(column)[search.flights.fit]
    cross = np.add.reduceat(np.einsum("nc,nck->nk", x, g.design), g.begins)  # (blocks, columns + 1)
    own = np.add.reduceat(np.einsum("nc,nc->n", x, x), g.begins)
    total, all_cross, all_own = g.blocks.sum(axis=0), cross.sum(axis=0), own.sum()
    k = len(g.columns)
    if not all_own > 0:
        return 0.0, 0.0
    gains = np.zeros(len(own))
    for b, block in enumerate(g.blocks):
        # the column less what the base's columns make of it, fitted without this block
        normal = (total - block)[:k, :k] + np.diag(g.precision)
        rest = np.linalg.solve(normal, np.column_stack([(all_cross - cross[b])[:k], (total - block)[:k, -1]])) if k else None
        weights = rest[:, 0] if rest is not None else np.zeros(0)
        change = rest[:, 1] if rest is not None else np.zeros(0)
        left = all_own - own[b] - weights @ (all_cross - cross[b])[:k]
        if left <= 1e-9 * all_own:
            continue
        slope = ((all_cross - cross[b])[-1] - weights @ (total - block)[:k, -1]) / left
        size = own[b] - 2 * weights @ cross[b][:k] + weights @ block[:k, :k] @ weights
        part = cross[b][-1] - weights @ block[:k, -1] - change @ cross[b][:k] + change @ block[:k, :k] @ weights
        gains[b] = slope * (2 * part - slope * size)
    return float(gains.sum()), float(np.mean(gains > 0))
