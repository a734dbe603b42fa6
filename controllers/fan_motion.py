"""How a fan moves in the fan-tracking scenarios, which is what an informed tracker knows of it."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# places (n,) m after times (s) of motions with a largest speed (m/s) over a travel (m), from 0 to
# positive places first
PLACES: dict[str, Callable[..., Array]] = {
    "still": lambda speed, travel, time: 0.0 * (speed * time),
    "sine": lambda speed, travel, time: travel * np.sin(speed / travel * time),
    "triangle": lambda speed, travel, time: (
        travel * 2 / math.pi * np.arcsin(np.sin(math.pi / 2 * speed / travel * time))
    ),
    "ramp": lambda speed, travel, time: np.minimum(speed * time, 0.8 + (travel - 0.5) * 8 / 7),
}
