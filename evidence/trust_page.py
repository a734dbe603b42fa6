"""The page "How far to trust it": one table, of the kept results of all its studies."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from windwrench.evidence import (
    measured_flights,
    other_engines,
    published,
    simulated_vehicles,
    unseen_flights,
)
from windwrench.evidence.kept_results import DOCS, kept
from windwrench.evidence.nanodrone_benchmark import WAYS, mean
from windwrench.evidence.probabilities.calibration import figures, flights_of
from windwrench.evidence.recovery import poisson_band
from windwrench.identification.comparison.change import NOWHERE
from windwrench.identification.prediction import QUANTITIES

# kept results below docs/, by study, in the order of the page
RESULTS: Mapping[str, str] = {
    **{part: f"results/{part}.json" for part in measured_flights.PARTS},
    "nanodrone": "identify/nanodrone.json",
    "published": published.RESULTS,
    "unseen_flights": unseen_flights.RESULTS,
    "simulated_vehicles": simulated_vehicles.RESULTS,
    "other_engines": other_engines.RESULTS,
    "probabilities": "results/probabilities.json.gz",
    "perfect_models": "results/perfect_models.json",
    "recovery": "results/recovery.json",
}


def page() -> dict[str, Any]:
    """Return what the page shows, of the studies that have a kept result."""
    results = {name: kept(path) for name, path in RESULTS.items() if (DOCS / path).exists()}
    folds = results["nanobench"]["flights"]
    flown = [row for path in results["nanodrone"]["paths"].values() for row in path]
    flights = results["probabilities"]["flights"]
    return {
        "results": results,
        "paths": RESULTS,
        "left": {
            key: np.sqrt(np.mean(np.square([fold[key] for fold in folds]), axis=0))
            for key in ("after_std", "constant_thrust_std")
        },
        "predicted": {
            way: [mean(flown, kind, way) for kind in ("after_half_a_second", "sums")]
            for way in WAYS
        },
        "quantities": QUANTITIES,
        "probabilities": {
            words: figures(some)
            for words, posed in (("Two simulators", True), ("No measured pose", False))
            if (some := flights_of([x for x in flights if (len(x["task"]) == 3) == posed]))
        },
        "drag": other_engines.DAMPING * other_engines.VEHICLE.mass,
        "band": poisson_band,
        "published": published,
        "unseen": unseen_flights,
        "simulated": simulated_vehicles,
        "nowhere": NOWHERE,
    }
