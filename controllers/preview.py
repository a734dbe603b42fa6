"""The oracles of all tasks, with score 1. They know the true motion, present and future, and
command by the linear-quadratic regulator with preview (Tomizuka, ASME J. Dyn. Sys. 97(2), 1975).

The model is the flight loop's, one axis at a time (``axis_models``). One number weighs a position
error against the command.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from ..dynamics.vehicle import Vehicle
from ..runtime.arrays import Array, Floats
from ..runtime.errors import InputError
from .axis_models import PLACE, axis_models, tilting
from .briefing import Briefing, standard_vehicle
from .observation import DECISION_PERIOD, MAX_COMMAND
from .wind_observation import (
    MAX_ACCELERATION,
    REFERENCE_ACCELERATION,
    REFERENCE_VELOCITY,
    WIND_PERIOD,
)

DISTURBANCE_TIME = 0.3  # s, over which the actuators' disturbance lasts
Step = tuple[Array, Array, Array]  # A (n, n), B (n, 1) and D (n, d) of a decision


def regulator(A: Array, B: Array, effort: float) -> tuple[Array, Array, Array]:
    """Return the linear-quadratic regulator's gain (1, n), its cost to go (n, n), and the command's
    factor (1, n) on a cost slope.
    """
    from scipy.linalg import solve_discrete_are

    weight = 1e-9 * np.eye(len(A))
    weight[0, 0] = 1.0
    cost = np.asarray(solve_discrete_are(A, B, weight, np.array([[effort]])))
    turned = B.T / (B.T @ cost @ B + effort)
    return turned @ cost @ A, cost, turned


def preview(A: Array, B: Array, D: Array, effort: float, count: int) -> tuple[Array, Array]:
    """Return the gain (n,) on the state, and (count, d) on the disturbances of each decision from
    now on.

    The model is ``x' = A x + B u + D d``. The command ``u = -(gain x + sum of gains times d)``
    makes the sum of ``x[0]^2 + effort u^2`` least.
    """
    gain, cost, turned = regulator(A, B, effort)
    closed, slope, ahead = (A - B @ gain).T, cost @ D, []
    for _ in range(count):
        ahead.append((turned @ slope)[0])
        slope = closed @ slope
    return gain[0], np.array(ahead)


@dataclass(eq=False)
class _PreviewLaw:
    """Base of the oracles: states and disturbances of the axes, and their command."""

    effort: float  # m2 of error that a command of 1 is worth
    foresight: int  # decisions; the environment's is set to it
    axes: tuple[int, ...]  # commanded axes of the world
    vehicle: Vehicle = field(default_factory=standard_vehicle)
    largest: ClassVar[float]  # command
    tells: ClassVar[str]  # entry of ``info`` with what is to come

    @staticmethod
    def steps(vehicle: Vehicle) -> list[Step]:
        """Return the model of each axis."""
        raise NotImplementedError

    def _look(self, o: Array, info: Mapping[str, Any]) -> tuple[list[Array], list[Array]]:
        """Return each axis's state (n,) and future disturbances (foresight, d)."""
        raise NotImplementedError

    def brief(self, briefing: Briefing) -> None:
        """Fly the declared vehicle."""
        self.vehicle = briefing.vehicle

    def reset(self) -> None:
        """Do nothing: an oracle has no memory."""

    def __call__(self, observation: Floats, info: Mapping[str, Any] | None = None) -> Floats:
        """Return the command (axes,).

        Raises:
            InputError: no ``info``, or one without the future.
        """
        if info is None or self.tells not in info:
            raise InputError(
                f"oracle: needs the environment's info ({self.tells}), which it has where its "
                f"foresight is {self.foresight}"
            )
        states, comes = self._look(np.asarray(observation, dtype=np.float64), info)
        gains = _gains(self.steps, self.vehicle, self.effort, self.foresight)
        wanted = [
            -float(gains[i][0] @ states[i] + np.sum(gains[i][1] * comes[i])) for i in self.axes
        ]
        return np.clip(wanted, -self.largest, self.largest).astype(np.float32)

    def along(
        self, info: Mapping[str, Any], place: Array, speed: Array, pushed: Array
    ) -> list[Array]:
        """Return the state (..., n) of each axis; ``place``, ``speed`` and ``pushed`` (..., 3) are
        the vehicle's relative to the target, and the target's acceleration.
        """
        tilt = info["up"] / info["up"][..., 2:] - pushed / self.vehicle.gravity
        turning, turned = tilting(info["rate"]), tilting(info["angular_acceleration"])
        middle = [[tilt[..., i], turning[i], turned[i]] for i in (0, 1)]
        middle.append([info["lift"] - pushed[..., 2]])
        sums = info["integral"]
        return [
            np.stack([place[..., i], speed[..., i], *middle[i], sums[..., i]], axis=-1)
            for i in (0, 1, 2)
        ]


