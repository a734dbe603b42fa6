"""The state of n worlds as arrays with n rows: the argument of a task's functions."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from .. import _core
from ..runtime.arrays import Array, Index, Mask

REFERENCE_SIZE = 10  # position, velocity, acceleration, yaw


class Start(NamedTuple):
    """The starts of n episodes.

    Attributes:
        poses: (n, 4) position (m) and yaw (rad) of the vehicle in hover, or (n, 3): yaw 0.
        references: (n, k, 10) position, velocity, acceleration and yaw, a row a tick of 5 ms, or
            (n, k, 3) positions, at the start's yaw. None: the start's pose.
        winds: n lists of winds; none: still air.
        paths: (n, m, 2) m, y and height of the fan's axis, a row a tick; None: no fan moves.
        labels: n names of what was drawn, for ``info``.
    """

    poses: Any
    references: Any = None
    winds: Sequence[Any] = ()
    paths: Any = None
    labels: Sequence[str] = ()


class Episodes(NamedTuple):
    """Episodes side by side, a row each."""

    ticks: Index  # (n,) since the start; below zero while the filter settles
    decisions: Index  # (n,) likewise
    paths: Array  # (n, m) m, y of the fan's axis, a column a tick
    heights: Array  # (n, m) m, its height; (n, 1) if no fan moves up or down
    references: Array  # (n, k, 10), a row a tick
    commands: Array  # (n, actions) as the flight loop takes them
    actions: Array  # (n, actions) as the agent gave them, -1 to 1
    last_actions: Array  # (n, actions)
    broken: Mask  # (n,) whether the physics started over on its own

    @classmethod
    def zeros(cls, count: int, actions: int) -> "Episodes":
        """Return ``count`` episodes before they begin."""
        ticks, decisions = np.zeros((2, count), dtype=np.int64)
        commands, now, last = np.zeros((3, count, actions))
        paths, heights = np.zeros((2, count, 1))
        references, broken = np.zeros((count, 1, REFERENCE_SIZE)), np.zeros(count, dtype=np.bool_)
        return cls(ticks, decisions, paths, heights, references, commands, now, last, broken)


# columns of a world's row, in the core's order
_POSE = {"position": 3, "quaternion": 4, "velocity": 3, "angular_velocity": 3}
_TRUE = _POSE | {"force": 3, "torque": 3}
_ESTIMATED = _POSE | {
    "torque": 3,
    "force": 3,
    "last": 1,
    "std_torque": 3,
    "std_force": 3,
    "attitude_error": 3,
}
_BESIDE = {
    "specific_force": 3,
    "specific_thrust": 3,
    "wind": 3,
    "reference": REFERENCE_SIZE,
    "fan": 2,
    "fan_velocity": 2,
    "distance": 1,
    "time": 1,
    "change": 1,
}
_FIRST = sum(_TRUE.values())  # column of the estimate
_REST = _FIRST + sum(_ESTIMATED.values())
_SIZE = _REST + sum(_BESIDE.values())
assert _SIZE == _core.WORLD_SIZE, "the core was built for another layout"


def _lay(target: object, rows: Array, first: int, fields: dict[str, int]) -> None:
    for name, size in fields.items():
        setattr(target, name, rows[:, first : first + size] if size > 1 else rows[:, first])
        first += size


class _Motions:
    position: Array
    quaternion: Array
    velocity: Array
    angular_velocity: Array
    force: Array
    torque: Array


class WorldEstimates(_Motions):
    """The filter's estimate of n worlds.

    Attributes:
        position: (n, 3) m, world.
        quaternion: (n, 4) body to world, scalar first.
        velocity: (n, 3) m/s, world.
        angular_velocity: (n, 3) rad/s, body.
        force: (n, 3) N, world, external; ``std_force`` its standard deviation.
        torque: (n, 3) Nm, world, likewise; ``std_torque``.
        attitude_error: (n, 3) rad for small angles: twice the vector part of the quaternion from
            upright at the reference's yaw, in these axes, to the estimate.
    """

    std_force: Array
    std_torque: Array
    attitude_error: Array


class State(_Motions):
    """The state of n worlds after a decision. Arrays are views: the next decision overwrites them.

    Attributes:
        position: (n, 3) m, world, true; ``quaternion`` (n, 4) body to world, ``velocity`` (n, 3)
            m/s, world, and ``angular_velocity`` (n, 3) rad/s, body, likewise.
        force: (n, 3) N, world, true and external; ``torque`` (n, 3) Nm.
        estimate: ``WorldEstimates``.
        reference: (n, 10) position, velocity, acceleration (world) and yaw.
        distance: (n,) m, of the true position from the reference's.
        action: (n, k) of this decision, -1 to 1; ``last_action`` that before.
        change: (n,) sum of the squares of ``action - last_action``.
        command: (n, k) the action in the flight loop's units.
        specific_force: (n, 3) m/s2, world, by an accelerometer, mean over the decision; zero
            where the task has none. ``specific_thrust``: the rotors' part by the declared model.
        wind: (n, 3) m/s, world, mean over the vehicle's stations.
        fan: (n, 2) m, y and height of the fan's axis; ``fan_velocity`` m/s.
        time: (n,) s since the start; ``decision`` (n,) their number.
        flying: (n,) whether finite, upright to 70 degrees, and no faster than a vehicle.
        rng: n generators, each of its own world.
        memory: a task's own arrays from one decision to the next.
    """

    specific_force: Array
    specific_thrust: Array
    wind: Array
    reference: Array
    fan: Array
    fan_velocity: Array
    distance: Array
    time: Array
    change: Array

    def __init__(self, episodes: Episodes, rng: list[np.random.Generator]) -> None:
        count = len(episodes.ticks)
        self.rows, self.flying = np.zeros((count, _SIZE)), np.ones(count, dtype=np.bool_)
        self.rng, self.memory = rng, dict[str, Any]()
        self.bind(episodes)

    def bind(self, episodes: Episodes) -> None:
        """Lay the fields over the rows, and those of the episodes beside them."""
        self.estimate = WorldEstimates()
        _lay(self, self.rows, 0, _TRUE)
        _lay(self.estimate, self.rows, _FIRST, _ESTIMATED)
        _lay(self, self.rows, _REST, _BESIDE)
        self.action, self.last_action = episodes.actions, episodes.last_actions
        self.command, self.decision = episodes.commands, episodes.decisions

    def first(self, name: str, now: Array) -> Array:
        """Return values (n, ...) as they were at each episode's start, kept under a name."""
        starts: Array = self.memory.setdefault(name, np.zeros_like(now))
        begins = self.decision == 0
        starts[begins] = now[begins]
        return starts

    def __getstate__(self) -> dict[str, Any]:
        return {name: self.__dict__[name] for name in ("rows", "flying", "rng", "memory")}
