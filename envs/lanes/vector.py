"""Many environments of a task in the lanes of a vector unit."""

from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import typed, typeof

from ...controllers.flight import BESIDE
from ...dynamics.motion import Array
from ...estimator.ukf_lanes import new_work, step_address
from ...runtime.compiled import compiled, specialised
from ...runtime.errors import InputError
from ...runtime.vector_lanes import WIDTH
from ..closed_loop import ClosedLoop
from ..definition import TaskDefinition
from ..plant import TICK
from ..state import Flags, gather
from ..truth import true_motion
from ..vector import SETTLE_TICKS, TaskVectorEnv
from ..wind.field import Sum
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
    ``gains``, action, observation and compiled ``winds``. Effects beyond the rigid body's (mass,
    inertia, com_offset) are refused, declared or not. So are ``estimator="constant-gain"``,
    ``render_mode``, ``stages``, winds of one's own, and a task that ``mixes`` scenarios.

    Args:
        num_envs: number of environments.
        *args: as of ``TaskVectorEnv``.
        **kwargs: likewise.

    Raises:
        InputError: lanes or ``TaskVectorEnv`` refuse an argument.
    """

    def _make_memory(self) -> None:
        self._like = self.task.make_loop(self.task.truth, self.task.fan)
        _refuse(self.task, self._like)
        # the loop of which all are drawn; the next draw overwrites it
        self._kept = [{self.task.scenario: self._like}] * self.num_envs
        self._typed = generator_list(self.generators)
        self._step = step_address()
        self._flying = LoopBlocks(-(-self.num_envs // WIDTH), self._like)
        self._settling = LoopBlocks(0, self._like)
        self._works: deque[np.ndarray] = deque()
        self._blowing: list[Sum] = [Sum()] * self.num_envs  # keeps the winds at ``_calls``
        self._lay_calls()

    def _lay_calls(self) -> None:
        """Write down the addresses (n, winds, 2) and numbers (n,) of the environments' winds."""
        most = max(len(winds.calls) for winds in self._blowing)
        self._calls = np.zeros((self.num_envs, most, 2), dtype=np.int64)
        self._winds = np.array([len(winds.calls) for winds in self._blowing])
        for i, winds in enumerate(self._blowing):
            self._calls[i, : len(winds.calls)] = winds.calls

    def _call(self, function: Any, *arguments: Any) -> Any:
        return specialised(function, *arguments)(*arguments)

    def truth(self) -> dict[str, Array]:
        """Return an oracle's true motion and the flight loop's integral, a row an environment."""
        loops, vehicle = self._flying.loops, self.task.vehicle
        values = *self._flying.motion[:2], loops["plant"]["speeds"], loops["flight"]["sum"]
        rows = zip(*map(self._rows, values), strict=True)
        known = [true_motion(vehicle, *row) for row in rows]
        return {name: np.array([one[name] for one in known]) for name in known[0]}

    def _rows(self, values: Array) -> Array:
        """Return values (rows, size, lanes) of the vehicles as (num_envs, size)."""
        rows: Array = np.moveaxis(values, 1, 2).reshape(-1, values.shape[1])
        return rows[: self.num_envs]

    def late(self) -> Array:
        """Return the delay (n,) s of the flight loop's answer: actuators and pose."""
        plant = self._flying.loops["plant"]
        ticks: Array = plant["actuator_late"] + plant["pose_late"]
        return TICK * ticks.ravel()[: self.num_envs]

    def __getstate__(self) -> dict[str, Any]:
        state = super().__getstate__()
        for name in ("_like", "_kept", "_settling", "_works", "_calls", "_typed"):
            del state[name]
        return state | {"_flying": (self._flying.loops, self._flying.filters)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        super().__setstate__(state)
        self._make_memory()
        self._blowing = state["_blowing"]
        self._flying.loops[...], self._flying.filters[...] = state["_flying"]
        self._lay_calls()

    def _fly_blocks(self, blocks: LoopBlocks, slots: np.ndarray, ticks: int, kind: int) -> None:
        """Fly blocks with the vehicles of ``slots`` (lanes,) in their lanes; -1: none. Each thread
        has a record of its own for the filters in hand.
        """
        count = len(slots) // WIDTH
        parts = 1 if self.threads == 1 else count
        flown = self.task.flown
        given = self._typed, slots, self.episodes, self._calls, self._winds, ticks
        how = self._like.noise_size, flown.follows, kind, flown.moves, flown.places

        def fly(part: int) -> None:
            try:
                work = self._works.pop()
            except IndexError:
                work = new_work(self._like.ukf.record)
            try:
                first, last = part * count // parts, (part + 1) * count // parts
                memory = *blocks.addresses, work.ctypes.data, self._step, self._like.jet_table
                self._call(
                    fly_blocks, first, last, *memory, blocks.fields, blocks.motion, *given, *how
                )
            finally:
                self._works.append(work)

        self._spread(fly, range(parts))

    def _fly(self, which: Flags) -> None:
        slots = np.full(len(self._flying) * WIDTH, -1)
        slots[: self.num_envs][which] = np.flatnonzero(which)
        self._fly_blocks(self._flying, slots, self.task.decision_ticks, self.task.flown.kind)
        self._start_over(which)

    def _start_over(self, which: Flags) -> None:
        """Let environments with numbers too large start over, and gather the state of all."""
        motion, episodes, s = self._flying.motion, self.episodes, self.state
        self._call(start_over, which, *motion[:2], episodes.broken)
        self._call(gather, 0, self.num_envs, 0, motion, episodes, s.rows, s.flying)

    def _hover(self, which: list[int]) -> None:
        """Let drawn vehicles hover at the start, each in its own lane of a block of others."""
        taken, self._places = [0] * WIDTH, {}
        for i in which:
            self._places[i] = taken[i % WIDTH], i % WIDTH
            taken[i % WIDTH] += 1
        if max(taken) > len(self._settling):
            self._settling = LoopBlocks(max(taken), self._like)
        super()._hover(which)

    def _place(self, i: int, loop: ClosedLoop) -> None:
        block, lane = self._places[i]
        self._settling.put(block, slice(lane, lane + 1), loop)
        self._blowing[i], self.episodes.ticks[i] = loop.winds, -SETTLE_TICKS
        self._typed[i] = self.generators[i]

    def _settle(self, which: list[int]) -> None:
        slots = np.full(len(self._settling) * WIDTH, -1)
        for i in which:
            block, lane = self._places[i]
            slots[WIDTH * block + lane] = i
        self._lay_calls()
        self._fly_blocks(self._settling, slots, SETTLE_TICKS, BESIDE)
        for i in which:
            block, lane = self._places[i]
            self._flying.take(i // WIDTH, lane, self._settling, block)
        self._start_over(np.isin(np.arange(self.num_envs), which))


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


def _refuse(task: TaskDefinition, loop: ClosedLoop) -> None:
    """Refuse arguments without a flight in lanes."""
    record = loop.record[0]
    called = any(
        record[part][f"{kind}_count"]
        for part in ("plant", "filter")
        for kind in ("wrench", "rotor", "sensing")
    )
    for wrong, what in (
        (task.render_mode is not None, f"is not drawn, got render_mode={task.render_mode!r}"),
        (task.estimator != "ukf", f"flies the full filter 'ukf', got estimator={task.estimator!r}"),
        (called, "flies no effects but mass, inertia and com_offset, and the vehicle has others"),
        (task.stages, "runs no stages of your own"),
        (task.mixes, "flies one scenario"),
        (Sum(*(task.winds or ())).own, "has no winds of your own"),
    ):
        if wrong:
            raise InputError(f"{task.name}: plant='lanes' {what}; plant='mujoco' does it")
