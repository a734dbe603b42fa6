"""Trims of drawn vehicles, from statics: where a rotor is weak or a weight hangs, what does the
flight loop ask of each rotor?

Nothing of the comparison's own model is in it: requests come from balancing force and three moments
with real thrust curves, batteries that are put in anew and propellers whose drag differs.
"""

import numpy as np
from numpy.typing import NDArray

from windwrench.identification.comparison.change import NOWHERE
from windwrench.identification.comparison.trim import Trim

Array = NDArray[np.float64]

ROTORS = ("front-left", "rear-left", "rear-right", "front-right")
_PLACES = {
    **{f"rotor {i + 1} ({name})": place for i, (name, place) in enumerate(
        zip(ROTORS, ((1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)), strict=True)
    )},
    "left": (1.0, 0.0),
    "rear": (0.0, -1.0),
    "right": (-1.0, 0.0),
    "front": (0.0, 1.0),
}  # fmt: skip
# left - right, front - rear, diagonals, total
_MIX = np.array([[1, 1, -1, -1], [1, -1, -1, 1], [1, -1, 1, -1], [1, 1, 1, 1]], dtype=np.float64)


def draw_change(seed: int) -> tuple[list[Trim], list[Trim], str]:
    """Return flights after and before, and the place of what changed, ``nowhere`` for half of all.

    A change is a weak rotor or a weight, near a rotor or at a side, of 1 to 40 %.
    """
    rng = np.random.default_rng([seed, 7])
    vehicle = rng.normal(0.0, [0.03, 0.03, 0.05])  # centre of mass and yaw, of the build
    strength = 1.0 + rng.normal(0.0, 0.03, 4)  # of each rotor
    bend = rng.uniform(0.0, 0.3)  # a request is not quite linear in thrust
    level = rng.uniform(0.4, 0.65)  # request in a hover
    scatter = rng.uniform(0.5, 1.5)  # of this vehicle's flights, against what is usual
    place, weight, weak = NOWHERE, 0.0, np.ones(4)
    if rng.random() < 0.5:
        amount = float(np.exp(rng.uniform(np.log(0.01), np.log(0.4))))
        if rng.random() < 0.4:
            rotor = int(rng.integers(4))
            place = list(_PLACES)[rotor]
            weak[rotor] -= amount
        else:
            place = list(_PLACES)[int(rng.integers(len(_PLACES)))]
            weight = amount
    sets = []
    for changed in (True, False):
        flights = []
        for _ in range(int(rng.integers(1, 4))):
            moved = np.append(vehicle, 0.0)
            moved = moved + scatter * rng.normal(0.0, [0.01, 0.01, 0.015, 0.02])
            factor = strength.copy()
            if changed:
                factor = factor * weak
                if weight > 0.0:
                    way = weight / (1.0 + weight)
                    # nobody hangs a weight exactly below a motor
                    aside = rng.normal(0.0, 0.1, 2)
                    moved[:2] += way * (np.array(_PLACES[place]) * rng.uniform(0.7, 1.0) + aside)
                    moved[3] += np.log1p(weight)
            total = level * np.exp(moved[3])
            thrust = np.linalg.solve(_MIX, np.append(moved[:3], 1.0) * total) / factor
            u = 4.0 * thrust
            u = np.minimum(u * (1.0 + bend * (u - level)), 1.0)  # and no request is above one
            flights.append(Trim("", u, 20.0))
        sets.append(flights)
    return sets[0], sets[1], place