@lru_cache(maxsize=16)
def _gains(
    steps: Callable[[Vehicle], list[Step]], vehicle: Vehicle, effort: float, count: int
) -> list[tuple[Array, Array]]:
    return [preview(*step, effort, count) for step in steps(vehicle)]


def lasting(wrench: Array, count: int, period: float) -> Array:
    """Return the mean rest (count, k) of a disturbance (k,) in decisions of ``period`` s."""
    middles = period * (np.arange(count) + 0.5)
    remaining: Array = np.exp(-middles / DISTURBANCE_TIME)[:, None] * wrench
    return remaining


def pushing(wrench: Array) -> list[Array]:
    """Return the parts of wrenches (n, 6) that move each axis: force, and on the first two the
    torque.
    """
    torque = tilting(wrench[:, 3:])
    return [*(np.column_stack([wrench[:, i], torque[i]]) for i in (0, 1)), wrench[:, 2:3]]


@dataclass(eq=False)
class WindOracle(_PreviewLaw):
    """Knows the true motion, force and torque, and the future wind.

    The law computes the future wind at the vehicle's present place. Of the actuators' disturbance
    it knows the present value, and the mean of the future.
    """

    effort: float = 1e-5  # as of ``LQG``
    foresight: int = 12
    axes: tuple[int, ...] = (0, 1, 2)
    largest = MAX_ACCELERATION
    tells = "wrench_ahead"

    @staticmethod
    def steps(vehicle: Vehicle) -> list[Step]:
        """Return the models with an acceleration beside the flight loop's own as input."""
        return [axis.held(WIND_PERIOD) for axis in axis_models(vehicle)]

    def states(self, o: Array, info: Mapping[str, Any]) -> list[Array]:
        """Return the state (..., n) of each axis for observations (..., 27) and true values."""
        place = info["position"] - info["reference"]
        speed = info["velocity"] - o[..., REFERENCE_VELOCITY]
        return self.along(info, place, speed, o[..., REFERENCE_ACCELERATION])

    def _look(self, o: Array, info: Mapping[str, Any]) -> tuple[list[Array], list[Array]]:
        return self.states(o, info), pushing(
            info["wrench_ahead"] + lasting(info["disturbance"], self.foresight, WIND_PERIOD)
        )


@dataclass(eq=False)
class Oracle(_PreviewLaw):
    """Knows the true motion, force and torque, and the fan's future motion.

    Places are relative to the fan: the fan's motion is a disturbance of place and set point. Future
    force and torque are known as means alone.

    Tried on 40 validation episodes of ``base`` and ``fast`` (mean RMSE .0084 and .0129 m), and no
    better by more than 2 %: a foresight of 20 or 50, the errors of the flight loop's estimate,
    commands that know their own limit (a quadratic program). Efforts of 1e-4 and 1e-3 give .0083
    and .0136, .0091 and .0130 m. Most of the rest is the start, up to 0.1 m off the axis. After 3 s
    (16 fresh episodes) an effort of 1e-4 changes the RMSE by -16 % (-20 to -10) on base and +17 %
    (-6 to 29) on fast. A quadratic program within the limit does not improve fast.
    """

    effort: float = 3e-4
    foresight: int = 30
    axes: tuple[int, ...] = (1,)
    largest = MAX_COMMAND
    tells = "fan_ahead"

    @staticmethod
    def steps(vehicle: Vehicle) -> list[Step]:
        """Return the models with the set point's velocity as input, and the fan's motion as the
        last disturbance.
        """
        models = []
        for axis in axis_models(vehicle):
            A, B, D = axis.with_set_point().held(DECISION_PERIOD)
            fan = np.zeros((len(A), 1))
            fan[[PLACE, -1]] = -1.0
            models.append((A, B, np.hstack([D, fan])))
        return models

    def _look(self, o: Array, info: Mapping[str, Any]) -> tuple[list[Array], list[Array]]:
        place = info["place"]
        fan = np.insert(info["fan_ahead"], 0, place[0], axis=1)  # it keeps its distance
        moves, off = np.diff(fan, axis=0), info["setpoint"] - fan[0]
        states = self.along(info, place - fan[0], info["velocity"], np.zeros(3))
        wrench = np.concatenate([info["force"], info["torque"]])
        comes = pushing(lasting(wrench, self.foresight, DECISION_PERIOD))
        return (
            [np.append(state, off[i]) for i, state in enumerate(states)],
            [np.column_stack([one, moves[:, i]]) for i, one in enumerate(comes)],
        )
