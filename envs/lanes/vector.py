"""Many environments of a task in the lanes of a vector unit."""

from typing import Any

import numpy as np

from ... import _core
from ...controllers.flight import BESIDE
from ...runtime.arrays import Array, Mask
from ...runtime.errors import InputError, unknown_name
from ..closed_loop import ClosedLoop
from ..definition import TaskDefinition
from ..plant import TICK
from ..truth import true_motion
from ..vector import SETTLE_TICKS, TaskVectorEnv
from ..wind.field import Sum

_AT_ONCE = 4  # blocks of vehicles that settle, a thread
PRECISIONS: dict[str, Any] = {"double": _core.LoopBlocks, "single": _core.SingleLoopBlocks}


class TaskLanes(TaskVectorEnv):
    """``TaskVectorEnv`` without MuJoCo: plant, filter and flight loop side by side, an environment
    in each lane of a vector unit.

    An episode equals the MuJoCo environment's with its seed, to rounding: the same draws of the
    same generators and the same equations in the same order. MuJoCo's integrator is written out
    for the one free body. Bits depend on neither ``num_envs`` nor ``threads``. Observation, reward,
    ``infos`` and autoreset modes are those of ``TaskVectorEnv``.

    All scenarios and effects fly, with any ``vehicle``, ``truth``, ``fan``, ``settings``,
    ``fan_path``, ``gains``, action, observation and winds of the kit. Effects and winds in Python,
    ``estimator="constant-gain"``, ``render_mode``, ``stages``, and a task that ``mixes`` scenarios
    are refused.

    Args:
        num_envs: number of environments.
        *args: as of ``TaskVectorEnv``.
        precision: ``"double"``, or ``"single"``: numbers of 32 bits, twice as many side by side.
        **kwargs: as of ``TaskVectorEnv``.

    Raises:
        InputError: lanes or ``TaskVectorEnv`` refuse an argument.
    """

    def __init__(
        self, num_envs: int = 1, *args: Any, precision: str = "double", **kwargs: Any
    ) -> None:
        if precision not in PRECISIONS:
            raise unknown_name("precision", str(precision), PRECISIONS, "precision")
        self.precision = precision
        super().__init__(num_envs, *args, **kwargs)

    def _make_memory(self) -> None:
        self._like = self.task.make_loop(self.task.truth, self.task.fan)
        _refuse(self.task)
        # one loop draws all environments; the next draw overwrites its state
        self._kept = [{self.task.scenario: self._like}] * self.num_envs
        self._lanes: int = PRECISIONS[self.precision].lanes
        self._flying = self._blocks(-(-self.num_envs // self._lanes))
        self._settling = self._blocks(0)
        self._blowing: list[Sum] = [Sum()] * self.num_envs  # keeps the winds at ``_calls``
        self._lay_calls()

    def _blocks(self, count: int) -> Any:
        """Return so many blocks of closed loops, all like one."""
        flown, like = self.task.flown, self._like.address
        places = np.asarray(flown.places, dtype=np.int64)
        try:
            return PRECISIONS[self.precision](like, count, flown.follows, flown.moves, places)
        except ValueError:
            raise _refusal(self.task, "flies no effects in Python") from None

    def _lay_calls(self) -> None:
        """Write down the addresses (n, winds, 2) and numbers (n,) of the environments' winds."""
        most = max(len(winds.calls) for winds in self._blowing)
        self._calls = np.zeros((self.num_envs, most, 2), dtype=np.int64)
        self._winds = np.array([len(winds.calls) for winds in self._blowing])
        for i, winds in enumerate(self._blowing):
            self._calls[i, : len(winds.calls)] = winds.calls

    def truth(self) -> dict[str, Array]:
        """Return an oracle's true motion and the flight loop's integral, a row an environment."""
        vehicle, names = self.task.vehicle, ("qpos", "qvel", "speeds", "sum")
        rows = zip(*(self._rows(self._flying.view(name)) for name in names), strict=True)
        motions = [true_motion(vehicle, *row) for row in rows]
        return {name: np.array([one[name] for one in motions]) for name in motions[0]}

    def _rows(self, values: Array) -> Array:
        """Return values (rows, size, lanes) of the vehicles as (num_envs, size)."""
        return np.moveaxis(values, 1, 2).reshape(-1, values.shape[1])[: self.num_envs]

    def late(self) -> Array:
        """Return the delay (n,) s of the flight loop's answer: actuators and pose."""
        ticks = self._flying.view("actuator_late") + self._flying.view("pose_late")
        return TICK * self._rows(ticks)[:, 0]

    def __getstate__(self) -> dict[str, Any]:
        state = super().__getstate__()
        for name in ("_like", "_kept", "_settling", "_calls"):
            del state[name]
        return state | {"_flying": self._flying.state()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        super().__setstate__(state)
        self._make_memory()
        self._blowing = state["_blowing"]
        self._flying.restore(state["_flying"], self._like.address)
        self._lay_calls()

    def _fly_blocks(self, blocks: Any, slots: np.ndarray, ticks: int, kind: int) -> None:
        """Fly blocks with the vehicles of ``slots`` (lanes,) in their lanes; -1: none. Each
        vehicle's normals are drawn from its own generator.
        """
        parts = 1 if self.threads == 1 else len(blocks)
        arguments = slots, self._scene, kind, ticks, self._like.noise_size, self._streams

        def fly(part: int) -> None:
            first, last = part * len(blocks) // parts, (part + 1) * len(blocks) // parts
            blocks.fly(first, last, *arguments, self._calls, self._winds)

        self._spread(fly, range(parts))

    def _fly(self, which: Mask) -> None:
        slots = np.full(len(self._flying) * self._lanes, -1)
        slots[: self.num_envs][which] = np.flatnonzero(which)
        self._fly_blocks(self._flying, slots, self.task.decision_ticks, self.task.flown.kind)
        self._flying.look(which, self._scene)

    def _hover(self, which: list[int]) -> None:
        """Let drawn vehicles hover at the start, some blocks of them at a time, each in its own
        lane of a block of others.
        """
        some = _AT_ONCE * self.threads * self._lanes
        for first in range(0, len(which), some):
            taken, self._places = [0] * self._lanes, {}
            for i in which[first : first + some]:
                self._places[i] = taken[i % self._lanes], i % self._lanes
                taken[i % self._lanes] += 1
            if max(taken) > len(self._settling):
                self._settling = self._blocks(max(taken))
            super()._hover(which[first : first + some])

    def _place(self, i: int, loop: ClosedLoop) -> None:
        block, lane = self._places[i]
        self._settling.put(block, lane, lane + 1, loop.address)
        self._blowing[i], self.episodes.ticks[i] = loop.winds, -SETTLE_TICKS

    def _settle(self, which: list[int]) -> None:
        slots = np.full(len(self._settling) * self._lanes, -1)
        for i in which:
            block, lane = self._places[i]
            slots[self._lanes * block + lane] = i
        self._lay_calls()
        self._fly_blocks(self._settling, slots, SETTLE_TICKS, BESIDE)
        for i in which:
            block, lane = self._places[i]
            self._flying.take(i // self._lanes, lane, self._settling, block)
        self._flying.look(np.isin(np.arange(self.num_envs), which), self._scene)


def _refusal(task: TaskDefinition, what: str) -> InputError:
    return InputError(f"{task.name}: plant='lanes' {what}; plant='mujoco' does it")


def _refuse(task: TaskDefinition) -> None:
    """Refuse arguments without a flight in lanes."""
    for wrong, what in (
        (task.render_mode is not None, f"is not drawn, got render_mode={task.render_mode!r}"),
        (task.estimator != "ukf", f"flies the full filter 'ukf', got estimator={task.estimator!r}"),
        (task.stages, "runs no stages of your own"),
        (task.mixes, "flies one scenario"),
        (Sum(*(task.winds or ())).own, "has no winds of your own"),
    ):
        if wrong:
            raise _refusal(task, what)
