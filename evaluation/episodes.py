"""Flying a controller through an episode of any task, and its errors."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..envs.fan_tracking import LOST_OFFSET, FanTrackingEnv

Array = NDArray[np.float64]
DECISIONS = FanTrackingEnv.decisions()
# Seeds of scored episodes; training and validation use seeds below, and share none.
FIRST_TEST_SEED = 1_000_000


@dataclass(frozen=True, eq=False)
class Episode:
    """One flown episode, a row a decision; the arrays end where the vehicle was lost."""

    seed: int
    motion: str  # of the fan, or the name of the reference
    lost: bool
    total_reward: float
    decisions: int  # of a whole episode
    time: Array  # (n,) s
    error: Array  # (n,) m, distance from the fan's axis or from the reference
    position: Array  # (n, 3) m, true, world
    quaternion: Array  # (n, 4), true, body to world
    estimate: Array  # (n, 6) force N and torque Nm of the filter, world
    force: Array  # (n, 3) N, true, world
    torque: Array  # (n, 3) Nm, true, world
    fan_y: Array  # (n,) m; not a number in a task without one fan path
    observation: Array  # (n, size)

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
        """Root-mean-square error over the whole episode, m."""
        return float(np.sqrt(np.mean(self.offset**2)))


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
    """
    env.unwrapped.foresight = getattr(controller, "foresight", 0)
    observation, info = env.reset(seed=seed)
    if hasattr(controller, "brief"):
        controller.brief(env.unwrapped.briefing())
    if hasattr(controller, "reset"):
        controller.reset()
    loop, rows, total = env.unwrapped.loop, [], 0.0
    whole = decisions or env.unwrapped.max_decisions
    for _ in range(whole):
        action = np.asarray(controller(observation, info), dtype=np.float32)
        observation, reward, terminated, _, info = env.step(action)
        total += float(reward)
        row = (
            info["time"],
            info["error"] if "error" in info else abs(info["offset"]),
            loop.position.copy(),
            loop.quaternion.copy(),
            np.concatenate([loop.state[16:19], loop.state[13:16]]),
            info["force"],
            info["torque"],
            info.get("fan_y", np.nan),
            observation,
        )
        rows.append(row)
        each(info)
        if terminated:
            break
    columns = [np.array(column, dtype=np.float64) for column in zip(*rows, strict=True)]
    motion = info.get("fan_motion") or info.get("trajectory", "")
    return Episode(seed, motion, bool(info["lost"]), total, whole, *columns)


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
