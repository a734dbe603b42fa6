"""Many fan-tracking environments in the lanes of a vector unit."""

from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.utils.seeding import np_random

from ...dynamics.motion import Array
from ...estimator.ukf_lanes import new_work, step_address
from ...runtime.compiled import compiled
from ...runtime.errors import InputError, unknown_name
from ...runtime.vector_lanes import WIDTH
from ..closed_loop import ClosedLoop
from ..fan_tracking import DECISION_TICKS, FanTrackingEnv
from ..normals import generator_list
from ..task import SETTLE_TICKS
from ..vector import FanTrackingVectorEnv, Flags
from .flight import Blocks, fly_blocks

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

    def _make_envs(self, kwargs: dict[str, Any]) -> list[FanTrackingEnv]:
        """Return one environment: it says what all are, and never flies."""
        return [FanTrackingEnv(**kwargs)]

    def _make_memory(self) -> tuple[Array, Array, Array, Array]:
        """Make what ``_fly`` works on; return motion, wrench and estimates."""
        env = self.envs[0]
        self._like = env.make_loop(env.truth, env.fan)
        _refuse(env, self._like)
        self._step = step_address()
        self._flying = Blocks(-(-self.num_envs // WIDTH), self._like)
        self._settling = Blocks(0, self._like)
        self._works: deque[np.ndarray] = deque()
        self._seeded = np.zeros(self.num_envs, dtype=np.bool_)
        return self._flying.motion

    def _fly_blocks(self, blocks: Blocks, count: int, *given: Any) -> None:
        """Fly blocks; each thread has a record of its own for the filters in hand."""
        parts = 1 if self.threads == 1 else count

        def fly(part: int) -> None:
            try:
                work = self._works.pop()
            except IndexError:
                work = new_work(self._like.ukf.record)
            try:
                first, last = part * count // parts, (part + 1) * count // parts
                memory = *blocks.addresses, work.ctypes.data, self._step, self._like.jet_table
                self._call(fly_blocks, first, last, *memory, *blocks.drawn, *given)
            finally:
                self._works.append(work)

        self._spread(fly, parts)

    def _fly(self, which: Flags) -> None:
        blocks = self._flying
        given = self._generators, which, self._commands, self._paths, self._ticks, DECISION_TICKS
        self._fly_blocks(blocks, len(blocks), *given)
        self._call(start_over, which, *self._motion[:2], self._broken)

    def _hover(self, which: list[int], seeds: Sequence[int | None]) -> None:
        places = _places(which)
        count = 1 + max((block for block, _ in places.values()), default=-1)
        if count > len(self._settling):
            self._settling = Blocks(count, self._like)
        settling, size = self._settling, count * WIDTH
        generators = generator_list([np.random.default_rng(0)] * size)
        flying, still = np.zeros(size, dtype=np.bool_), np.zeros((size, 1))
        for i, (block, lane) in places.items():
            n = WIDTH * block + lane
            generators[n] = self._draw(i, seeds[i], block, lane)
            flying[n], still[n] = True, self._paths[i, 0]
        given = generators, flying, np.zeros(size), still, np.zeros(size, np.int64), SETTLE_TICKS
        self._fly_blocks(settling, count, *given)
        for i, (block, lane) in places.items():
            self._flying.take(i // WIDTH, lane, settling, block)

    def _draw(self, i: int, seed: int | None, block: int, lane: int) -> np.random.Generator:
        """Draw an episode and put its vehicle at the start, in a lane of the blocks that settle;
        return the generator.
        """
        env = self.envs[0]
        if not self._seeded[i] or seed is not None:
            self._generators[i], self._seeded[i] = np_random(seed)[0], True
        generator: np.random.Generator = self._generators[i]
        env.np_random = generator
        env.hover()
        self._distance[i], self._paths[i] = env.distance, env.path[:, 0]
        self._settling.put(block, slice(lane, lane + 1), env.loop)
        self._values["fan_motion"][i] = env.fan_motion
        return generator


@compiled
def start_over(which: Flags, position: Array, velocity: Array, broken: Flags) -> None:
    """Let environments start over, as MuJoCo does, whose numbers are too large or not finite."""
    for n in np.flatnonzero(which):
        b, lane = n // WIDTH, n % WIDTH
        p, v = position[b, :, lane], velocity[b, :, lane]
        broken[n] = not (np.abs(p).max() <= _LARGEST and np.abs(v).max() <= _LARGEST)
        if broken[n]:
            p[:], v[:] = 0.0, 0.0
            p[3] = 1.0


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
