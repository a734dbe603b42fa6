"""Many environments of a task in one process: the one implementation of its flight. A single
environment is a vector of one.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from .. import _core
from ..runtime.arrays import Array, Mask, Single
from ..runtime.errors import InputError, unknown_name
from .closed_loop import ClosedLoop
from .definition import TaskDefinition
from .state import Episodes, Start, State
from .untimed import Untimed

Infos = dict[str, Any]
_COUNTS = ("no", "one", "two", "three", "four")
SETTLE_TICKS = 300  # the filter settles before an episode starts


class JudgedStep(NamedTuple):
    """A task's answer to the state of n worlds."""

    observations: Single  # (n, k) as the agent sees them
    rewards: Array  # (n,)
    lost: Mask  # (n,)
    values: Infos  # entries of ``info``, (n, ...)


class TaskVectorEnv(gym.vector.VectorEnv[Single, Single, NDArray[Any]]):
    """``num_envs`` environments side by side, each bit for bit the single one with its seed.

    ``reset(seed=s)`` seeds them with s, s + 1, ...; a list gives each its own. After an episode the
    following step starts the next episode and ignores its action (``AutoresetMode.NEXT_STEP``, the
    default). With ``AutoresetMode.SAME_STEP`` the same step does, and ``infos["final_obs"]`` and
    ``infos["final_info"]`` hold the episode's end, as in Gymnasium's vector environments.
    Each entry of ``infos`` is an array with a row for each environment.

    Args:
        num_envs: number of environments.
        max_episode_steps: decisions until an episode is truncated; default: those of
            ``episode_s``.
        threads: number of threads, without a change of the results.
        autoreset_mode: ``NEXT_STEP`` or ``SAME_STEP``, of ``gymnasium.vector.AutoresetMode`` or its
            value as text.
        task: class of the task, or a task that is made.
        **kwargs: arguments of the class.

    Raises:
        InputError: ``num_envs`` or ``threads`` is not positive, the mode is another, or ``task``
            refuses an argument.
    """

    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int | None = None,
        threads: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        *,
        task: type[TaskDefinition] | TaskDefinition,
        **kwargs: Any,
    ) -> None:
        self.task = task = task if isinstance(task, TaskDefinition) else task(**kwargs)
        steps = task.max_decisions if max_episode_steps is None else max_episode_steps
        counts = {"num_envs": num_envs, "max_episode_steps": steps, "threads": threads}
        for name, value in counts.items():
            if value < 1:
                raise InputError(f"{task.name}: {name} must be at least 1, got {value}")
        self.autoreset_mode = _mode(autoreset_mode, task.name)
        self.num_envs, self.max_episode_steps = num_envs, steps
        self.threads = min(threads, num_envs)
        self.metadata = {**task.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = task.render_mode
        self.single_action_space = task.action_space
        self.single_observation_space = task.observation_space
        self.action_space = gym.vector.utils.batch_space(task.action_space, num_envs)
        self.observation_space = gym.vector.utils.batch_space(task.observation_space, num_envs)
        self.episodes = Episodes.zeros(num_envs, task.action_size)
        # each environment's own generator; before its first reset a placeholder
        self.generators: list[np.random.Generator] = [np.random.default_rng(0)] * num_envs
        self._streams = _core.Streams(num_envs)
        self.state = State(self.episodes, self.generators)
        self._look()
        self._seeded, self._begun, self._over = np.zeros((3, num_envs), dtype=np.bool_)
        self._fresh = np.zeros(num_envs, dtype=np.bool_)  # no step since the episode's start
        self._some_fresh = self._ready = False
        self._frames, self._si = np.zeros((2, num_envs, len(task.kept)), dtype=np.float32)
        self._labels, self._all = (
            np.zeros(num_envs, dtype=object),
            np.ones(num_envs, dtype=np.bool_),
        )
        self.viewers: dict[int, Any] = {}  # one for each drawn environment
        self._pool: ThreadPoolExecutor | None = None
        # closed loops of each environment: in flight, and kept for its episodes
        self.loops: list[ClosedLoop] = []
        self._kept: list[dict[Any, ClosedLoop]] = [{} for _ in range(num_envs)]
        self._make_memory()

    def __getstate__(self) -> dict[str, Any]:
        """Return all but threads, windows and the core's parts, for a copy."""
        empty: dict[str, Any] = {"_pool": None, "_scene": None, "_streams": None, "viewers": {}}
        return self.__dict__ | empty

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.state.bind(self.episodes)
        self._streams = _core.Streams(self.num_envs)
        for i in np.flatnonzero(self._seeded).tolist():
            self._streams.put(i, self.generators[i])
        self._look()

    def _look(self) -> None:
        """Show the core the arrays of the episodes and their rows."""
        self._scene = _core.Scene(*self.episodes, self.state.rows, self.state.flying)

    def _draw_from(self, i: int, rng: np.random.Generator) -> None:
        """Let an environment draw from a generator."""
        self.generators[i], self._seeded[i] = rng, True
        self._streams.put(i, rng)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Single, Infos]:
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
        judged = self._judge()
        return judged.observations.copy(), self._infos(judged, self._all)

    def step(self, actions: Single) -> tuple[Single, Array, Mask, Mask, Infos]:
        """Fly a decision in every environment with actions (num_envs, n) of ``action_space``.

        Raises:
            InputError: another shape, or a number is not finite; nothing flies.
        """
        some = bool(self._over.any())
        self.fly(actions, ~self._over if some else self._all)
        if some:
            self._start(self._over)
        judged = self._judge()
        truncated = self.truncated
        over = judged.lost | truncated
        if self.autoreset_mode is AutoresetMode.NEXT_STEP or not over.any():
            self._over = over
            seen = judged.observations.copy()
            return seen, judged.rewards, judged.lost, truncated, self._infos(judged, self._all)
        ended, final = self._infos(judged, over), np.full(self.num_envs, None, dtype=object)
        for i in np.flatnonzero(over):
            final[i] = judged.observations[i].copy()
        self._start(over)
        again = self._judge()
        masks = {"_final_obs": over.copy(), "_final_info": over.copy()}
        infos = self._infos(again, self._all) | {"final_obs": final, "final_info": ended} | masks
        return again.observations.copy(), judged.rewards, judged.lost, truncated, infos

    def begin(self, rng: np.random.Generator) -> JudgedStep:
        """Start an episode of the one environment, which draws from ``rng``."""
        self._draw_from(0, rng)
        self._start(self._all)
        return self._judge()

    def go_on(self, action: Any, rng: np.random.Generator) -> JudgedStep:
        """Fly a decision of the one environment, which draws from ``rng``.

        Raises:
            InputError: as ``step``.
        """
        if rng is not self.generators[0]:
            self._draw_from(0, rng)
        task = self.task
        if not self._taken([action], self._all):
            count = f"{_COUNTS[task.action_size]} finite number{'s' * (task.action_size > 1)}"
            raise InputError(
                f"{task.name}: action must be {count} in {task.action_unit}, shape "
                f"({task.action_size},), got {action!r}"
            )
        self._fly(self._all)
        self._fresh[0] = self._some_fresh = False
        return self._judge()

    @property
    def truncated(self) -> Mask:
        """Whether each episode (n,) has had its last decision."""
        return self.episodes.decisions >= self.max_episode_steps

    def fly(self, actions: Any, which: Mask) -> None:
        """Fly a decision in some environments with actions (num_envs, n).

        Raises:
            InputError: as ``step``.
        """
        if not self._taken(actions, which):
            task, shape = self.task, self.episodes.actions.shape
            raise InputError(
                f"{task.name}: actions must be finite numbers in {task.action_unit}, shape "
                f"{shape}, got {np.asarray(actions, dtype=np.float64)!r}"
            )
        self._fly(which)
        self._fresh[which] = False
        self._some_fresh = which is not self._all and bool(self._fresh.any())

    def _taken(self, actions: Any, which: Mask) -> bool:
        """Return whether actions (num_envs, n) are finite and of the right shape. If so, write
        down the actions of ``which``.
        """
        if not self._ready:
            raise InputError(f"{self.task.name}: call reset before step")
        wanted, flown = np.array(actions, dtype=np.float64), self.task.flown
        how = self.task.action_scale, flown.hover, flown.below, flown.above
        if wanted.shape != self.episodes.actions.shape:
            return False
        return self._scene.take(wanted, which, *how)

    def _judge(self) -> JudgedStep:
        """Return what the task says of the present state."""
        task, s = self.task, self.state
        seen = np.ascontiguousarray(task.see(s), dtype=np.float64)
        if seen.shape != self._si.shape:
            raise InputError(
                f"{task.name}: observe must return shape {self._si.shape}, got {seen.shape}"
            )
        _core.limit(seen, task.kept, task.divisors, self._si, self._frames)
        values: Infos = {"observation": self._si, "command": s.command, **task.info(s)}
        rewards = np.zeros(self.num_envs)
        for name, term in task.reward_terms(s).items():
            values[f"reward_{name}"] = term
            rewards += term
        lost = task.is_lost(s) | self.episodes.broken
        values["lost"], values[task.label] = lost, self._labels
        if self._some_fresh:  # steps alone decide rewards and losses
            for name in values:
                if name.startswith("reward_"):
                    values[name] = np.where(self._fresh, 0.0, values[name])
            rewards[self._fresh], lost[self._fresh] = 0.0, False
        if self.render_mode == "human":
            self.render()
        return JudgedStep(self._frames, rewards, lost, values)

    def _start(self, which: Mask, seeds: Sequence[int | None] | None = None) -> None:
        """Start an episode in the environments of ``which`` (num_envs,)."""
        self._begun[which] = False
        self._fresh[which] = True
        started = np.flatnonzero(which).tolist()
        for i in started:
            seed = None if seeds is None else seeds[i]
            if not self._seeded[i] or seed is not None:
                self._draw_from(i, np_random(seed)[0])
        for i in started:
            for numbers in self.episodes[-4:-1]:  # commands and actions
                numbers[i] = 0.0
            self.episodes.decisions[i] = 0
        self._ready = False
        self._hover(started)
        self._begun[which] = self._some_fresh = True
        self._ready = bool(self._begun.all())

    def _hover(self, which: list[int]) -> None:
        """Draw an episode of some environments, and let their vehicles hover at its start. Draw
        anew where the winds carry a vehicle off before the first decision.
        """
        task, drawn = self.task, {}
        for attempt in range(task.draws):
            for i in which:
                rng = self.generators[i]
                if attempt == 0:
                    drawn[i] = task.draw_loop(rng, self._kept[i]), task.drawn
                loop, task.drawn = drawn[i]
                start = task.draw_start(rng)
                self._keep(i, start)
                reference = start.references if task.flown.follows else None
                loop.reset(rng, start.poses[:3], start.poses[3], start.winds, reference)
                self._place(i, loop)
            self._settle(which)
            lost = self.task.is_lost(self.state) | self.episodes.broken
            which = [i for i in which if lost[i]]
            if not which or task.draws == 1:
                return
        raise InputError(
            f"{task.name}: the vehicle is lost before the episode begins in {task.draws} draws "
            f"of these winds; expected winds that its flight loop can hold for 1.5 s"
        )

    def _keep(self, i: int, start: Start) -> None:
        """Write down an environment's new episode; after its last row all stays."""
        y, height = start.paths.T
        height = height if np.ptp(height) > 0.0 else height[:1]
        for name, rows in (("paths", y), ("heights", height), ("references", start.references)):
            stored = getattr(self.episodes, name)
            if len(rows) > stored.shape[1]:
                more = ((0, 0), (0, len(rows) - stored.shape[1]), (0, 0))[: stored.ndim]
                stored = np.pad(stored, more, mode="edge")
                self.episodes = self.episodes._replace(**{name: stored})
                self._look()
            stored[i, : len(rows)], stored[i, len(rows) :] = rows, rows[-1]
        self._labels[i] = start.labels

    def _make_memory(self) -> None:
        """Make the memory of the flights."""

    def _place(self, i: int, loop: ClosedLoop) -> None:
        """Let environment ``i`` go on with a loop at the start of an episode."""
        if i == len(self.loops):
            self.loops.append(loop)
        self.loops[i] = loop

    def _settle(self, which: list[int]) -> None:
        """Let the filters of some environments settle."""
        self._spread(
            lambda i: self.loops[i].settle(self.generators[i], SETTLE_TICKS, self._path(i, 1)),
            which,
        )
        self._see(which)

    def _fly(self, which: Mask) -> None:
        """Fly a decision in some environments at their commands."""
        flying = [0] if self.num_envs == 1 else np.flatnonzero(which).tolist()
        with Untimed():
            self._spread(self._fly_one, flying)
        self._see(flying)

    def _fly_one(self, i: int) -> None:
        """Fly a decision with the normals of the environment's generator."""
        task, loop = self.task, self.loops[i]
        normals = np.empty((task.decision_ticks, loop.noise_size))
        self._streams.draw(i, normals)
        commanded = loop.setpoint if task.flown.moves else loop.action
        commanded[task.flown.places] = self.episodes.commands[i]
        loop.run(normals, self._path(i, task.decision_ticks))

    def _path(self, i: int, ticks: int) -> Array:
        """Return the fan's path (m, 2) m in an environment's next ticks."""
        now = max(self.loops[i].ticks, 0)
        steps, path = np.arange(now, now + ticks), np.empty((ticks, 2))
        for j, rows in enumerate(self.episodes[2:4]):
            path[:, j] = rows[i].take(steps, mode="clip")
        return path

    def _see(self, which: list[int]) -> None:
        """Gather the state of some environments."""
        episodes = self.episodes
        for i in which:
            loop = self.loops[i]
            episodes.ticks[i], episodes.broken[i] = loop.ticks, loop.was_reset
            self._scene.gather(i, loop.address)

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

    def _infos(self, judged: JudgedStep, which: Mask) -> Infos:
        """Return the ``infos`` of some environments as Gymnasium's vector environments do: an array
        and a mask for each entry; zeros, or None, outside the mask.
        """
        infos: Infos = {}
        for name, values in judged.values.items():
            entries = np.array(values)
            if entries.ndim == 0:
                entries = np.full(self.num_envs, entries)
            if which is not self._all:
                entries[~which] = None if entries.dtype == object else 0
            infos[name], infos[f"_{name}"] = entries, which.copy()
        return infos

    def render(self) -> tuple[Any, ...]:
        """Return a picture (height, width, 3) of each environment, or show them in windows.

        Raises:
            InputError: not reset yet, or this machine cannot draw.
        """
        if self.render_mode is None or not self._ready:
            raise InputError(
                f"{self.task.name}: render needs a render_mode ('human' or 'rgb_array') and a "
                f"reset before it"
            )
        from .drawing import Viewer

        for i in range(self.num_envs - len(self.viewers)):
            self.viewers[i] = Viewer(self.render_mode, self.task.width, self.task.height)
        goals = (
            self.state.reference[:, :3] if self.task.fan.speed == 0.0 else [None] * self.num_envs
        )
        return tuple(
            self.viewers[i].draw(*each)
            for i, each in enumerate(zip(self.loops, goals, strict=True))
        )

    def close_extras(self, **kwargs: Any) -> None:
        """Close all windows and end the threads."""
        if self._pool is not None:
            self._pool.shutdown()
        for viewer in self.viewers.values():
            viewer.close()
        self.viewers = {}


def _mode(wanted_mode: AutoresetMode | str, task: str) -> AutoresetMode:
    for mode in (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP):
        if wanted_mode in (mode, mode.value, mode.name):
            return mode
    raise InputError(
        f"{task}: autoreset_mode must be NEXT_STEP or SAME_STEP of "
        f"gymnasium.vector.AutoresetMode, got {wanted_mode!r}"
    )
