"""A linear-quadratic Gaussian regulator (LQG) for the tasks in the wind, with the estimated wrench
as a measurement of the wind.

The regulator has the oracle's (``preview``) model of the flight loop (``axis_models``), and the
same weight of a position error. The two laws differ in their knowledge alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..dynamics.vehicle import Vehicle
from ..runtime.arrays import Array, Floats
from ..runtime.errors import InputError
from .axis_models import TILT, AxisModel, axis_models, tilting
from .axis_observer import AxisObserver, WrenchProcess, axis_filter
from .briefing import Briefing, standard_vehicle
from .preview import preview
from .wind_observation import (
    FORCE,
    MAX_ACCELERATION,
    POSITION_ERROR,
    REFERENCE_ACCELERATION,
    REFERENCE_VELOCITY,
    ROTOR_FORCE,
    SPECIFIC_FORCE,
    TORQUE,
    VELOCITY,
    WIND_PERIOD,
)

_TURN_TIME = 0.3  # s, over which the reference goes on to change its acceleration
_LOOK = 25  # decisions
_POSITIVE = ("effort", "force", "torque", "force_time", "torque_time", "estimate_lag", "bias")


@dataclass(eq=False)
class LQG:
    """A linear-quadratic Gaussian regulator with the external force and torque as states.

    Each axis is a Kalman filter and a regulator (Anderson and Moore, *Optimal Control: Linear
    Quadratic Methods*, 1990). Force and torque are Ornstein-Uhlenbeck processes. Their estimates
    from the wrench filter follow behind a lag of first order. The accelerometer less the rotors'
    force shows the external force at once, with a bias; the bias is a state, known after a few
    seconds. The rotors' force shows the tilt. The torque matters, because a tilt precedes the
    motion. A changed acceleration of the reference is assumed to last for a while.

    Everything but ``effort`` describes the wind, the filter and the sensors. The numbers were
    searched on six validation episodes each of WindHover's base and noisy and WindTrajectory's
    base, for the RMSE after 3 s. The estimated force alone adds nothing: rotors, pose and
    accelerometer have the same information (40 fresh episodes: +0.1 to +0.6 % without).

    Raises:
        InputError: a number is not above zero.
    """

    effort: float = 1e-5  # m2 of error per (m/s2)2 of acceleration
    force: float = 0.13  # standard deviation of the external force, share of the weight
    torque: float = 0.2  # likewise, share of weight times arm
    force_time: float = 4.0  # s, correlation time of the force
    torque_time: float = 0.5  # s
    estimate_lag: float = 0.28  # s, of the estimates
    noise: Mapping[str, float] = field(
        default_factory=lambda: {
            "place": 0.001,  # m
            "speed": 0.03,  # m/s
            "tilt": 0.006,  # rad
            "force": 0.06,  # N, of the estimate, on the standard vehicle; others by weight
            "torque": 0.003,  # Nm, likewise; by weight and arm
            "accelerometer": 0.04,  # m/s2, mean over a decision
        }
    )
    bias: float = 0.05  # m/s2, standard deviation of the accelerometer's bias
    model: tuple[float, float] = (
        0.07,
        0.7,
    )  # m/s2 and rad/s2 per root of a second, errors of the model
    vehicle: Vehicle = field(default_factory=standard_vehicle)

    def __post_init__(self) -> None:
        for name in _POSITIVE:
            if not getattr(self, name) > 0.0:
                raise InputError(f"LQG: {name} must be above 0, got {getattr(self, name)!r}")
        self.laws = [self._law(axis) for axis in axis_models(self.vehicle)]
        self.reset()

    def brief(self, briefing: Briefing) -> None:
        """Fly the declared vehicle."""
        self.vehicle = briefing.vehicle
        self.__post_init__()

    def reset(self) -> None:
        """Forget the last episode."""
        for observer, *_ in self.laws:
            observer.reset()
        self._action = np.zeros(3)
        self._wanted: Array | None = None  # acceleration of the reference, in tilts and m/s2

    def _law(self, axis: AxisModel) -> tuple[AxisObserver, Array, float]:
        """Return the observer of an axis, the regulator's gain (n,) on its states, and the gain on
        the reference's last turn. The turn is expected to go on.
        """
        k = axis.D.shape[1]
        weight, standard, noise = self.vehicle.weight, standard_vehicle(), dict(self.noise)
        moment = weight * self.vehicle.arm_l
        noise["force"] *= weight / standard.weight
        noise["torque"] *= moment / (standard.weight * standard.arm_l)
        sizes = (self.force * weight, self.torque * moment)[:k]
        wrench = WrenchProcess(sizes, (self.force_time, self.torque_time)[:k], self.estimate_lag)
        horizontal = ("tilt", "force", "torque") if k == 2 else ("force",)
        seen = tuple(noise[name] for name in ("place", "speed", *horizontal, "accelerometer"))
        model = axis_filter(axis, WIND_PERIOD, wrench, self.model, seen, self.bias)
        turn = np.zeros((len(model.A), 1))
        turn[TILT] = -1.0
        gain, ahead = preview(model.A, model.B[:, None], turn, self.effort, _LOOK)
        lasts = np.exp(-WIND_PERIOD / _TURN_TIME * np.arange(1, _LOOK + 1))
        return AxisObserver(model), gain, float(lasts @ ahead[:, 0])

    def __call__(self, observation: Floats, info: Mapping[str, Any] | None = None) -> Floats:
        """Return the action (3,) m/s2 for an observation (27,)."""
        o = np.asarray(observation, dtype=np.float64)
        place, speed = -o[POSITION_ERROR], o[VELOCITY] - o[REFERENCE_VELOCITY]
        rotors, felt = o[ROTOR_FORCE], o[SPECIFIC_FORCE] - o[ROTOR_FORCE]
        gravity = self.vehicle.gravity
        wanted = o[REFERENCE_ACCELERATION] / np.array([gravity, gravity, 1.0])
        turned = np.zeros(3) if self._wanted is None else wanted - self._wanted
        tilt = rotors / gravity - wanted
        torque = tilting(o[TORQUE])
        action = np.zeros(3)
        for i, (observer, gain, ahead) in enumerate(self.laws):
            seen = [place[i], speed[i], o[FORCE][i], felt[i]]
            if i < 2:
                seen = [place[i], speed[i], tilt[i], o[FORCE][i], torque[i], felt[i]]
            x = observer.update(self._action[i], np.array(seen), turned[i])
            action[i] = -(gain @ x) - ahead * turned[i]
        self._wanted = wanted
        self._action = np.clip(action, -MAX_ACCELERATION, MAX_ACCELERATION)
        return self._action.astype(np.float32)
