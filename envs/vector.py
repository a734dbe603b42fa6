"""Many environments of a task in one process: each flies its own loop, and one compiled call writes
the observations and rewards of all.
"""

import inspect
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from ..dynamics.motion import Array
from ..runtime.compiled import specialised
from ..runtime.errors import InputError, unknown_name
from .fan_tracking import FanTrackingEnv
from .observing import Episodes, Flags, Motion
from .task import Frame, Task
from .untimed import Untimed

Infos = dict[str, Any]
# a task's hooks for users; ``look`` writes observation, terms of the reward and ``lost``
_HOOKS = ("make_loop", "draw_loop", "hover", "fly")


class TaskVectorEnv(gym.vector.VectorEnv[Frame, Frame, NDArray[Any]]):
    """``num_envs`` environments side by side, each bit for bit the single one with its seed.

    ``reset(seed=s)`` seeds them with s, s + 1, ...; a list gives each its own. After an episode the
    next one starts at the following step, whose action is ignored (``AutoresetMode.NEXT_STEP``, the
    default), or within the same step (``AutoresetMode.SAME_STEP``). There ``infos["final_obs"]``
    and ``infos["final_info"]`` hold the episode's end, as in Gymnasium's own vector environments.
    Each entry of ``infos`` is an array with a row for each environment.

    Args:
        num_envs: number of environments.
        max_episode_steps: decisions until an episode is truncated; default: those of 20 s.
        threads: number of threads, without a change of the results. MuJoCo gains little by
            threads: its step is called through Python.
        autoreset_mode: ``NEXT_STEP`` or ``SAME_STEP``, of ``gymnasium.vector.AutoresetMode`` or its
            value as text.
        task: class of the environments.
        **kwargs: arguments of ``task``.

    Raises:
        InputError: ``num_envs`` or ``threads`` is not positive, the mode is another, or ``task``
            refuses an argument. Also a ``task`` with its own ``step``, ``reset``, ``_get_obs`` or
            any other method of ``Task`` outside ``called``.
    """

    # methods of ``Task`` whose overrides hold in every environment here
    called: ClassVar[frozenset[str]] = frozenset(
        {
            # construction, start of an episode, flight of a decision
            *("_see_by", "declared", "tuning", "make_loop", "loop", "take_loop", "reference"),
            *("_begin", "draw_loop", "hover", "refuse_draws", "fly", "decisions"),
            *("unit_of_actions", "render", "close"),
            # for controllers of single environments alone
            *("briefing", "_truth"),
        }
    )

    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int | None = None,
        threads: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        task: type[Task] = FanTrackingEnv,
        **kwargs: Any,
    ) -> None:
        steps = task.decisions() if max_episode_steps is None else max_episode_steps
        counts = {"num_envs": num_envs, "max_episode_steps": steps, "threads": threads}
        for name, value in counts.items():
            if value < 1:
                raise InputError(f"{task.name}: {name} must be at least 1, got {value}")
        self.task, self.autoreset_mode = task, _mode(autoreset_mode, task.name)
        self.num_envs, self.max_episode_steps = num_envs, steps
        self.threads = min(threads, num_envs)
        self.envs = self._make_envs(kwargs)
        first = self.envs[0]
        self._refuse_uncalled(first)
        self.metadata = {**first.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = first.render_mode
        self.single_action_space = first.action_space
        self.single_observation_space = first.observation_space
        self.action_space = gym.vector.utils.batch_space(first.action_space, num_envs)
        self.observation_space = gym.vector.utils.batch_space(first.observation_space, num_envs)
        self._decisions = np.zeros(num_envs, dtype=np.int64)  # since the episode's start
        self._begun = np.zeros(num_envs, dtype=np.bool_)
        self._over = np.zeros(num_envs, dtype=np.bool_)  # episodes that ended at the last step
        self._episodes = Episodes.alike(num_envs, first.action_size, first.path, first.reference)
        self._view = first.view.of_many(num_envs)
        self._frames = np.zeros(self.observation_space.shape or (), dtype=np.float32)
        # frames before their view
        self._whole = np.zeros((num_envs, len(first.limits)), dtype=np.float32)
        self._table = np.zeros(num_envs, dtype=first.values)
        self._labels = np.zeros(num_envs, dtype=object)
        self._all = np.ones(num_envs, dtype=np.bool_)
        self._pool: ThreadPoolExecutor | None = None
        self._compiled: dict[Any, Callable[..., None]] = {}
        self._motion = self._make_memory()

    @property
    def _values(self) -> Infos:
        """Entries of ``infos``, as views."""
        task = self.envs[0]
        values: Infos = {name: self._table[name] for name in task.values.names or ()}
        values |= {"observation": self._whole, "command": self._episodes.commands}
        return values | {task.label: self._labels}

    def __getstate__(self) -> dict[str, Any]:
        """Return all but threads and compiled code, for a copy."""
        return self.__dict__ | {"_pool": None, "_compiled": {}}

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Frame, Infos]:
        """Start an episode in every environment, or in those of ``options["reset_mask"]``
        (num_envs,), booleans.

        Raises:
            InputError: a list of seeds, or a mask, of another length, or another option.
        """
        if unknown := [name for name in options or {} if name != "reset_mask"]:
            raise unknown_name(
                "option", str(unknown[0]), ("reset_mask",), f"{self.task.name}: reset"
            )
        seeds = (
            [None if seed is None else seed + i for i in range(self.num_envs)]
            if seed is None or isinstance(seed, int | np.integer)
            else list(seed)
        )
        mask = np.asarray((options or {}).get("reset_mask", self._all))
        if len(seeds) != self.num_envs or mask.shape != (self.num_envs,) or mask.dtype != np.bool_:
            raise InputError(
                f"{self.task.name}: reset: expected {self.num_envs} seeds, and booleans in "
                f"reset_mask; got {len(seeds)} and {mask!r}"
            )
        self._start(mask, seeds)
        self._over[mask] = False
        return self._frames.copy(), self._infos(self._all)

    def step(self, actions: Frame) -> tuple[Frame, NDArray[np.float64], Flags, Flags, Infos]:
        """Fly a decision in every environment with actions (num_envs, n) of ``action_space``.

        Raises:
            InputError: another shape, or a number is not finite; nothing flies.
        """
        task, env = self.task, self.envs[0]
        wanted, shape = np.asarray(actions, dtype=np.float64), self._episodes.commands.shape
        if wanted.shape != shape or not np.all(np.isfinite(wanted)):
            raise InputError(
                f"{task.name}: actions must be finite numbers in {env.unit_of_actions}, shape "
                f"{shape}, got {wanted!r}"
            )
        if not self._begun.all():
            raise InputError(f"{task.name}: call reset before step")
        flying = ~self._over
        limit, commands = env.largest_action, self._episodes.commands
        given = np.clip(env.action_scale * wanted, -limit, limit)
        self._episodes.changes[flying] = (given - commands)[flying]
        commands[flying] = given[flying]
        self._fly(flying)
        self._look(flying)
        self._decisions += 1
        if self._over.any():
            self._start(self._over)
        values, truncated = self._values, self._decisions >= self.max_episode_steps
        lost, rewards = values["lost"].copy(), values["reward_tracking"] + values["reward_change"]
        over = lost | truncated
        if self.autoreset_mode is AutoresetMode.NEXT_STEP or not over.any():
            self._over = over
            return self._frames.copy(), rewards, lost, truncated, self._infos(self._all)
        ended, final = self._infos(over), np.full(self.num_envs, None, dtype=object)
        for i in np.flatnonzero(over):
            final[i] = self._frames[i].copy()
        self._start(over)
        masks = {"_final_obs": over.copy(), "_final_info": over.copy()}
        infos = self._infos(self._all) | {"final_obs": final, "final_info": ended} | masks
        return self._frames.copy(), rewards, lost, truncated, infos

    def _start(self, which: Flags, seeds: Sequence[int | None] | None = None) -> None:
        """Start an episode in the environments of ``which`` (num_envs,)."""
        started = np.flatnonzero(which).tolist()
        self._begun[which] = False
        _, _, _, _, *moves = self._episodes
        for numbers in (self._decisions, self._episodes.ticks, *moves):
            numbers[which] = 0
        self._hover(started, seeds or [None] * self.num_envs)
        self._view.restart(which, self._states)
        self._look(which)
        for name in ("reward_tracking", "reward_change", "lost"):  # decided by steps
            self._table[name][which] = 0
        self._begun[which] = True

    def _refuse_uncalled(self, env: Task) -> None:
        """Refuse an environment's own methods outside ``called``."""
        for name, own in inspect.getmembers_static(Task):
            method = callable(own) or isinstance(own, property | classmethod | staticmethod)
            if name.startswith("__") or name in self.called or not method:
                continue
            if inspect.getattr_static(env, name) is not own:
                kind, many = type(env).__qualname__, type(self).__name__
                held = ", ".join(n for n in _HOOKS if n in self.called)
                raise InputError(
                    f"{many}: task {kind} overrides {name}, which {many} never calls; "
                    f"gym.vector.SyncVectorEnv calls {name}, and {many} calls {held} and look"
                )

    def _make_envs(self, kwargs: dict[str, Any]) -> list[Task]:
        """Return the environments."""
        return [self.task(**kwargs) for _ in range(self.num_envs)]

    def _make_memory(self) -> Motion:
        """Make the memory of ``_fly``; return the motion of all."""
        return Motion.zeros(self.num_envs)

    def _draw(self, i: int, env: Task) -> None:
        """Write down an environment's new episode."""
        given, labels = self._episodes, self._labels
        if given.paths.shape[1] != len(env.path) or given.references.shape[1] != len(env.reference):
            self._episodes = given = given._replace(
                paths=np.zeros((self.num_envs, *env.path.shape)),
                references=np.zeros((self.num_envs, *env.reference.shape)),
            )
        given.paths[i], given.references[i] = env.path, env.reference
        given.distance[i], labels[i] = env.distance, env.drawn_label

    def _hover(self, which: list[int], seeds: Sequence[int | None]) -> None:
        """Draw an episode of some environments, and let their vehicles hover at its start."""
        self._spread(lambda i: self.envs[i].reset(seed=seeds[i]), which)
        for i in which:
            self._draw(i, self.envs[i])
            self._see(i)

    def _fly(self, which: Flags) -> None:
        """Fly a decision in some environments at their commands."""
        flying = np.flatnonzero(which).tolist()

        def fly(i: int) -> None:
            self.envs[i].command[:] = self._episodes.commands[i]
            self.envs[i].fly()

        with Untimed():
            self._spread(fly, flying)
        for i in flying:
            self._see(i)

    def _see(self, i: int) -> None:
        """Write the motion of environment ``i``."""
        loop, episodes = self.envs[i].loop, self._episodes
        for kept, shown in zip(self._motion, loop.shown, strict=True):
            kept[i] = shown[0]
        episodes.ticks[i], episodes.broken[i] = loop.ticks, loop.was_reset

    @property
    def _states(self) -> Array:
        """Estimated states (num_envs, 20)."""
        return self._rows(self._motion.state)

    def _rows(self, values: Array) -> Array:
        """Return values (rows, size, lanes) of the vehicles as (num_envs, size)."""
        rows: Array = np.moveaxis(values, 1, 2).reshape(-1, values.shape[1])
        return rows[: self.num_envs]

    def _look(self, which: Flags) -> None:
        """Write frames and values of some environments by their task's ``look``."""
        given = self._episodes, self._motion, self._whole, self._table
        self._call(self.task.look, which, *given)
        self._frames[which] = self._view.of(which, self._whole, self._states)
        if self.render_mode == "human":
            self.render()

    def _call(self, function: Callable[..., None], *arguments: Any) -> None:
        """Call a compiled function, always with arguments of the same types."""
        if function not in self._compiled:
            self._compiled[function] = specialised(function, *arguments)
        self._compiled[function](*arguments)

    def _spread(self, work: Callable[[int], object], which: Sequence[int]) -> None:
        """Call ``work`` with each number, once: each free thread takes the next number."""
        if min(self.threads, len(which)) < 2:
            for n in which:
                work(n)
            return
        if self._pool is None:
            self._pool = ThreadPoolExecutor(self.threads)
        working = [self._pool.submit(work, n) for n in which]
        wait(working)
        for each in working:
            each.result()

    def _infos(self, which: Flags) -> Infos:
        """Return the ``infos`` of some environments as Gymnasium's vector environments do: an array
        and a mask for each entry; zeros, or None, outside the mask.
        """
        infos: Infos = {}
        for name, values in self._values.items():
            kept = values.copy()
            kept[~which] = None if kept.dtype == object else 0
            infos[name], infos[f"_{name}"] = kept, which.copy()
        return infos

    def render(self) -> tuple[Any, ...]:
        """Return a picture (height, width, 3) of each environment."""
        return tuple(env.render() for env in self.envs)

    def close_extras(self, **kwargs: Any) -> None:
        """Close all environments and end the threads."""
        if self._pool is not None:
            self._pool.shutdown()
        for env in self.envs:
            env.close()


def _mode(given: AutoresetMode | str, task: str) -> AutoresetMode:
    known = AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP
    for mode in known:
        if given in (mode, mode.value, mode.name):
            return mode
    raise InputError(
        f"{task}: autoreset_mode must be {' or '.join(m.name for m in known)} of "
        f"gymnasium.vector.AutoresetMode, got {given!r}"
    )
