"""What a force or a torque may depend on: variables of a flight at the rows of its residual."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..motion.smoothing import CUTOFFS, low_pass
from .regression import Flights, Setting

Array = NDArray[np.float64]


def _least_variation() -> dict[str, float]:
    return {
        "velocity": 0.05,
        "speed": 0.05,
        "height": 0.03,
        "heading": 0.05,
        "angular velocity": 0.05,
        "position": 0.1,
        "voltage": 0.05,
        "tilt": 0.01,
    }


@dataclass(frozen=True, eq=False)
class RegressorSettings:
    """Which candidate regressors a flight excites, and the grids of places and frequencies."""

    # standard deviation, in the regressor's unit (m/s, m, rad/s, V; sine of an angle): with less it
    # says nothing, or is the sensors' noise
    least_variation: Mapping[str, float] = field(default_factory=_least_variation)
    # share of sensor noise in an angular velocity: it is in the residual's torque as well
    most_noise_share: float = 0.05


REGRESSORS = RegressorSettings()


Variable = tuple[str, Array]  # in words, (rows,)


def explanatory_variables(flights: Flights, setting: Setting) -> list[Variable]:
    """Return the explanatory variables at the rows: what a force may depend on, with its unit."""
    parts: list[list[Variable]] = []
    vehicle = flights.amended(setting)
    plain = [_is_excited(flights, i) for i in range(3)]
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
            if plain[i]
        ]
        found += [(f"world position {a} (m)", s.position[at, i]) for i, a in enumerate("xy")]
        if s.voltage is not None:
            found.append(("battery voltage (V)", s.voltage[at]))
        parts.append(found)
    joined = [
        (name, np.concatenate([p[i][1] for p in parts])) for i, (name, _) in enumerate(parts[0])
    ]
    return [
        (name, x)
        for name, x in joined
        if x.std()
        > next((least for word, least in REGRESSORS.least_variation.items() if word in name), 1e-9)
    ]


def _is_excited(flights: Flights, axis: int) -> bool:
    """Return whether an angular velocity is more than the sensors' noise, which is in the torque as
    well.
    """
    return bool(flights.angular_velocity_noise[axis] <= REGRESSORS.most_noise_share)
