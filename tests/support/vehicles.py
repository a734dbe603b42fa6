"""The vehicle of most tests, and how it hovers."""

import numpy as np

from windwrench.dynamics import load_vehicle

VEHICLE = load_vehicle("ardrone2")
HOVER = np.full(4, VEHICLE.hover_rate)
POSE = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0))  # level, 1 m above the ground
