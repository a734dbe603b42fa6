"""Flying a controller through an episode of any task, and its figures."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..envs.definition import LOST_OFFSET
from ..envs.fan_tracking import FanTrackingEnv
from ..runtime.arrays import Array
from ..runtime.errors import InputError
from .watched import WatchedInfo

DECISIONS = FanTrackingEnv.decisions()
# Seeds of scored episodes; training and validation use seeds below, and share none.
FIRST_TEST_SEED = 1_000_000
TRANSIENT = 3.0  # s, the start of an episode: physics decides the error there, not the law
_AT_BOUND = 0.99  # share of the largest command


@dataclass(frozen=True, eq=False)
class Episode:
    """One flown episode, a row a decision; the arrays of a lost vehicle end early. Quantities that
    a task does not have are NaN.
    """

    seed: int
    motion: str  # the fan's motion, or the reference's name
    lost: bool
    uses_truth: bool  # whether the controller read a true value or a preview
    total_reward: float
    decisions: int  # in a whole episode
    time: Array  # (n,) s
    error: Array  # (n,) m, distance from the fan's axis or from the reference; (0,): unstated
    position: Array  # (n, 3) m, true, world
    quaternion: Array  # (n, 4), true, body to world
    estimate: Array  # (n, 6) force N and torque Nm of the filter, world
    force: Array  # (n, 3) N, true, world
    torque: Array  # (n, 3) Nm, true, world
    fan_y: Array  # (n,) m; not a number in a task without one fan path
    observation: Array  # (n, size)
    action: Array  # (n, k) flown, -1 to 1 over the range of the action space

    @property
    def y(self) -> Array:
        """Position (n,) of the vehicle along y, m."""
        return self.position[:, 1]

    @property
    def in_jet(self) -> bool:
        """Whether the task has a fan on one path."""
        return bool(np.isfinite(self.fan_y).all())

    @property
    def command(self) -> Array:
        """Flown command (n,) of FanTracking, m/s."""
        return self.observation[:, 7]

    @property
    def offset(self) -> Array:
        """Error (decisions,) of the whole episode, m; a lost vehicle's remaining time counts at
        2.5 m.
        """
        full = np.full(self.decisions, LOST_OFFSET)
        flown = np.nan_to_num(self.error, nan=LOST_OFFSET)
        full[: len(flown)] = np.minimum(flown, LOST_OFFSET)
        return full

    @property
    def rmse(self) -> float:
        """Root-mean-square error over the whole episode, m; not a number without errors."""
        return self._rmse(slice(None))

    @property
    def rmse_settled(self) -> float:
        """Root-mean-square error after 3 s, m: the ranking figure. In an episode of less than 6 s:
        the error of the second half.
        """
        return self._rmse(slice(self._split, None))

    @property
    def rmse_transient(self) -> float:
        """Root-mean-square error before ``rmse_settled`` begins, m."""
        return self._rmse(slice(self._split))

    @property
    def _split(self) -> int:
        return min(round(TRANSIENT * len(self.time) / float(self.time[-1])), self.decisions // 2)

    def _rmse(self, part: slice) -> float:
        return float(np.sqrt(np.mean(self.offset[part] ** 2))) if len(self.error) else np.nan

    @property
    def command_activity(self) -> float:
        """Mean squared change of the command from decision to decision, summed over its components.

        Unit: the square of half the range of the action space, for the four tasks of the largest
        command. The first change is from the middle of the range. The term ``reward_change`` of a
        task is the negative of this square in SI units, times a cost.
        """
        changes = np.diff(self.action, axis=0, prepend=0.0)
        return float(np.mean(np.sum(changes**2, axis=1)))

    @property
    def saturated_fraction(self) -> float:
        """Share of the decisions with a component of the command within 1 % of its bound."""
        return float(np.mean(np.abs(self.action).max(axis=1) >= _AT_BOUND))


def error_of(info: Mapping[str, Any]) -> Any:
    """Return the error that ``info`` states, m: ``error``, or the size of ``offset``; or None."""
    if "error" in info:
        return info["error"]
    return np.abs(info["offset"]) if "offset" in info else None


def _length_of(env: Any) -> int:
    """Return the number of decisions of an environment's whole episode.

    Raises:
        InputError: neither its registration nor its class says.
    """
    steps = env.spec.max_episode_steps if env.spec is not None else None
    steps = steps or getattr(env.unwrapped, "max_decisions", None)
    if steps is None:
        raise InputError(
            f"{type(env.unwrapped).__name__}: states no length of an episode; expected "
            "max_episode_steps in gymnasium.register, or an attribute max_decisions"
        )
    return int(steps)


def fly_episode(
    env: Any,
    controller: Any,
    seed: int,
    each: Callable[[dict[str, Any]], None] = lambda info: None,
    decisions: int | None = None,
) -> Episode:
    """Fly and return one episode of a task.

    Args:
        env: the environment.
        controller: called with ``observation`` and ``info``. If present, ``brief`` is called first
            with ``Task.briefing``, then ``reset``. A ``foresight`` is the number of decisions of
            wind or fan ahead in ``info``.
        seed: the episode's.
        each: called with the ``info`` of every decision.
        decisions: length of a whole episode; default: the task's.

    Raises:
        InputError: the environment states no length of an episode, or takes no such action.
    """
    world, foresight = env.unwrapped, getattr(controller, "foresight", 0)
    world.foresight = foresight
    observation, info = env.reset(seed=seed)
    if hasattr(controller, "brief") and hasattr(world, "briefing"):
        controller.brief(world.briefing())
    if hasattr(controller, "reset"):
        controller.reset()
    whole, low, high = decisions or _length_of(env), env.action_space.low, env.action_space.high
    rows, total, uses_truth = [], 0.0, bool(foresight)
    rate = getattr(world, "decision_hz", world.metadata.get("render_fps", 1))
    for k in range(whole):
        seen = WatchedInfo(info)
        action = np.asarray(controller(observation, seen), dtype=np.float32)
        uses_truth = uses_truth or seen.read_truth
        observation, reward, terminated, truncated, info = env.step(action)
        total += float(reward)
        time = info.get("time", (k + 1) / rate)
        rows.append((time, *_motion(world, info), observation, action))
        each(info)
        if terminated or truncated:
            break
    columns = [np.array(column, dtype=np.float64) for column in zip(*rows, strict=True)]
    columns[-1] = 2.0 * (np.clip(columns[-1], low, high) - low) / (high - low) - 1.0
    if error_of(info) is None:
        columns[1] = np.zeros(0)
    motion = info.get("fan_motion") or info.get("trajectory", "")
    lost = bool(info.get("lost", terminated))
    return Episode(seed, motion, lost, uses_truth, total, whole, *columns)


def _motion(world: Any, info: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return error, position, quaternion, estimate, force, torque and fan as an episode has
    them.
    """
    error, loop, wrench = error_of(info), getattr(world, "loop", None), np.full(6, np.nan)
    position, quaternion = info.get("position", np.full(3, np.nan)), np.full(4, np.nan)
    estimate = np.full(6, np.nan)
    if loop is not None:
        position, quaternion = loop.position.copy(), loop.quaternion.copy()
        estimate = np.concatenate([loop.state[16:19], loop.state[13:16]])
        wrench = loop.external.copy()
    return (
        np.nan if error is None else error,
        position,
        quaternion,
        estimate,
        info.get("force", wrench[:3]),
        info.get("torque", wrench[3:]),
        info.get("fan_y", np.nan),
    )


