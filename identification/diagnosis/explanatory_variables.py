"""What a force or a torque may depend on: variables of a flight at the rows of its residual, and
whether flights that a fit did not see lie within the range of those that it saw.
"""

import numpy as np
from numpy.typing import NDArray

from ..motion.smoothing import CUTOFFS, low_pass
from .regression import Flights, Setting

Array = NDArray[np.float64]
Variable = tuple[str, Array]  # in words, (rows,)

# quantile of the fitted rows up to which the fit knows a quantity, and the share of other rows
# beyond it from which these are said to lie outside
KNOWN, OUTSIDE = 0.995, 0.05


def explanatory_variables(flights: Flights, setting: Setting) -> list[Variable]:
    """Return the explanatory variables at the rows: what a force may depend on, with its unit."""
    parts: list[list[Variable]] = []
    vehicle = flights.amended(setting)
    for piece in flights.pieces(setting):
        s, at = piece.signals, piece.rows
        body = np.einsum("nij,ni->nj", s.rotation[at], s.velocity[at])
        speed = np.linalg.norm(body, axis=1)
        thrust = vehicle.rotor_wrench(s.rotor_speeds)[:, 0]
        heading = np.arctan2(s.rotation[at, 1, 0], s.rotation[at, 0, 0])
        found: list[Variable] = [
            (f"body velocity {a} (m/s)", body[:, i]) for i, a in enumerate("xyz")
        ]
        found += [
            ("speed (m/s)", speed),
            ("squared speed (m2/s2)", speed**2),
            ("height (m)", s.position[at, 2]),
            ("sine of the heading", np.sin(heading)),
            ("cosine of the heading", np.cos(heading)),
            ("time (s)", s.t[at]),
        ]
        if flights.rotor_speeds_vary:
            found.append(("thrust (N)", low_pass(thrust, CUTOFFS.residual_hz, s.period)[at]))
        found += [
            (
                f"angular velocity {a} (rad/s)",
                low_pass(s.angular_velocity[:, i], CUTOFFS.residual_hz, s.period)[at],
            )
            for i, a in enumerate("xyz")
        ]
        found += [(f"world position {a} (m)", s.position[at, i]) for i, a in enumerate("xy")]
        if s.voltage is not None:
            found.append(("battery voltage (V)", s.voltage[at]))
        parts.append(found)
    joined = [
        (name, np.concatenate([p[i][1] for p in parts])) for i, (name, _) in enumerate(parts[0])
    ]
    return [(name, x) for name, x in joined if x.std() > 1e-9]


def range_notes(flights: Flights) -> list[str]:
    """Return a sentence for each quantity in which held-out flight leaves the range of the fit.

    A coefficient that was fitted at 6 m/s says what happens at 14 m/s only if the effect's form
    holds that far, which the fit cannot know.
    """
    seen, out = flights.fit_rows, []
    thrust, weight = flights.vehicle.rotor_wrench, flights.vehicle.weight
    pieces = [p.signals.at(p.rows) for p in flights.pieces({})]
    for name, unit, parts in (
        ("the speed", "m/s", [np.linalg.norm(s.velocity, axis=1) for s in pieces]),
        ("the turn rate", "rad/s", [np.linalg.norm(s.angular_velocity, axis=1) for s in pieces]),
        ("the thrust", "weights", [thrust(s.rotor_speeds)[:, 0] / weight for s in pieces]),
    ):
        values = np.concatenate(parts)
        most = float(np.quantile(values[seen], KNOWN))
        beyond = values[~seen] > most
        if beyond.mean() > OUTSIDE:
            out.append(
                f"outside the range of the fit: {name} of {beyond.mean():.0%} of the held-out "
                f"flight is above {most:.3g} {unit}, up to {values[~seen].max():.3g} {unit}. The "
                "errors there are those of an extrapolation"
            )
    return out
