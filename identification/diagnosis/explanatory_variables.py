"""What a force or a torque may depend on: variables of a flight at the rows of its residual, and
whether flights that a fit did not see lie within the range of those that it saw.
"""

import numpy as np
from numpy.typing import NDArray

from .regression import Flights, Setting

Array = NDArray[np.float64]
Variable = tuple[str, Array]  # in words, (rows,)

# quantile of the fitted rows up to which the fit knows a quantity, and the share of other rows
# beyond it from which these are said to lie outside
KNOWN, OUTSIDE = 0.995, 0.05


def explanatory_variables(flights: Flights, setting: Setting) -> list[Variable]:
    """Return the explanatory variables at the rows: what a force may depend on, with its unit."""
    names = ("t", "position", "rotation", "velocity")
    t, position, rotation, velocity = (flights.at_rows(name, setting) for name in names)
    pieces = flights.pieces(setting)
    rate = np.concatenate([p.smooth(p.signals.angular_velocity) for p in pieces])
    body = np.einsum("nij,ni->nj", rotation, velocity)
    speed = np.linalg.norm(body, axis=1)
    heading = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
    found: list[Variable] = [(f"body velocity {a} (m/s)", body[:, i]) for i, a in enumerate("xyz")]
    found += [
        ("speed (m/s)", speed),
        ("squared speed (m2/s2)", speed**2),
        ("height (m)", position[:, 2]),
        ("sine of the heading", np.sin(heading)),
        ("cosine of the heading", np.cos(heading)),
        ("time (s)", t),
    ]
    if flights.rotor_speeds_vary:
        found.append(("thrust (N)", flights.rotor_wrench(setting)[:, 0]))
    found += [(f"angular velocity {a} (rad/s)", rate[:, i]) for i, a in enumerate("xyz")]
    found += [(f"world position {a} (m)", position[:, i]) for i, a in enumerate("xy")]
    if all(p.signals.voltage is not None for p in pieces):
        found.append(("battery voltage (V)", flights.at_rows("voltage", setting)))
    return [(name, x) for name, x in found if x.std() > 1e-9]


def range_notes(flights: Flights) -> list[str]:
    """Return a sentence for each quantity in which held-out flight leaves the range of the fit.

    A coefficient that was fitted at 6 m/s says what happens at 14 m/s only if the effect's form
    holds that far, which the fit cannot know.
    """
    seen, out = flights.fit_rows, []
    vehicle = flights.vehicle
    thrust = vehicle.rotor_wrench(flights.at_rows("rotor_speeds"))[:, 0]
    for name, unit, values in (
        ("the speed", "m/s", np.linalg.norm(flights.at_rows("velocity"), axis=1)),
        ("the turn rate", "rad/s", np.linalg.norm(flights.at_rows("angular_velocity"), axis=1)),
        ("the thrust", "weights", thrust / vehicle.weight),
    ):
        most = float(np.quantile(values[seen], KNOWN))
        beyond = values[~seen] > most
        if beyond.mean() > OUTSIDE:
            out.append(
                f"outside the range of the fit: {name} of {beyond.mean():.0%} of the held-out "
                f"flight is above {most:.3g} {unit}, up to {values[~seen].max():.3g} {unit}. The "
                "errors there are those of an extrapolation"
            )
    return out
