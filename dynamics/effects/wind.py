"""Wind: a steady wind, fixed in the world frame.

The wind acts through each declared effect with an airspeed (rotor_drag, body_drag, ...). ``cd`` is
a drag for a vehicle that declares none. With w the wind and u = w - v, the force at the centre of
mass is F = cd |u| u + cd |v| v: the change against the same drag in still air. So nothing happens
without wind. Unlike a constant force, this force changes with the velocity.
"""

import math
from collections.abc import Sequence

import numpy as np

from .base import Coefficient, Effect
from .declaration import Coefficients, Family, Found, Unexplained

_LEAST_SPEED = 1e-9  # m/s, against a division by zero
# typical sizes of the wind's own drag, where no other drag feels it: true winds had 0.98 to 1.3,
# tilted frames 0.01 to 0.04
_LEAST_DRAG = 0.1


def starting_points(flights: Unexplained) -> Sequence[Coefficients]:
    """Return winds with the mean force, along it and along its part with the form of a slow wind's
    drag: a wind does nothing without a drag, nor this drag without a wind. If the vehicle has
    another drag, a wind may act on this one alone.

    That is, for the wind w, |v| w + v (v . w) / |v|, beside which a steady force may act.
    """
    speed, force, velocity = flights.typical["wx"], flights.force[:, :2], flights.velocity
    v = np.linalg.norm(velocity, axis=1) + _LEAST_SPEED
    steady = np.tile(np.eye(2), (len(v), 1))
    with_wind = (
        v[:, None, None] * np.eye(2)
        + velocity[:, :2, None] * velocity[:, None, :2] / v[:, None, None]
    )
    slope = np.linalg.lstsq(
        np.column_stack([with_wind.reshape(-1, 2), steady]), force.ravel(), rcond=None
    )[0][:2]
    mean = math.hypot(*force.mean(axis=0))
    along_force = [(x * speed, mean / (x * speed) ** 2) for x in (0.5, 1.0, 2.0, 4.0)]
    other = [(speed, 0.0)] if Family.DRAG in flights.beside else []
    return [
        {"wx": size * math.cos(heading), "wy": size * math.sin(heading), "wz": 0.0, "cd": cd}
        for heading in (math.atan2(y, x) for x, y in (force.mean(axis=0), slope))
        for size, cd in (*along_force, *other)
    ]


def implausible(found: Found) -> str:
    """Return why a found wind is none: it acts on no drag."""
    on_drag = found.coefficients["cd"] >= _LEAST_DRAG * found.typical["cd"]
    if on_drag or Family.DRAG in found.beside:
        return ""
    return "acts on hardly any drag, like a constant force"


EFFECT = Effect(
    name="wind",
    kind="wrench",
    coefficients=(
        Coefficient("wx", "m/s", (2.0, 1.0), "along world x"),
        Coefficient("wy", "m/s", (1.0, 0.5), "along world y"),
        Coefficient("wz", "m/s", (0.4, 0.2), "along world z"),
        Coefficient("cd", "N/(m/s)^2", (0.04, 0.001), "drag of its own", minimum=0.0),
    ),
    source="quadratic drag, 0.5 * 1.2 kg/m3 * C_d A with C_d A = 0.06 m2, 16 cm2; wind of an open "
    "hangar door",
    excitation="flight with and against the wind at 1 m/s and more; in hover it is a constant "
    "force. Declared drag makes it identifiable",
    model="wind",
    sets_wind=True,
    family=Family.SURROUNDINGS,
    starting_points=starting_points,
    implausible=implausible,
)
