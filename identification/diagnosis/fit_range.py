"""Whether flights that a fit did not see lie within the range of those that it saw."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .regression import Flights

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RangeSettings:
    """From when on flights are said to lie outside a fit."""

    quantile: float = 0.995  # of the fitted rows, up to which the fit knows a quantity
    least_share: float = 0.05  # of the other rows, beyond it


RANGE = RangeSettings()


def range_notes(flights: Flights) -> list[str]:
    """Return a sentence for each quantity in which held-out flight leaves the range of the fit.

    A coefficient that was fitted at 6 m/s says what happens at 14 m/s only if the effect's form
    holds that far, which the fit cannot know.
    """
    seen = flights.fit_rows
    out = []
    for name, unit, values in _quantities(flights):
        most = float(np.quantile(values[seen], RANGE.quantile))
        beyond = values[~seen] > most
        if beyond.mean() > RANGE.least_share:
            out.append(
                f"outside the range of the fit: {name} of {beyond.mean():.0%} of the held-out "
                f"flight is above {most:.3g} {unit}, up to {values[~seen].max():.3g} {unit}. The "
                "errors there are those of an extrapolation"
            )
    return out


def _quantities(flights: Flights) -> list[tuple[str, str, Array]]:
    """Return name, unit and size (rows,) of what an effect's form may depend on."""
    speed, rate, thrust = [], [], []
    for piece in flights.pieces({}):
        signals, at = piece.signals, piece.rows
        speed.append(np.linalg.norm(signals.velocity[at], axis=1))
        rate.append(np.linalg.norm(signals.angular_velocity[at], axis=1))
        force = flights.vehicle.rotor_wrench(signals.rotor_speeds[at])[:, 0]
        thrust.append(force / flights.vehicle.weight)
    return [
        ("the speed", "m/s", np.concatenate(speed)),
        ("the turn rate", "rad/s", np.concatenate(rate)),
        ("the thrust", "weights", np.concatenate(thrust)),
    ]
