"""Random sequences of faults, and a long flight full of them."""

import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from windwrench import __version__
from windwrench.runtime.code_digest import code_digest
from windwrench.runtime.provenance import commit
from windwrench.studies.faults.sequences import (
    FILTERS,
    FORCE,
    GATES,
    KINDS,
    MOST_SAMPLES,
    RISE,
    STEPS,
    TURNS,
    VEHICLES,
    Fault,
    Flight,
    outcome,
)
from windwrench.studies.resumed_tasks import Task, run_tasks

Result = dict[str, Any]

_OWN = ("studies/faults/sequences.py", "studies/faults/study.py")  # code of this study
PERIOD = 0.005  # s, of the long flight
LONGEST = 60.0  # s, of a fault in it


def drawn(rng: np.random.Generator) -> dict[str, Any]:
    """Return the arguments of a random sequence of one to three faults."""
    faults: list[Fault] = [
        (
            str(rng.choice(KINDS)),
            int(rng.integers(1, MOST_SAMPLES + 1)),
            float(10.0 ** rng.uniform(-3.0, 3.0)),
            int(rng.integers(2**31)),
        )
        for _ in range(rng.integers(1, 4))
    ]
    return {
        "vehicle": str(rng.choice(sorted(VEHICLES))),
        "dt": float(rng.choice(STEPS)),
        "gate": GATES[rng.integers(len(GATES))],
        "faults": faults,
        "turn": float(rng.choice(TURNS)),
    }


def sequences(kind: str, count: int, seed: int, progress: Callable[[float], None]) -> Result:
    """Return how often an estimator is not right again after a random sequence; the sequences are
    the same for each estimator.
    """
    wrong: list[Result] = []
    broken = 0
    for i in range(count):
        arguments = drawn(np.random.default_rng([seed, i]))
        try:
            status, apart = outcome(kind, **arguments)
        except AssertionError:
            broken += 1
            status, apart = "not finite", float("inf")
        if status != "tracking" or apart >= 3.0:
            wrong.append(
                {
                    "dt": arguments["dt"],
                    "gate": arguments["gate"],
                    "turn": arguments["turn"],
                    "faults": [fault[0] for fault in arguments["faults"]],
                    "status": status,
                    "apart": apart if np.isfinite(apart) else None,
                }
            )
        progress((i + 1) / count)
    band = binomtest(len(wrong), count).proportion_ci(method="exact")
    return {
        "estimator": kind,
        "count": count,
        "not_finite": broken,
        "wrong": len(wrong),
        "ci95": [band.low, band.high],
        "worst_kinds": Counter(kind for row in wrong for kind in row["faults"]).most_common(3),
        "long_steps": sum(row["dt"] >= 0.05 for row in wrong),
        "examples": wrong[:5],
    }


def soak(kind: str, steps: int, seed: int, progress: Callable[[float], None]) -> Result:
    """Fly ``steps`` steps of faults of up to a minute and good poses by turns, every step checked;
    return how often the wrench was right to three of its deviations after each fault.
    """
    rng = np.random.default_rng(seed)
    vehicle = VEHICLES["ardrone2"]
    flight = Flight(kind, vehicle, PERIOD, 0.999)
    flight.estimator.reset(flight.position, flight.quaternion)
    truth = np.array([0.0, 0.0, 0.0, 0.0, 0.0, FORCE * vehicle.weight])
    begin, done, faults, right, restarts = time.perf_counter(), 0, 0, 0, 0
    while done < steps:
        samples = int(rng.uniform(0.0, LONGEST) / PERIOD) + 1
        name = str(rng.choice(KINDS))
        flight.suffer(name, samples, float(10.0 ** rng.uniform(-3, 3)), int(rng.integers(2**31)))
        estimate = flight.recover(2.0 * RISE + 0.7)
        done += samples + round((2.0 * RISE + 0.7) / PERIOD)
        faults += 1
        restarts = estimate.restarts
        wrench = np.concatenate([estimate.torque, estimate.force])
        deviation = np.sqrt(np.diag(estimate.covariance)[12:18])
        right += bool(np.all(np.abs(wrench - truth) < 3.0 * deviation))
        progress(min(1.0, done / steps))
    band = binomtest(right, faults).proportion_ci(method="exact")
    return {
        "estimator": kind,
        "steps": done,
        "faults": faults,
        "restarts": int(restarts),
        "right": right,
        "ci95": [band.low, band.high],
        "seconds": time.perf_counter() - begin,
    }


def part(stamp: str, what: str, kind: str, size: int, seed: int) -> Result:
    """Return one estimator's outcome of ``sequences`` or of ``soak``; ``stamp`` names the code."""
    return (soak if what == "soak" else sequences)(kind, size, seed, lambda share: None)


def run(count: int, steps: int, seed: int, folder: Path, jobs: int = 1) -> Result:
    """Return everything that the page says; what is done is kept in the folder's ``parts.jsonl``,
    and done again only by other code.
    """
    stamp = code_digest(("runtime", "dynamics", "estimator"), _OWN)
    wanted: list[Task] = [
        (stamp, what, kind, size, seed)
        for what, size in (("soak", steps), ("sequences", count))
        for kind in FILTERS
    ]
    made = commit()
    done = run_tasks(part, wanted, folder / "parts.jsonl", jobs)
    return {
        "commit": made,
        "version": __version__,
        "count": count,
        "steps": steps,
        "seed": seed,
    } | {
        what: [found for task, found in done.items() if task[1] == what]
        for what in ("sequences", "soak")
    }
