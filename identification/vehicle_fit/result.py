"""What was identified of a vehicle."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...dynamics.vehicle import Vehicle
from .channels import Piece, Sources
from .geometry import Geometry
from .solve import Fit

Array = NDArray[np.float64]

IDENTIFIED, ASSUMED, GIVEN, NOTHING = "identified", "assumed", "given", "not identifiable"


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
    estimates: tuple[Estimate, ...]
    sources: Sources
    geometry: Geometry
    pieces: tuple[Piece, ...]
    fit: Fit
    notes: tuple[str, ...]
    advice: tuple[str, ...]
    seconds: float  # of flight
    segments: int

    def __getitem__(self, name: str) -> Estimate:
        """Return an estimate by its name."""
        for estimate in self.estimates:
            if estimate.name == name:
                return estimate
        raise KeyError(name)

    @property
    def by_name(self) -> Mapping[str, Estimate]:
        """All estimates by their names."""
        return {estimate.name: estimate for estimate in self.estimates}
