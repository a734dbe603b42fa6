"""``python -m studies.probabilities.rotorpy_wind``: RotorPy's Hummingbird, its aerodynamics in a
steady wind, five effects at once, diagnosed with probabilities.
"""

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from windwrench.identification.diagnosis import diagnose
from windwrench.studies.page_tables import put_between, share, table
from windwrench.studies.resumed_tasks import Task, run_tasks
from windwrench.studies.trials.rotorpy_flights import (
    hummingbird_aero,
    hummingbird_vehicle,
    rotorpy_flight,
)

_PATHS = ("excite", "fast")
_SPEEDS = (0.5, 3.0)  # m/s, of the wind
_SURE = 0.95


def recorded(path: str, seed: int) -> dict[str, Any]:
    """Return what a diagnosis finds in one flight, and its truth, as JSON.

    Args:
        path: one of ``envs.recording.TRAJECTORIES``.
        seed: of the wind, the trajectory and the noise.
    """
    rng = np.random.default_rng(seed)
    speed, heading = rng.uniform(*_SPEEDS), rng.uniform(0.0, 2.0 * math.pi)
    wind = (speed * math.cos(heading), speed * math.sin(heading), 0.0)
    log = rotorpy_flight(path, 60.0, seed, wind=wind)
    found = diagnose([log], hummingbird_vehicle(), probabilities=True)
    assert found.probabilities is not None  # its rotors and poses are measured
    return {
        "wind": [round(x, 4) for x in wind],
        "named": {e.name: dict(e.coefficients) for e in found.effects},
        "sure": not any(e.tentative for e in found.effects),
        "probability": dict(found.probabilities.names),
    }


def tables(outcomes: Sequence[dict[str, Any]]) -> str:
    """Return the scores of recorded flights as a Markdown table."""
    truth = hummingbird_aero()
    right = [x for x in outcomes if set(x["named"]) == {"wind", *truth}]
    sure = [x for x in right if x["sure"]]
    probable = [x for x in right if min(x["probability"][e] for e in x["named"]) >= _SURE]
    rows = [
        ["wind and its four laws named, and nothing else", share(len(right), len(outcomes))],
        ["... and none tentative", share(len(sure), len(outcomes))],
        [
            f"... and each with a probability of {_SURE:g} and more",
            share(len(probable), len(outcomes)),
        ],
    ]
    for effect, own in truth.items():
        for name, value in own.items():
            off = [abs(x["named"][effect][name] / value - 1.0) for x in right]
            rows.append([f"error of {effect}'s `{name}`, median and largest", _percent(off)])
    speed = [math.dist([x["named"]["wind"][f"w{a}"] for a in "xy"], x["wind"][:2]) for x in right]
    if speed:
        worst = f"{np.median(speed):.3f} and {max(speed):.3f} m/s"
        rows.append(["error of the wind, median and largest", worst])
    return table(["RotorPy's Hummingbird in wind", f"{len(outcomes)} flights"], rows)


def _percent(off: Sequence[float]) -> str:
    return f"{np.median(off):.1%} and {max(off):.1%}" if off else "–"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m studies.probabilities.rotorpy_wind")
    parser.add_argument("--count", type=int, default=10, help="flights on each of two paths")
    parser.add_argument("--first", type=int, default=500, help="seed of the first")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=Path("results/rotorpy-wind/flights.jsonl"))
    parser.add_argument("--page", type=Path, default=None, help="page whose table is made anew")
    given = parser.parse_args()
    wanted: list[Task] = [
        (path, seed) for seed in range(given.first, given.first + given.count) for path in _PATHS
    ]
    text = tables(list(run_tasks(recorded, wanted, given.out, given.jobs).values()))
    put_between(text, given.page, "rotorpy")
    print(text)
