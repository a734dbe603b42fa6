"""Many environments of a task in the lanes of a vector unit."""

from collections import deque
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from gymnasium.utils.seeding import np_random
from numba import typed, typeof

from ...dynamics.motion import Array
from ...estimator.ukf_lanes import new_work, step_address
from ...runtime.compiled import compiled
from ...runtime.errors import InputError, unknown_name
from ...runtime.vector_lanes import WIDTH
from ..closed_loop import ClosedLoop
from ..fan_tracking import FanTrackingEnv
from ..fan_tracking_2d import FanTracking2DEnv
from ..observing import Flags, Motion
from ..plant import TICK
from ..task import SETTLE_TICKS, Task, true_motion
from ..vector import TaskVectorEnv
from ..wind.field import Sum
from ..wind_tasks import WindHoverEnv, WindTrajectoryEnv
from .flight import LoopBlocks, fly_blocks

_LARGEST = 1e10  # beyond it MuJoCo starts over
_GENERATOR = typeof(np.random.default_rng(0))


class TaskLanes(TaskVectorEnv):
    """``TaskVectorEnv`` without MuJoCo: plant, filter and flight loop side by side, an environment
    in each lane of a vector unit.

    An episode equals the MuJoCo environment's with its seed, to rounding: the same draws of the
    same generators and the same equations in the same order. MuJoCo's integrator is written out
    for the one free body. Bits depend on neither ``num_envs`` nor ``threads``. Observation, reward,
    ``infos`` and autoreset modes are those of ``TaskVectorEnv``.

    All scenarios fly, with any ``vehicle``, ``truth``, ``fan``, ``settings``, ``fan_path``,
    ``gains``, view and compiled ``winds``. Effects beyond the rigid body's (mass, inertia,
    com_offset) are refused, declared or not. So are ``estimator="constant-gain"``, ``render_mode``,
    ``stages``, winds of one's own, and a task with its own ``fly``, ``draw_loop`` or ``_begin``.
    One environment draws the episodes of all: an override of ``hover`` or ``make_loop`` must keep
    nothing from episode to episode.

    Args:
        num_envs: number of environments.
        *args: as of ``TaskVectorEnv``.
        **kwargs: likewise.

    Raises:
        InputError: lanes or ``TaskVectorEnv`` refuse an argument.
    """

    called = TaskVectorEnv.called - {"_begin", "draw_loop", "fly"}

    def _make_envs(self, kwargs: dict[str, Any]) -> list[Task]:
        """Return one environment: a model of all, never flown."""
        return [self.task(**kwargs)]

    def _make_memory(self) -> Motion:
        """Make the memory of ``_fly``; return the motion of all."""
        env = self.envs[0]
        self._like = env.make_loop(env.truth, env.fan)
        _refuse(env, self._like)
        # each environment's own; before its first reset a placeholder
        self._generators = generator_list([np.random.default_rng(0)] * self.num_envs)
        self._step = step_address()
        self._flying = LoopBlocks(-(-self.num_envs // WIDTH), self._like)
        self._settling = LoopBlocks(0, self._like)
        self._works: deque[np.ndarray] = deque()
        self._seeded = np.zeros(self.num_envs, dtype=np.bool_)
        self._blowing: list[Sum] = [Sum()] * self.num_envs  # keeps the winds at ``_calls``
        self._lay_calls()
        return self._flying.motion

    def _lay_calls(self) -> None:
        """Write down the addresses (n, winds, 2) and numbers (n,) of the environments' winds."""
        most = max(len(winds.calls) for winds in self._blowing)
        self._calls = np.zeros((self.num_envs, most, 2), dtype=np.int64)
        self._winds = np.array([len(winds.calls) for winds in self._blowing])
        for i, winds in enumerate(self._blowing):
            self._calls[i, : len(winds.calls)] = winds.calls

    def truth(self) -> dict[str, Array]:
        """Return an oracle's true motion and the flight loop's integral, a row an environment."""
        loops, vehicle = self._flying.loops, self.envs[0].vehicle
        values = *self._motion[:2], loops["plant"]["speeds"], loops["flight"]["sum"]
        rows = zip(*map(self._rows, values), strict=True)
        known = [true_motion(vehicle, *row) for row in rows]
        return {name: np.array([one[name] for one in known]) for name in known[0]}

    def late(self) -> Array:
        """Return the delay (n,) s of the flight loop's answer: actuators and pose."""
        plant = self._flying.loops["plant"]
        ticks: Array = plant["actuator_late"] + plant["pose_late"]
        return TICK * ticks.ravel()[: self.num_envs]

    def __getstate__(self) -> dict[str, Any]:
        state = super().__getstate__()
        for name in ("_like", "_motion", "_settling", "_works"):
            del state[name]
        memory = self._flying.loops, self._flying.filters
        return state | {"_generators": list(self._generators), "_flying": memory}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._motion = self._make_memory()
        self._generators = generator_list(state["_generators"])
        self._seeded, self._blowing = state["_seeded"], state["_blowing"]
        self._flying.loops[...], self._flying.filters[...] = state["_flying"]
        self._lay_calls()

    def _fly_blocks(self, blocks: LoopBlocks, slots: np.ndarray, ticks: int) -> None:
        """Fly blocks with the vehicles of ``slots`` (lanes,) in their lanes; -1: none. Each thread
        has a record of its own for the filters in hand.
        """
        count = len(slots) // WIDTH
        parts = 1 if self.threads == 1 else count
        given = self._generators, slots, self._episodes, self._calls, self._winds, ticks

        def fly(part: int) -> None:
            try:
                work = self._works.pop()
            except IndexError:
                work = new_work(self._like.ukf.record)
            try:
                first, last = part * count // parts, (part + 1) * count // parts
                memory = *blocks.addresses, work.ctypes.data, self._step, self._like.jet_table
                flown = blocks.fields, blocks.motion, *given
                kind = self._like.noise_size, self.envs[0].accelerates
                self._call(fly_blocks, first, last, *memory, *flown, *kind)
            finally:
                self._works.append(work)

        self._spread(fly, range(parts))

    def _fly(self, which: Flags) -> None:
        slots = np.full(len(self._flying) * WIDTH, -1)
        slots[: self.num_envs][which] = np.flatnonzero(which)
        self._fly_blocks(self._flying, slots, self.envs[0].decision_ticks)
        self._call(start_over, which, *self._motion[:2], self._episodes.broken)

    def _hover(self, which: list[int], seeds: Sequence[int | None]) -> None:
        env, vehicles = self.envs[0], {}
        for i in which:
            if not self._seeded[i] or seeds[i] is not None:
                self._generators[i], self._seeded[i] = np_random(seeds[i])[0], True
            env.np_random = self._generators[i]
            env.draw_loop()
            vehicles[i] = env.loop, env.drawn
        for _ in range(env.draws):
            self._settle(which, vehicles)
            drawn = np.isin(np.arange(self.num_envs), which)
            self._call(start_over, drawn, *self._motion[:2], self._episodes.broken)
            seen = self._episodes, self._motion, self._whole, self._table
            self._call(self.task.look, drawn, *seen)
            which = np.flatnonzero(drawn & self._table["lost"]).tolist()
            if not which:
                return
        env.refuse_draws()

    def _settle(self, which: list[int], vehicles: dict[int, Any]) -> None:
        """Draw episodes for drawn vehicles, and let these hover at the start: each in its own lane,
        of the first block with that lane free.
        """
        env, taken, places = self.envs[0], [0] * WIDTH, {}
        for i in which:
            places[i] = taken[i % WIDTH], i % WIDTH
            taken[i % WIDTH] += 1
        count = max(taken)
        if count > len(self._settling):
            self._settling = LoopBlocks(count, self._like)
        settling, slots = self._settling, np.full(count * WIDTH, -1)
        for i, (block, lane) in places.items():
            env.np_random = self._generators[i]
            env.take_loop(*vehicles[i])
            env.hover()
            self._draw(i, env)
            self._blowing[i] = env.loop.winds
            settling.put(block, slice(lane, lane + 1), env.loop)
            slots[WIDTH * block + lane], self._episodes.ticks[i] = i, -SETTLE_TICKS
            self._episodes.commands[i] = 0.0
        self._lay_calls()
        self._fly_blocks(settling, slots, SETTLE_TICKS)
        for i, (block, lane) in places.items():
            self._flying.take(i // WIDTH, lane, settling, block)


def generator_list(generators: Sequence[np.random.Generator]) -> Any:
    """Return generators as a typed list, at no cost a generator in compiled code."""
    listed = typed.List.empty_list(_GENERATOR)
    for generator in generators:
        listed.append(generator)
    return listed


@compiled
def start_over(which: Flags, position: Array, velocity: Array, broken: Flags) -> None:
    """Let environments with numbers too large or not finite start over, as MuJoCo does."""
    for n in np.flatnonzero(which):
        b, lane = n // WIDTH, n % WIDTH
        p, v = position[b, :, lane], velocity[b, :, lane]
        broken[n] = not (np.abs(p).max() <= _LARGEST and np.abs(v).max() <= _LARGEST)
        if broken[n]:
            p[:], v[:] = 0.0, 0.0
            p[3] = 1.0


def _refuse(env: Task, loop: ClosedLoop) -> None:
    """Refuse arguments without a flight in lanes."""
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
        (Sum(*(getattr(env, "winds", None) or ())).own, "has no winds of your own"),
    ):
        if wrong:
            raise InputError(f"{env.name}: plant='lanes' {what}; plant='mujoco' does it")


PLANTS: dict[str, type[TaskVectorEnv]] = {"mujoco": TaskVectorEnv, "lanes": TaskLanes}


def make_vector(
    task: type[Task], num_envs: int = 1, plant: str = "mujoco", **kwargs: Any
) -> TaskVectorEnv:
    """Return ``num_envs`` environments of a task side by side.

    Args:
        task: the class of its environment.
        num_envs: number of environments.
        plant: ``"mujoco"``, the reference (``TaskVectorEnv``), or ``"lanes"``, the same flight in
            the lanes of a vector unit (``TaskLanes``): several times as fast.
        **kwargs: arguments of the class.

    Raises:
        InputError: an unknown plant, or a refusal of the class.
    """
    if plant not in PLANTS:
        raise unknown_name("plant", str(plant), PLANTS, f"{task.name}: plant")
    return PLANTS[plant](num_envs, task=task, **kwargs)


make_fan_tracking_vector = partial(make_vector, FanTrackingEnv)
make_fan_tracking_2d_vector = partial(make_vector, FanTracking2DEnv)
make_wind_hover_vector = partial(make_vector, WindHoverEnv)
make_wind_trajectory_vector = partial(make_vector, WindTrajectoryEnv)
