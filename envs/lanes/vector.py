"""Many fan-tracking environments in the lanes of a vector unit."""

from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from gymnasium.utils.seeding import np_random

from ...controllers.observation import OBSERVATION_SIZE
from ...dynamics.motion import Array
from ...estimator.ukf_lanes import estimates_of, new_work, step_address
from ...runtime.compiled import compiled, compiled_without_gil, specialised
from ...runtime.errors import InputError, unknown_name
from ...runtime.vector_lanes import WIDTH
from ..closed_loop import ClosedLoop, is_healthy
from ..fan_tracking import (
    AWAY,
    DECISION_TICKS,
    FAN_TIMES,
    FanTrackingEnv,
    reward_terms,
    see,
)
from ..normals import generator_list
from ..observing import View
from ..plant import TICK
from ..task import LOST_OFFSET, SETTLE_TICKS, UPRIGHT, Frame
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

    def __init__(self, num_envs: int = 1, *args: Any, **kwargs: Any) -> None:
        super().__init__(num_envs, *args, **kwargs)
        self._env = self.envs[0]
        self._like = self._env.make_loop(self._env.truth, self._env.fan)
        _refuse(self._env, self._like)
        self._step = step_address()
        blocks = -(-num_envs // WIDTH)
        self._flying, self._settling = Blocks(blocks, self._like), Blocks(0, self._like)
        self._works: deque[np.ndarray] = deque()
        # each environment's own; one that was not reset yet has another's
        self._generators = generator_list([np_random(0)[0]] * num_envs)
        self._seeded = np.zeros(num_envs, dtype=np.bool_)
        view = self._env.view
        self._views = [View(view.observe, view.normalize) for _ in range(num_envs)]
        self._ticks = np.zeros(num_envs, dtype=np.int64)  # since the start of the episode
        self._paths = np.zeros((num_envs, FAN_TIMES.size))  # m, the fan's y, a column a tick
        self._distance = np.zeros(num_envs)
        self._commands, self._changes = np.zeros(num_envs), np.zeros(num_envs)  # m/s
        self._seen = self._frames
        if not view.is_plain:
            self._seen = np.zeros((num_envs, OBSERVATION_SIZE), dtype=np.float32)
        self._compiled: dict[Any, Callable[..., None]] = {}

    def _make_envs(self, kwargs: dict[str, Any]) -> list[FanTrackingEnv]:
        """Return one environment: it says what all are, and never flies."""
        return [FanTrackingEnv(**kwargs)]

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
                arguments = first, last, *memory, *blocks.drawn, *given
                self._call(fly_blocks, *arguments)
            finally:
                self._works.append(work)

        self._spread(fly, parts)

    def _call(self, function: Callable[..., None], *arguments: Any) -> None:
        """Call a compiled function, always with arguments of the same types."""
        if function not in self._compiled:
            self._compiled[function] = specialised(function, *arguments)
        self._compiled[function](*arguments)

    def _fly(self, commands: np.ndarray, which: Flags) -> None:
        blocks, limit = self._flying, self._env.largest_action
        self._call(command, which, commands, limit, self._commands, self._changes, blocks.commanded)
        given = self._generators, which, self._paths, self._ticks, DECISION_TICKS
        self._fly_blocks(blocks, len(blocks), *given)
        self._look(which)

    def _begin(self, which: list[int], seeds: Sequence[int | None] | None) -> None:
        places = _places(which)
        count = 1 + max((block for block, _ in places.values()), default=-1)
        if count > len(self._settling):
            self._settling = Blocks(count, self._like)
        settling = self._settling
        generators = generator_list([np_random(0)[0]] * (count * WIDTH))
        flying = np.zeros(count * WIDTH, dtype=np.bool_)
        still = np.zeros((count * WIDTH, 1))
        for i, (block, lane) in places.items():
            n = WIDTH * block + lane
            generators[n] = self._hover(i, None if seeds is None else seeds[i], block, lane)
            flying[n], still[n] = True, self._paths[i, 0]
        given = generators, flying, still, np.zeros(len(flying), np.int64), SETTLE_TICKS
        self._fly_blocks(settling, count, *given)
        for i, (block, lane) in places.items():
            self._flying.take(i // WIDTH, lane, settling, block)
        started = np.zeros(self.num_envs, dtype=np.bool_)
        started[which] = True
        self._ticks[which], self._commands[which], self._changes[which] = 0, 0.0, 0.0
        states = estimates_of(self._flying.filters, self.num_envs)
        for i in which:
            self._views[i].restart(states[i])
        self._look(started)
        for name in ("reward_tracking", "reward_change", "lost"):
            self._values[name][which] = 0

    def _hover(self, i: int, seed: int | None, block: int, lane: int) -> np.random.Generator:
        """Draw an episode and let its vehicle hover at the start, in a lane of the blocks that
        settle; return the generator.
        """
        if not self._seeded[i] or seed is not None:
            self._generators[i], self._seeded[i] = np_random(seed)[0], True
        generator: np.random.Generator = self._generators[i]
        self._env.np_random = generator
        self._distance[i], loop, self._paths[i] = self._env.hover()
        self._settling.put(block, slice(lane, lane + 1), loop)
        self._values["fan_motion"][i] = self._env.fan_motion
        return generator

    def _look(self, which: Flags) -> None:
        """Write frames and values of some environments, as ``FanTrackingEnv`` has them."""
        blocks, view, frames = self._flying, self._env.view, self._seen
        height, moves = self._env.fan.height, (self._commands, self._changes)
        episodes = which, self._ticks, self._paths, self._distance
        self._call(look, *episodes, height, *moves, *blocks.seen, frames, self._table)
        if view.is_plain:
            return
        if view.is_of_a_frame:
            self._frames[which] = view.of_frames(frames[which])
            return
        states = estimates_of(blocks.filters, self.num_envs)
        for i in np.flatnonzero(which).tolist():
            self._frames[i] = self._views[i].of(frames[i], states[i], int(self._ticks[i]))


_reward_terms = compiled(reward_terms)


@compiled
def command(
    which: Flags, wanted: Array, limit: float, commands: Array, changes: Array, setpoint: Array
) -> None:
    """Write the commands (n,) m/s of the environments ``which``, within ``limit``, their changes,
    and the velocities (blocks, WIDTH) to fly at.
    """
    for n in np.flatnonzero(which):
        value = min(max(wanted[n, 0], -limit), limit)
        changes[n], commands[n] = value - commands[n], value
        setpoint[n // WIDTH, n % WIDTH] = value


@compiled_without_gil
def look(
    which: Flags,
    ticks: np.ndarray,
    paths: Array,
    distance: Array,
    height: float,
    commands: Array,
    changes: Array,
    qpos: Array,
    qvel: Array,
    external: Array,
    states: Array,
    frames: Frame,
    values: np.ndarray,
) -> None:
    """Write frames and the truth of the environments ``which`` as ``FanTrackingEnv`` has them."""
    for n in np.flatnonzero(which):
        b, lane = n // WIDTH, n % WIDTH
        p, v = qpos[b, :, lane], qvel[b, :, lane]
        broken = not (np.abs(p).max() <= _LARGEST and np.abs(v).max() <= _LARGEST)
        if broken:  # MuJoCo starts over
            p[:], v[:] = 0.0, 0.0
            p[3] = 1.0
        state = states[b, :, lane].copy()
        see(state, commands[n], frames[n])
        k, value = min(ticks[n], paths.shape[1] - 1), values[n]
        value.time, value.fan_y = ticks[n] * TICK, paths[n, max(k - 1, 0)]
        value.fan_velocity = (paths[n, k] - value.fan_y) / TICK
        value.y, value.offset = p[1], p[1] - value.fan_y
        value.force[:], value.torque[:] = external[b, :3, lane], external[b, 3:, lane]
        terms = _reward_terms(value.offset, changes[n])
        value.reward_tracking, value.reward_change = terms
        # written such that a number that is not finite counts as lost
        value.lost = broken or not (
            is_healthy(state, v)
            and 1.0 - 2.0 * (p[4] * p[4] + p[5] * p[5]) >= UPRIGHT
            and abs(value.offset) <= LOST_OFFSET
            and abs(p[0] - distance[n]) <= AWAY
            and abs(p[2] - height) <= AWAY
        )


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
