"""The page "How far to trust it", of kept results of the studies."""

from typing import Any

from windwrench.evidence import measured_flights
from windwrench.evidence.kept_results import kept
from windwrench.evidence.probabilities import calibration


def page() -> dict[str, Any]:
    """Return what the page shows."""
    return {
        "identified": kept("identify/flights.json"),
        "benchmark": kept("identify/nanodrone.json"),
        "flights": measured_flights.shown(),
        "probabilities": calibration.shown(),
    }
