"""The page "How far to trust it", of kept results of the studies."""

from typing import Any

from windwrench.evidence import measured_flights, published
from windwrench.evidence.kept_results import kept
from windwrench.evidence.nanodrone_benchmark import WAYS, mean
from windwrench.evidence.probabilities import calibration


def page() -> dict[str, Any]:
    """Return what the page shows."""
    benchmark = kept("identify/nanodrone.json")
    rows = [row for path in benchmark["paths"].values() for row in path]
    return {
        "benchmark": benchmark,
        "predicted": {
            way: [mean(rows, kind, way) for kind in ("after_half_a_second", "sums")] for way in WAYS
        },
        "published": kept(published.RESULTS),
        "as_published": published.PUBLISHED,
        "of_sysid_tools": published.OF_SYSID_TOOLS,
        "flights": measured_flights.shown(),
        "probabilities": calibration.shown(),
    }
