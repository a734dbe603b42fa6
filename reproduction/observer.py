"""The classical alternative to the wrench filter: a nonlinear force and torque observer on a
low-pass-filtered pose.

Yuksel, Secchi, Buelthoff and Franchi, *A nonlinear force observer for quadrotors and application to
physical interactive tasks*, AIM 2014, with the pose filtered and differentiated as in Tomic and
Haddadin, *A unified framework for external wrench estimation, interaction control and collision
reflexes for flying robots*, IROS 2014.

The wrench estimate w^ is driven through a gain L so that its error decays exponentially::

    w^' = L (w - w^),    w = p' - u

where p is the momentum (linear of the centre of mass, angular in world axes, so that no gyroscopic
term is left) and u what the model says that rotors, gravity and declared effects add to it. Only
differences of p enter (the auxiliary variable of the paper), never an acceleration. Over a step at
constant w the solution is exact::

    w^[k] = exp(-L T) w^[k-1] + (1 - exp(-L T)) / T * (p[k] - p[k-1] - integral of u)

p comes from the low-pass-filtered pose and is late by the filter's delay. u goes through the same
filter: the vehicle's own manoeuvres cancel. Both filters are discretised exactly (the pose as a
straight line between samples, u as constant over a step): any cutoff at any period is stable.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from .. import _core
from ..dynamics.vehicle import Vehicle
from ..estimator.estimate import WrenchEstimate
from ..estimator.ukf import WrenchUKF
from ..runtime.arguments import check_positive
from ..runtime.errors import InputError

_DAMPING = math.sqrt(0.5)  # Butterworth

_LOW_PASS = np.dtype(
    [
        ("frequency", "f8"),  # rad/s
        ("delay", "f8"),  # s, of a slow signal
        ("transition", "f8", (2, 2)),  # of output and its rate over a step
        ("old", "f8", (2,)),  # what the sample before adds, the input being a straight line
        ("latest", "f8", (2,)),  # and the present one
    ]
)

OBSERVER = np.dtype(
    [
        ("translation", _LOW_PASS),
        ("rotation", _LOW_PASS),
        ("force_decay", "f8", (3,)),
        ("torque_decay", "f8", (3,)),
        # the filtered pose: centre of mass, quaternion, and their rates
        ("p", "f8", (3,)),
        ("v", "f8", (3,)),
        ("q", "f8", (4,)),
        ("dq", "f8", (4,)),
        # force and torque (world) of the model, filtered, and their rates
        ("force", "f8", (3,)),
        ("force_rate", "f8", (3,)),
        ("torque", "f8", (3,)),
        ("torque_rate", "f8", (3,)),
        ("R", "f8", (3, 3)),  # of the filtered attitude
        ("omega", "f8", (3,)),  # body rate of the filtered attitude
        ("angular_momentum", "f8", (3,)),  # of the filtered pose, world axes
        ("sample_p", "f8", (3,)),  # the last sample, or the expected one
        ("sample_q", "f8", (4,)),
        ("sample_R", "f8", (3, 3)),
        ("position_gap", "f8"),  # s since the last sample
        ("attitude_gap", "f8"),
    ]
)


@dataclass(frozen=True)
class ObserverTuning:
    """Gains of the observer and cutoffs of its pose filters.

    The 10-90 % rise time of force and torque is about ``2.2 / gain``: 1 s as given.

    Attributes:
        force_gain: 1/s, a scalar or (3,) for world x, y, z.
        torque_gain: 1/s, likewise.
        position_cutoff_hz: Hz, of the low-pass of the position.
        attitude_cutoff_hz: Hz, of the low-pass of the attitude.
    """

    force_gain: ArrayLike = 2.2
    torque_gain: ArrayLike = 2.2
    position_cutoff_hz: float = 3.0
    attitude_cutoff_hz: float = 5.0

    def __post_init__(self) -> None:
        check_positive(self, ("force_gain", "torque_gain"))


class NonlinearObserver(WrenchUKF):
    """Force and torque observer: a ``WrenchUKF`` whose state an observer moves. It has neither NIS
    nor covariance, and no gate; it takes whole steps alone, and no inertial measurements.

    Pose and twist are those of the low-pass filters, moved ahead by the filters' delay with the
    model. Through gaps in the measurements the model carries on with the last wrench.

    Args:
        vehicle: the declared vehicle with its declared effects.
        tuning: gains and cutoffs.
        period: time between steps, s.

    Raises:
        InputError: the period is out of range.
    """

    _no_imu = "an observer takes no inertial measurements"

    def __init__(
        self, vehicle: Vehicle, tuning: ObserverTuning | None = None, period: float = 0.005
    ) -> None:
        self.gains = ObserverTuning() if tuning is None else tuning
        super().__init__(vehicle, None, period)

    def _prepare(self) -> None:
        """Start at rest at the origin."""
        self._observer = np.zeros(1, dtype=OBSERVER)
        o, gains = self._observer[0], self.gains
        _low_pass(o["translation"], gains.position_cutoff_hz, self.period)
        _low_pass(o["rotation"], gains.attitude_cutoff_hz, self.period)
        o["force_decay"] = np.exp(-self.period * np.asarray(gains.force_gain))
        o["torque_decay"] = np.exp(-self.period * np.asarray(gains.torque_gain))
        self.reset((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))

    def _begin(self) -> None:
        """Start in equilibrium; the covariance that ``reset`` was given is not used."""
        self.record["P"] = math.nan
        _core.start_observer(self._address, self._observer.ctypes.data)

    def _run(self, parts: int, dt: float, voltage: float | None) -> WrenchEstimate:
        if dt != self.period:
            raise InputError(f"NonlinearObserver: expected a step of {self.period:g} s, got {dt:g}")
        volts = self._voltage if voltage is None else voltage
        own = self._observer.ctypes.data
        if _core.step_observer(self._address, own, parts, dt, volts) < 0:
            raise self._sample.bad_quaternion()
        return self.estimate

    @property
    def step_address(self) -> int:
        """An observer has none.

        Raises:
            InputError: always.
        """
        raise InputError("step_address: an observer steps in Python only")


def _low_pass(record: np.void, cutoff_hz: float, period: float) -> None:
    """Fill in a second-order low-pass, y'' = w^2 (x - y) - 2 d w y', for an input that is straight
    between samples.
    """
    w = 2.0 * math.pi * cutoff_hz
    # states y and y'/w, then the input and its change over the step
    matrix = np.zeros((4, 4))
    matrix[0, 1] = w * period
    matrix[1, :3] = -w * period, -2.0 * _DAMPING * w * period, w * period
    matrix[2, 3] = 1.0
    M = scipy.linalg.expm(matrix)
    unit = np.array([1.0, w])
    record["frequency"], record["delay"] = w, 2.0 * _DAMPING / w
    record["transition"] = M[:2, :2] * unit[:, None] / unit
    record["old"] = (M[:2, 2] - M[:2, 3]) * unit
    record["latest"] = M[:2, 3] * unit
