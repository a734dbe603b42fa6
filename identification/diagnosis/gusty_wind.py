"""A wind's changes beside its mean: an Ornstein-Uhlenbeck process, as cosines over the flight.

A gust acts like the wind, through each drag and by the flight's airspeed. As a force of its own, or
as a noise, the gusts of a periodic flight pass for more drag and less wind.
"""

import math

import numpy as np

from ...dynamics.effects import get
from ..logs.table import Array
from .coefficients import Setting
from .column import Column
from .regression import RegressedFlights

STD = 0.2  # relative to the mean
TIME = 2.0  # s, correlation time
FASTEST = 0.4  # Hz; faster changes are noise
MOST = 60  # cosines of one component: at 75 s of flight the last has the fastest change


def gusts(t: Array, setting: Setting, flights: RegressedFlights) -> dict[Column, Array]:
    """Return possible changes (n, k), m/s, of each component of a setting's winds, in standard
    deviations of their priors. Times ``t`` (n,) s begin at zero.
    """
    winds = [
        Column(e, c.name)
        for e in setting
        if get(e).sets_wind
        for c in get(e).coefficients
        if c.unit == "m/s"
    ]
    speed = math.hypot(*(flights.value(setting, c) for c in winds))
    rate = np.arange(1, min(int(2.0 * FASTEST * t[-1]), MOST) + 1) * math.pi / t[-1]
    size = STD * speed * np.sqrt(4.0 * TIME / t[-1] / (1.0 + np.square(rate * TIME)))
    return dict.fromkeys(winds, np.cos(np.outer(t, rate)) * size)
