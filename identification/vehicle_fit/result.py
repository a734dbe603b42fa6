"""The result of an identification."""

import math
from typing import Any, NamedTuple

from ...dynamics.vehicle import Vehicle
from ...runtime.page_files import page_template
from ..logs.table import Names
from ..prediction import ErrorsByPart
from .geometry import Interval
from .solve import VehicleFit

IDENTIFIED, ASSUMED, GIVEN, NOTHING = "identified", "assumed", "given", "not identifiable"
REFUTED = "refuted"  # by data outside the fit


# half-width of a 95 % interval as a share of the value (of its logarithm): a positive quantity with
# a wider one is not identifiable. By its looks alone one guesses a vehicle to a factor of 2
WIDEST = 0.5


def told(known: Interval) -> bool:
    """Return whether value, low and high of a positive quantity are narrow enough to count."""
    _, low, high = known
    return low > 0.0 and 0.5 * math.log(high / low) <= WIDEST


def text_of(template: str, **given: Any) -> str:
    """Return the text of one of ``templates/``."""
    text = page_template(__package__, f"templates/{template}.j2", html=False).render(**given)
    return text.removesuffix("\n")


class Estimate(NamedTuple):
    """One quantity: value with a 95 % interval, and its source."""

    name: str  # as in vehicle files and reports
    value: float  # SI units; NaN if not known
    low: float
    high: float
    unit: str
    status: str  # identified, assumed, given, refuted, not identifiable
    how: str  # channels, assumption, or reason not to know
    of_force: bool = False  # falls where held-out flight refutes the force


Estimated = dict[str, Estimate]  # by name


class Identified(NamedTuple):
    """A vehicle from its logs."""

    vehicle: Vehicle
    estimates: Estimated  # keys: names
    fit: VehicleFit
    notes: Names
    advice: Names
    # errors on data outside the fit: held_out_blocks, flights_left_out (each in turn, of several),
    # and prediction, of further flights. Those of the vehicle, and of thrust and drag with an
    # unchanged body rate
    predicted: ErrorsByPart
