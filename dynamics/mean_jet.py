"""The mean wind of a drum fan's jet, as a table over distance and radius.

Axial speed: the momentum of an annular disc spread by a Gaussian, wider with the distance x, a jet
still in its shear layer: ``u^2 = U0^2 (disc of radius 0.45 less hub of radius 0.10) * Gaussian of
width 0.12 x / sqrt 2``. The momentum flux is the same at every x, and the radial inflow
(entrainment) follows from continuity. The convolution of a disc with a Gaussian is a non-central
chi-square distribution.
"""

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

AIR_DENSITY = 1.2  # kg/m3
HULL_RADIUS = 0.26  # m, radius of the ring of the wind's action on a vehicle's hull
HULL_STATIONS = 8  # on that ring
# the table's distances and radii, m
FIRST_X, STEP_X, COUNT_X = 0.2, 0.05, 137
STEP_R, COUNT_R = 0.02, 151
_SPREAD = 0.12


@cache
def jet_table(radius: float, hub_radius: float) -> tuple[Array, Array]:
    """Return axial and radial speed for U0 = 1 over the grid of distances and radii, each (137,
    151).
    """
    from scipy.special import chndtr

    r = STEP_R * np.arange(COUNT_R)
    # one more distance on either side, so that the derivative along x is central everywhere
    fine = FIRST_X + STEP_X * np.arange(-1, COUNT_X + 1)
    sigma = (_SPREAD * fine / math.sqrt(2.0))[:, None]
    momentum = chndtr((radius / sigma) ** 2, 2, (r / sigma) ** 2) - chndtr(
        (hub_radius / sigma) ** 2, 2, (r / sigma) ** 2
    )
    axial = np.sqrt(np.maximum(momentum, 0.0))
    slope = (axial[2:] - axial[:-2]) / (2.0 * STEP_X)
    each = slope * r
    radial = np.zeros_like(each)
    radial[:, 1:] = np.cumsum(STEP_R * (each[:, 1:] + each[:, :-1]) / -2.0, axis=1) / r[1:]
    return np.ascontiguousarray(axial[1:-1]), radial
