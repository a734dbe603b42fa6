"""The rigid body as the core's prediction model takes it, ``core/rigid_body.hpp``: (2)-(5) and
(11)-(14) of McKinnon and Schoellig, IROS 2016.
"""

import numpy as np
from numpy.typing import NDArray

from .vehicle import Vehicle

Array = NDArray[np.float64]

# rad: beyond, a step carries the angular momentum by the exact rotation. Below, where the two agree
# within a few percent of the gyroscopic term, (12) stands as printed
LONG_TURN = 0.25

BODY = np.dtype(
    [
        ("mass", "f8"),
        ("gravity", "f8"),
        ("com", "f8", (3,)),
        ("inertia", "f8", (3, 3)),
        ("inverse_inertia", "f8", (3, 3)),
        ("k", "f8", (4,)),
        ("mixing", "f8", (4, 4)),
    ]
)


def body_record(vehicle: Vehicle) -> np.ndarray:
    """Return a vehicle's rigid body and rotors as an array (1,) of ``BODY``."""
    record = np.zeros(1, dtype=BODY)
    body = record[0]
    body["mass"], body["gravity"], body["com"] = vehicle.mass, vehicle.gravity, vehicle.com
    body["inertia"], body["inverse_inertia"] = vehicle.inertia, np.linalg.inv(vehicle.inertia)
    body["k"], body["mixing"] = vehicle.k, vehicle.mixing
    return record
