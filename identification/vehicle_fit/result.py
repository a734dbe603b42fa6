"""What was identified of a vehicle."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from ...dynamics.vehicle import Vehicle
from ..prediction import PredictionErrors
from .channels import MotionPiece, Sources
from .solve import VehicleFit

IDENTIFIED, ASSUMED, GIVEN, NOTHING = "identified", "assumed", "given", "not identifiable"


# half-width of a 95 % interval as a share of the value (of its logarithm), beyond which a positive
# quantity is not identifiable: a factor of 2 either way is what one would guess by the looks
WIDEST = 0.5


def told(known: tuple[float, float, float]) -> bool:
    """Return whether value, low and high of a positive quantity are narrow enough to count."""
    _, low, high = known
    return low > 0.0 and 0.5 * math.log(high / low) <= WIDEST


@dataclass(frozen=True)
class Estimate:
    """One quantity: its value with a 95 % interval, and how it is known."""

    name: str  # as vehicle files and reports name it
    value: float  # SI units; NaN where nothing is known
    low: float
    high: float
    unit: str
    status: str  # identified, assumed, given, not identifiable
    how: str  # which channels carried it, which assumption, or why it cannot be told


@dataclass(frozen=True, eq=False)
class Identified:
    """A vehicle from its logs."""

    vehicle: Vehicle
    estimates: Mapping[str, Estimate]  # by their names
    sources: Sources
    pieces: tuple[MotionPiece, ...]
    fit: VehicleFit
    notes: tuple[str, ...]
    advice: tuple[str, ...]
    # of what was not fitted to: held_out_blocks, flights_left_out (each in turn, of several), and
    # prediction, of further flights
    predicted: Mapping[str, PredictionErrors]
