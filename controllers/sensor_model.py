"""A tracker's model of its sensing: the jet's map, the wrench filter's lag, the coloured noise, and
the vehicle's yaw, as arrays for the core.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..dynamics.effects import compile_effects
from ..runtime.arrays import Array
from .briefing import Briefing
from .flight import FlightGains
from .jet_map import AXES, COUNT, FIRST, STEP, jet_map
from .observation import DECISION_PERIOD, FORCE_X, FORCE_Y, TORQUE_Z, VELOCITY_Y
from .wrench_lag import ORDER, autoregressions, lags

_TYPICAL = 0.15  # m off the axis, where the noise is taken whose colour stands for all
SETTLED = 19  # decisions of 80 ms that the filter has settled before the first observation
# a particle's: the jet's mean of its last decision, the filter's error, residuals, newest first
MEMORY = 4 * AXES + ORDER * AXES


class SensorModel(NamedTuple):
    """Arrays for ``_core.weigh``, and the vehicle's yaw."""

    # over the offset: mean, slopes with velocity and yaw rate, standard deviation
    tables: Array  # (COUNT, 4, AXES)
    keep: Array  # (AXES, 3, 3), of the filter's error
    enter: Array  # (AXES, 3)
    # regression of the residual, in standard deviations, on earlier residuals: in the first
    # decisions, and in all others; and the remaining variance
    regression: Array  # (ORDER + 1, AXES, ORDER)
    variance: Array  # (ORDER + 1, AXES)
    yaw: Array  # (3, 5): integral, angle and rate of yaw after a decision; torque and its rate


@lru_cache(maxsize=16)
def sensor_model(briefing: Briefing) -> SensorModel:
    """Return the model of the sensing of a briefed vehicle."""
    from scipy.linalg import expm

    air = briefing.air
    jets = jet_map(briefing.vehicle, briefing.jet, air)
    vehicle = compile_effects(briefing.vehicle).vehicle
    inertia = float(vehicle.inertia[2, 2])
    torque, force = lags(vehicle.mass, inertia, briefing.noise, air, DECISION_PERIOD)
    axes = (torque, force, force)
    sizes = (air.disturbance_torque, air.disturbance_force, air.disturbance_force)
    typical = round((_TYPICAL - FIRST) / STEP)
    regression, variance = np.zeros((ORDER + 1, AXES, ORDER)), np.zeros((ORDER + 1, AXES))
    tables = np.empty((COUNT, 4, AXES))
    tables[:, 0], tables[:, 1], tables[:, 2] = jets.mean.T, jets.slope.T, jets.turning.T
    for a, (axis, size) in enumerate(zip(axes, sizes, strict=True)):
        fixed = size**2 * axis.disturbance + axis.pose
        colour = fixed + jets.gust[a, typical] * axis.gust
        regression[:, a], variance[:, a] = autoregressions(colour / colour[0])
        tables[:, 3, a] = np.sqrt(fixed[0] + jets.gust[a] * axis.gust[0])
    # the flight loop holds the yaw against the torque that the filter shows
    gains, yaw = FlightGains(), np.zeros((5, 5))
    yaw[0, 1] = yaw[1, 2] = yaw[3, 4] = 1.0
    yaw[2, :4] = -gains.yaw_integral, -gains.yaw, -gains.yaw_rate, 1.0 / inertia
    return SensorModel(
        np.ascontiguousarray(tables),
        np.stack([axis.keep for axis in axes]),
        np.stack([axis.enter for axis in axes]),
        regression,
        variance,
        np.asarray(expm(DECISION_PERIOD * yaw))[:3],
    )


class Sensing:
    """A vehicle's motion through an episode, and the likelihoods of places of the fan.

    Places are along y, from the vehicle's place at the first observation. The vehicle's place is
    the integral of the estimated velocity, with a drift of millimetres. The yaw rate follows from
    the flight loop's yaw under the estimated torque.
    """

    def __init__(self, model: SensorModel) -> None:
        self.model = model
        self.count = 0
        self.own = 0.0  # m
        self.velocity = 0.0  # m/s
        self._yaw = np.zeros(3)
        self._torque = 0.0

    def weigh(
        self,
        observation: NDArray[np.floating],
        place: Array,
        level: Array,
        memory: Array,
        out: Array,
    ) -> None:
        """Write log-likelihoods (n,) of this decision's observation (8,) into ``out``; ``look``
        comes first.
        """
        axes = observation[TORQUE_Z], observation[FORCE_X], observation[FORCE_Y]
        motion = np.array([self.own, self.velocity, self._yaw[2]])
        seen, tables = np.array(axes, dtype=np.float64), self.model[:-1]
        _core.weigh(place, level, memory, motion, seen, *tables, self.count - 1, out)

    def look(self, observation: NDArray[np.floating]) -> None:
        """Integrate the vehicle's motion up to this observation (8,)."""
        torque, velocity = float(observation[TORQUE_Z]), float(observation[VELOCITY_Y])
        if self.count == 0:
            for _ in range(SETTLED):
                self._yaw = self.model.yaw @ np.array([*self._yaw, torque, 0.0])
        else:
            self.own += 0.5 * DECISION_PERIOD * (velocity + self.velocity)
            rate = (torque - self._torque) / DECISION_PERIOD
            self._yaw = self.model.yaw @ np.array([*self._yaw, self._torque, rate])
        self.velocity, self._torque = velocity, torque
        self.count += 1
