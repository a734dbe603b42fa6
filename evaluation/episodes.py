"""Flying a controller through episodes, and what its tracking is worth."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..controllers import Controller
from ..envs.fan_tracking import DECISION_TICKS, EPISODE_SECONDS, LOST_OFFSET, FanTrackingEnv
from ..envs.plant import TICK
from ..runtime.errors import InputError
from .briefing import briefing_of

Array = NDArray[np.float64]
DECISIONS = round(EPISODE_SECONDS / TICK / DECISION_TICKS)
# Seeds of episodes that score controllers; those of training and validation lie below, so none is
# shared.
FIRST_TEST_SEED = 1_000_000
_SEEDS = 2**32  # of a benchmark


@dataclass(frozen=True, eq=False)
class Episode:
    """One flown episode, a sample a decision; the arrays end where the vehicle was lost."""

    seed: int
    motion: str
    lost: bool
    total_reward: float
    time: Array  # (n,) s
    y: Array  # (n,) m, of the vehicle
    fan_y: Array  # (n,) m
    command: Array  # (n,) m/s
    observation: Array  # (n, 8)
    force: Array  # (n, 3) N, true, world
    torque: Array  # (n, 3) Nm, true, world

    @property
    def offset(self) -> Array:
        """Offset (250,) m from the fan's axis; a lost vehicle's remaining time counts at 2.5 m."""
        full = np.full(DECISIONS, LOST_OFFSET)
        full[: len(self.y)] = np.minimum(np.abs(self.y - self.fan_y), LOST_OFFSET)
        return full

    @property
    def rmse(self) -> float:
        """Root-mean-square offset over the whole episode, m."""
        return float(np.sqrt(np.mean(self.offset**2)))


def fly_episode(
    env: FanTrackingEnv,
    controller: Controller,
    seed: int,
    each: Callable[[], None] = lambda: None,
    decisions: int = DECISIONS,
) -> Episode:
    """Fly one episode, or its first ``decisions``, and return it; ``each`` is called after every
    decision.

    A controller that has ``brief`` is told what the environment says of itself, first of all.
    """
    observation, info = env.reset(seed=seed)
    brief = getattr(controller, "brief", None)
    if brief is not None:
        brief(briefing_of(env))
    controller.reset()
    rows: list[tuple[float, float, float, float]] = []
    observations, forces, torques = [], [], []
    total = 0.0
    for _ in range(decisions):
        action = controller(observation, info)
        observation, reward, lost, _, info = env.step(np.asarray(action, dtype=np.float32))
        total += float(reward)
        rows.append((info["time"], info["y"], info["fan_y"], float(observation[7])))
        observations.append(observation)
        forces.append(info["force"])
        torques.append(info["torque"])
        each()
        if lost:
            break
    t, y, fan_y, command = np.array(rows).T
    return Episode(
        seed,
        info["fan_motion"],
        bool(info["lost"]),
        total,
        t,
        y,
        fan_y,
        command,
        np.array(observations, dtype=np.float64),
        np.array(forces),
        np.array(torques),
    )


def check_episodes(episodes: int, seed: int) -> None:
    """Check how many episodes a benchmark is asked for, and its seed, which may be any of 32 bits.

    Raises:
        InputError: no episodes, or a seed out of range.
    """
    if episodes < 1:
        raise InputError(f"benchmark: --episodes must be at least 1, got {episodes}")
    if not 0 <= seed < _SEEDS:
        raise InputError(f"benchmark: --seed must lie between 0 and {_SEEDS - 1}, got {seed}")


def benchmark_seeds(seed: int, episodes: int) -> list[int]:
    """Return the seeds of a benchmark's episodes; every controller flies the same ones."""
    return [FIRST_TEST_SEED + 10_000 * seed + i for i in range(episodes)]


def time_series(episode: Episode, poses: Array) -> dict[str, Array]:
    """Return an episode as columns (n,), a row a decision; ``poses`` (n, 7) are position and
    quaternion.

    ``t`` s; ``px, py, pz`` m and ``qw, qx, qy, qz``, true, body to world; ``fan_y`` m; ``command``
    m/s along y; ``fx, fy, fz`` N and ``tx, ty, tz`` Nm, estimated, ``true_fx`` to ``true_tz`` true,
    both in the world frame; ``vy`` m/s, estimated.
    """
    pose = ("px", "py", "pz", "qw", "qx", "qy", "qz")
    wrench = ("fx", "fy", "fz", "tx", "ty", "tz")
    true = np.column_stack([episode.force, episode.torque])
    return {
        "t": episode.time,
        **{name: poses[:, i] for i, name in enumerate(pose)},
        "fan_y": episode.fan_y,
        "command": episode.command,
        **{name: episode.observation[:, i] for i, name in enumerate(wrench)},
        **{f"true_{name}": true[:, i] for i, name in enumerate(wrench)},
        "vy": episode.observation[:, 6],
    }