def benchmark_seeds(seed: int, episodes: int) -> list[int]:
    """Return the seeds of a benchmark's episodes; every controller flies the same ones."""
    return [FIRST_TEST_SEED + 10_000 * seed + i for i in range(episodes)]


def time_series(episode: Episode) -> dict[str, Array]:
    """Return an episode as columns (n,), a row a decision.

    ``t`` s; ``error`` m; ``px, py, pz`` m and ``qw, qx, qy, qz``, true, body to world. In the world
    frame ``fx, fy, fz`` N and ``tx, ty, tz`` Nm are estimated, ``true_fx`` to ``true_tz`` true.
    FanTracking also has ``fan_y`` m, ``command`` m/s along y and ``vy`` m/s, estimated.
    """
    groups = {
        ("px", "py", "pz"): episode.position,
        ("qw", "qx", "qy", "qz"): episode.quaternion,
        ("fx", "fy", "fz", "tx", "ty", "tz"): episode.estimate,
        ("true_fx", "true_fy", "true_fz"): episode.force,
        ("true_tx", "true_ty", "true_tz"): episode.torque,
    }
    columns = {"t": episode.time, "error": episode.error}
    for names, values in groups.items():
        columns |= dict(zip(names, values.T, strict=True))
    if episode.in_jet:
        columns["fan_y"], columns["command"] = episode.fan_y, episode.command
        columns["vy"] = episode.observation[:, 6]
    return columns
