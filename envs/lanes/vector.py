"""Many fan-tracking environments in the lanes of a vector unit."""

from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from gymnasium.utils.seeding import np_random

from ...estimator.ukf_lanes import estimates_of, new_work
from ...runtime.compiled import specialised
from ...runtime.errors import InputError
from ...runtime.pcg_normals import pcg_state
from ...runtime.vector_lanes import WIDTH
from ...runtime.work_sharing import PATIENCE
from ..closed_loop import ClosedLoop
from ..decision import DECISION_TICKS, EPISODE
from ..fan_tracking import SETTLE_TICKS, FanTrackingEnv
from ..observing import View
from ..plain_steps import normals_of
from ..plant import NOISE
from ..vector import FanTrackingVectorEnv, Flags, Frames
from .decision import fly_blocks
from .memory import Blocks


class FanTrackingLanes(FanTrackingVectorEnv):
    """``FanTrackingVectorEnv`` without MuJoCo: plant, filter and flight loop side by side, an
    environment in each lane of a vector unit.

    An episode is that of the MuJoCo environment with its seed, to rounding: the same draws of the
    same generators, the same equations in the same order, and MuJoCo's integrator written out for
    the one free body there is. It is the same bit for bit for any ``num_envs`` and ``threads``.
    Observation, reward, ``infos`` and autoreset modes are those of ``FanTrackingVectorEnv``.

    All scenarios fly, with any ``vehicle``, ``truth``, ``fan``, ``settings``, ``fan_path`` and
    view. What does not, and is refused: effects other than those of the rigid body (mass, inertia,
    com_offset), declared or not; ``estimator="constant-gain"``; ``render_mode``.

    Args:
        num_envs: how many.
        *args: as of ``FanTrackingVectorEnv``.
        **kwargs: likewise.

    Raises:
        InputError: what does not fly in lanes, or what ``FanTrackingVectorEnv`` refuses.
    """

    def __init__(self, num_envs: int = 1, *args: Any, **kwargs: Any) -> None:
        super().__init__(num_envs, *args, **kwargs)
        first = self.envs[0]
        like = first.flight()
        _refuse(first, like)
        self._parts = -(-num_envs // WIDTH)
        self._flying = Blocks(self._parts, like)
        self._settling = Blocks(0, like)
        self._like = like
        self._compiled: Callable[..., None] | None = None
        self._works: deque[np.ndarray] = deque()
        self._generators: list[np.random.Generator | None] = [None] * num_envs
        self._states = np.zeros(num_envs, np.int64)  # addresses of the generators'
        self._kept: list[Any] = [None] * num_envs  # what the episodes have the addresses of
        self._views = [View(first.view.observe, first.view.normalize) for _ in range(num_envs)]
        self._alone = np.zeros(3, dtype=np.int64)  # tasks of this thread alone

    def _make_envs(self, kwargs: dict[str, Any]) -> list[FanTrackingEnv]:
        """Return one environment: it says what all are, and never flies."""
        return [FanTrackingEnv(**kwargs)]

    def _entry(self, given: tuple[Any, ...], patience: int) -> None:
        """Call ``fly_blocks`` with a record for the block in hand that no other thread has."""
        try:
            work = self._works.pop()
        except IndexError:
            work = new_work(self._like.ukf.record)
        try:
            arguments = *given, work.ctypes.data, patience
            if self._compiled is None:
                self._compiled = specialised(fly_blocks, *arguments)
            self._compiled(*arguments)
        finally:
            self._works.append(work)

    def _calls(self) -> tuple[Callable[[], None], Callable[[], None]]:
        given = (
            *self._flying.given(),
            self._episodes,
            self._states,
            self._commands,
            self._resting,
            DECISION_TICKS,
            self._tasks,
        )
        return partial(self._entry, given, 0), partial(self._entry, given, PATIENCE)

    def _start_all(self, which: Flags, seeds: Sequence[int | None] | None = None) -> None:
        places = self._places(which)
        blocks = 1 + max((block for block, _ in places.values()), default=-1)
        if blocks > len(self._settling):
            self._settling = Blocks(blocks, self._like)
        settling, resting = np.zeros(blocks * WIDTH, EPISODE), np.ones(blocks * WIDTH, np.bool_)
        states = np.zeros(blocks * WIDTH, np.int64)
        for i, (block, lane) in places.items():
            n = block * WIDTH + lane
            self._hover(i, None if seeds is None else seeds[i], block, lane)
            settling[n], states[n] = self._episodes[i], self._states[i]
            settling[n]["path_count"], resting[n] = 1, False  # the fan stands still
        still = np.zeros(blocks * WIDTH)

        def settle(block: int) -> None:
            part = slice(block * WIDTH, (block + 1) * WIDTH)
            given = settling[part], states[part], still[part], resting[part], SETTLE_TICKS
            self._entry((*self._settling.given(block), *given, np.zeros(3, np.int64)), 0)

        self._spread(settle, blocks)
        for i, (block, lane) in places.items():
            self._flying.take(i // WIDTH, lane, self._settling, block)
        self._look(which)

    def _places(self, which: Flags) -> dict[int, tuple[int, int]]:
        """Return where each environment settles: in its own lane, of the first block that has it
        free.
        """
        taken = [0] * WIDTH
        places = {}
        for i in np.flatnonzero(which).tolist():
            places[i] = taken[i % WIDTH], i % WIDTH
            taken[i % WIDTH] += 1
        return places

    def _hover(self, i: int, seed: int | None, block: int, lane: int) -> None:
        """Draw an episode and let its vehicle hover at the start, in a lane of the blocks that
        settle.
        """
        generator = self._generators[i]
        if generator is None or seed is not None:
            generator = self._generators[i] = np_random(seed)[0]
        first, e = self.envs[0], self._episodes[i]
        distance, loop, path = first.hover(generator)
        self._settling.put(block, slice(lane, lane + 1), loop)
        normals = normals_of(generator, NOISE)
        self._kept[i] = path, normals
        self._motions[i] = first.fan_motion
        e["loop"] = self._flying.loops[i // WIDTH :].ctypes.data
        e["normals"], e["bits"], e["drawn"] = normals[:3]
        self._states[i] = 0 if normals.fixed else pcg_state(generator)
        e["path"], e["path_count"] = path.ctypes.data, len(path)
        e["ticks"], e["distance"], e["height"] = 0, distance, first.fan.height
        e["command"], e["power"] = 0.0, 2.0

    def _look(self, which: Flags) -> None:
        """Write what there is to see at the start of these episodes."""
        still = np.zeros(self.num_envs)
        given = self._episodes, self._states, still, ~which, 0, self._alone
        self._alone[:] = 0
        self._entry((*self._flying.given(), *given), 0)
        for name in ("reward_tracking", "reward_change", "lost"):
            self._outcomes[name][which] = 0
        if not self._views[0].is_of_a_frame:
            states = estimates_of(self._flying.filters, self.num_envs)
            for i in np.flatnonzero(which).tolist():
                self._views[i].restart(states[i])

    def _frames(self) -> Frames:
        if self._views[0].is_of_a_frame:
            return super()._frames()
        states = estimates_of(self._flying.filters, self.num_envs)
        e = self._episodes
        return np.stack(
            [
                view.of(e["outcome"]["observation"][i], states[i], int(e["ticks"][i]))
                for i, view in enumerate(self._views)
            ]
        )


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
    ):
        if wrong:
            raise InputError(f"FanTracking: plant='lanes' {what}; plant='mujoco' does it")
