"""Many fan-tracking environments in the lanes of a vector unit."""

from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.utils.seeding import np_random
from numba import typed, typeof

from ...estimator.ukf_lanes import estimates_of, new_work, step_address
from ...runtime.errors import InputError, unknown_name
from ...runtime.vector_lanes import WIDTH
from ..closed_loop import FASTEST, ClosedLoop
from ..fan_tracking import (
    AWAY,
    DECISION_TICKS,
    FAN_TIMES,
    FanTrackingEnv,
    reward_terms,
    seen_of,
)
from ..observing import View
from ..plant import TICK
from ..task import LOST_OFFSET, SETTLE_TICKS, UPRIGHT
from ..vector import FanTrackingVectorEnv, Flags
from .flight import Blocks, fly_block

_LARGEST = 1e10  # of a number that MuJoCo goes on with


class FanTrackingLanes(FanTrackingVectorEnv):
    """``FanTrackingVectorEnv`` without MuJoCo: plant, filter and flight loop side by side, an
    environment in each lane of a vector unit.

    An episode is that of the MuJoCo environment with its seed, to rounding: the same draws of the
    same generators, the same equations in the same order, and MuJoCo's integrator written out for
    the one free body there is. It is the same bit for bit for any ``num_envs`` and ``threads``.
    Observation, reward, ``infos`` and autoreset modes are those of ``FanTrackingVectorEnv``.

    All scenarios fly, with any ``vehicle``, ``truth``, ``fan``, ``settings``, ``fan_path`` and
    view. What does not, and is refused: effects other than those of the rigid body (mass, inertia,
    com_offset), declared or not; ``estimator="constant-gain"``; ``render_mode``; ``stages``.

    Args:
        num_envs: how many.
        *args: as of ``FanTrackingVectorEnv``.
        **kwargs: likewise.

    Raises:
        InputError: what does not fly in lanes, or what ``FanTrackingVectorEnv`` refuses.
    """

    def __init__(self, num_envs: int = 1, *args: Any, **kwargs: Any) -> None:
        super().__init__(num_envs, *args, **kwargs)
        self._env = self.envs[0]
        self._like = self._env.make_loop(self._env.truth, self._env.fan)
        _refuse(self._env, self._like)
        self._step, (self._axial, self._radial) = step_address(), self._like.jet_table
        blocks = -(-num_envs // WIDTH)
        self._flying, self._settling = Blocks(blocks, self._like), Blocks(0, self._like)
        self._works: deque[np.ndarray] = deque()
        kind = typeof(np_random(0)[0])
        self._generators: list[np.random.Generator | None] = [None] * num_envs
        self._drawn = [typed.List.empty_list(kind) for _ in range(blocks)]  # the same, by block
        view = self._env.view
        self._views = [View(view.observe, view.normalize) for _ in range(num_envs)]
        self._ticks = np.zeros(num_envs, dtype=np.int64)  # since the start of the episode
        self._paths = np.zeros((num_envs, FAN_TIMES.size))  # m, the fan's y, a column a tick
        self._distance, self._commands = np.zeros(num_envs), np.zeros((num_envs, 1))

    def _make_envs(self, kwargs: dict[str, Any]) -> list[FanTrackingEnv]:
        """Return one environment: it says what all are, and never flies."""
        return [FanTrackingEnv(**kwargs)]

    def _fly_block(
        self,
        blocks: Blocks,
        block: int,
        generators: Any,
        flying: Flags,
        paths: np.ndarray,
        first: np.ndarray,
        ticks: int,
    ) -> None:
        """Fly one block with a record for its filters in hand that no other thread has."""
        try:
            work = self._works.pop()
        except IndexError:
            work = new_work(self._like.ukf.record)
        try:
            fly_block(
                *blocks.places[block],
                work.ctypes.data,
                self._step,
                self._axial,
                self._radial,
                *blocks.drawn[block],
                generators,
                flying,
                paths,
                first,
                ticks,
            )
        finally:
            self._works.append(work)

    def _fly(self, commands: np.ndarray, which: Flags) -> None:
        blocks, limit = self._flying, self._env.largest_action
        change = -self._commands
        self._commands[which] = np.clip(commands[which], -limit, limit)
        change += self._commands
        blocks.write_lanes(blocks.loops["flight"]["setpoint"][:, 4], self._commands[:, 0])

        def fly(block: int) -> None:
            part = slice(WIDTH * block, WIDTH * (block + 1))
            if which[part].any():
                given = which[part], self._paths[part], self._ticks[part]
                self._fly_block(blocks, block, self._drawn[block], *given, DECISION_TICKS)

        self._spread(fly, len(blocks))
        self._ticks[which] += DECISION_TICKS
        self._look(which, change[:, 0])

    def _begin(self, which: list[int], seeds: Sequence[int | None] | None) -> None:
        places = _places(which)
        count = 1 + max((block for block, _ in places.values()), default=-1)
        if count > len(self._settling):
            self._settling = Blocks(count, self._like)
        settling = self._settling
        kind = typeof(np_random(0)[0])
        generators = [typed.List.empty_list(kind) for _ in range(count)]
        flying = np.zeros((count, WIDTH), dtype=np.bool_)
        still = np.zeros((count, WIDTH, 1))
        for i, (block, lane) in places.items():
            generator = self._hover(i, None if seeds is None else seeds[i], block, lane)
            while len(generators[block]) <= lane:  # lanes that nobody settles in draw nothing
                generators[block].append(generator)
            generators[block][lane], flying[block, lane] = generator, True
            still[block, lane] = self._paths[i, 0]

        def settle(block: int) -> None:
            given = flying[block], still[block], np.zeros(WIDTH, np.int64)
            self._fly_block(settling, block, generators[block], *given, SETTLE_TICKS)

        self._spread(settle, count)
        for i, (block, lane) in places.items():
            self._flying.take(i // WIDTH, lane, settling, block)
        started = np.zeros(self.num_envs, dtype=np.bool_)
        started[which] = True
        self._ticks[which], self._commands[which] = 0, 0.0
        states = estimates_of(self._flying.filters, self.num_envs)
        for i in which:
            self._views[i].restart(states[i])
        self._look(started, np.zeros(self.num_envs))
        for name in ("reward_tracking", "reward_change", "lost"):
            self._values[name][which] = 0

    def _hover(self, i: int, seed: int | None, block: int, lane: int) -> np.random.Generator:
        """Draw an episode and let its vehicle hover at the start, in a lane of the blocks that
        settle; return the generator.
        """
        generator = self._generators[i]
        if generator is None or seed is not None:
            generator = self._generators[i] = np_random(seed)[0]
            drawn = self._drawn[i // WIDTH]
            while len(drawn) <= i % WIDTH:
                drawn.append(generator)
            drawn[i % WIDTH] = generator
        self._env.np_random = generator
        self._distance[i], loop, self._paths[i] = self._env.hover()
        self._settling.put(block, slice(lane, lane + 1), loop)
        self._values["fan_motion"][i] = self._env.fan_motion
        return generator

    def _look(self, which: Flags, change: np.ndarray) -> None:
        """Write frames and values of some environments, as ``FanTrackingEnv`` has them."""
        count, loops, values = self.num_envs, self._flying.loops, self._values
        qpos, qvel, external = (
            self._flying.each(field)[:count]
            for field in (loops["qpos"], loops["qvel"], loops["plant"]["external"])
        )
        broken = which & ~(np.abs(np.column_stack([qpos, qvel])) <= _LARGEST).all(axis=1)
        for i in np.flatnonzero(broken).tolist():  # MuJoCo starts over
            loops["qpos"][i // WIDTH, :, i % WIDTH] = qpos[i] = [0, 0, 0, 1, 0, 0, 0]
            loops["qvel"][i // WIDTH, :, i % WIDTH] = qvel[i] = 0.0
        states, rows = estimates_of(self._flying.filters, count), np.arange(count)
        k = np.minimum(self._ticks, self._paths.shape[1] - 1)
        fan_y = self._paths[rows, np.maximum(k - 1, 0)]
        offset = qpos[:, 1] - fan_y
        # written such that a number that is not finite counts as lost
        flying = (
            np.isfinite(states[:, :19].sum(axis=1))
            & (1.0 - 2.0 * (qpos[:, 4] ** 2 + qpos[:, 5] ** 2) >= UPRIGHT)
            & (np.abs(qvel) < FASTEST).all(axis=1)
            & (np.abs(offset) <= LOST_OFFSET)
            & (np.abs(qpos[:, 0] - self._distance) <= AWAY)
            & (np.abs(qpos[:, 2] - self._env.fan.height) <= AWAY)
        )
        now = {
            **reward_terms(offset, change),
            "fan_y": fan_y,
            "fan_velocity": (self._paths[rows, k] - fan_y) / TICK,
            "y": qpos[:, 1],
            "offset": offset,
            "force": external[:, :3],
            "torque": external[:, 3:],
            "time": self._ticks * TICK,
            "lost": broken | ~flying,
        }
        for name, value in now.items():
            values[name][which] = value[which]
        frames = seen_of(states, self._commands)
        if self._env.view.is_of_a_frame:
            self._frames[which] = self._env.view.of_frames(frames)[which]
            return
        for i in np.flatnonzero(which).tolist():
            self._frames[i] = self._views[i].of(frames[i], states[i], int(self._ticks[i]))


def _places(which: list[int]) -> dict[int, tuple[int, int]]:
    """Return block and lane in which each environment settles: in its own lane, of the first block
    that has the lane free.
    """
    taken = [0] * WIDTH
    places = {}
    for i in which:
        places[i] = taken[i % WIDTH], i % WIDTH
        taken[i % WIDTH] += 1
    return places


def _refuse(env: FanTrackingEnv, loop: ClosedLoop) -> None:
    """Refuse what does not fly in lanes."""
    record = loop.record[0]
    called = any(
        record[part][f"{kind}_count"]
        for part in ("plant", "filter")
        for kind in ("wrench", "rotor", "sensing")
    )
    for wrong, what in (
        (env.render_mode is not None, f"is not drawn, got render_mode={env.render_mode!r}"),
        (env.estimator != "ukf", f"flies the full filter 'ukf', got estimator={env.estimator!r}"),
        (called, "flies no effects but mass, inertia and com_offset, and the vehicle has others"),
        (env.stages, "runs no stages of your own"),
    ):
        if wrong:
            raise InputError(f"FanTracking: plant='lanes' {what}; plant='mujoco' does it")


PLANTS: dict[str, type[FanTrackingVectorEnv]] = {
    "mujoco": FanTrackingVectorEnv,
    "lanes": FanTrackingLanes,
}


def make_fan_tracking_vector(
    num_envs: int = 1, plant: str = "mujoco", **kwargs: Any
) -> FanTrackingVectorEnv:
    """Return ``num_envs`` fan-tracking environments side by side.

    Args:
        num_envs: how many.
        plant: ``"mujoco"``, the reference (``FanTrackingVectorEnv``), or ``"lanes"``, the same
            flight in the lanes of a vector unit (``FanTrackingLanes``): several times as fast.
        **kwargs: of the class.

    Raises:
        InputError: an unknown plant, or what the class refuses.
    """
    if plant not in PLANTS:
        raise unknown_name("plant", str(plant), PLANTS, "FanTracking: plant")
    return PLANTS[plant](num_envs, **kwargs)


__all__ = ["PLANTS", "FanTrackingLanes", "make_fan_tracking_vector"]
