"""Many fan-tracking environments in one process."""

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from ..runtime.compiled import specialised
from ..runtime.errors import InputError, unknown_name
from ..runtime.work_sharing import PATIENCE, all_done, open_tasks
from .decision import DECISION_TICKS, EPISODE, INFO, decide
from .fan_tracking import FanTrackingEnv

Frames = NDArray[np.float32]
Flags = NDArray[np.bool_]
Infos = dict[str, Any]


class FanTrackingVectorEnv(gym.vector.VectorEnv[Frames, Frames, NDArray[Any]]):
    """``num_envs`` environments side by side, each bit for bit the single one with its seed.

    ``reset(seed=s)`` seeds them with s, s + 1, ...; a list gives each its own. An environment whose
    episode has ended starts its next one at the following step, whose action it ignores
    (``AutoresetMode.NEXT_STEP``, the default), or within the step that ended it
    (``AutoresetMode.SAME_STEP``): then ``infos["final_obs"]`` and ``infos["final_info"]`` hold what
    ended it, as in Gymnasium's own vector environments. Each entry of ``infos`` is an array with a
    row for each environment; all environments have all of them.

    Args:
        num_envs: how many.
        max_episode_steps: decisions after which an episode is truncated.
        threads: over which the environments are spread; the results do not depend on it.
        autoreset_mode: ``NEXT_STEP`` or ``SAME_STEP``, of ``gymnasium.vector.AutoresetMode`` or its
            value as text.
        **kwargs: of ``FanTrackingEnv``.

    Raises:
        InputError: ``num_envs`` or ``threads`` is not positive, another mode, or what
            ``FanTrackingEnv`` refuses.
    """

    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int = 250,
        threads: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        **kwargs: Any,
    ) -> None:
        for name, value in (
            ("num_envs", num_envs),
            ("max_episode_steps", max_episode_steps),
            ("threads", threads),
        ):
            if value < 1:
                raise InputError(f"FanTracking: {name} must be at least 1, got {value}")
        self.autoreset_mode = _mode(autoreset_mode)
        self.num_envs, self.max_episode_steps, self.threads = (
            num_envs,
            max_episode_steps,
            min(threads, num_envs),
        )
        self._episodes = np.zeros(num_envs, dtype=EPISODE)
        self.envs = self._make_envs(kwargs)
        first = self.envs[0]
        self.metadata = {**first.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = first.render_mode
        self.single_action_space, self.single_observation_space = (
            first.action_space,
            first.observation_space,
        )
        self.action_space = gym.vector.utils.batch_space(first.action_space, num_envs)
        self.observation_space = gym.vector.utils.batch_space(first.observation_space, num_envs)
        self._decisions = np.zeros(num_envs, dtype=np.int64)  # of the episode in hand
        self._over = np.zeros(num_envs, dtype=np.bool_)  # episodes that ended at the last step
        self._outcomes = self._episodes["outcome"]
        self._motions = np.full(num_envs, "", dtype=object)
        self._all = np.ones(num_envs, dtype=np.bool_)
        # what threads read; one that comes late works for the step that it finds
        self._commands, self._resting = np.zeros(num_envs), np.zeros(num_envs, dtype=np.bool_)
        self._tasks = np.array([0, 0, self.threads])  # all of them have left
        self._parts = num_envs  # tasks of a decision
        self._call: Callable[[], None] | None = None
        self._help: Callable[[], None] | None = None  # the same, and to look for more
        self._helpers: list[Future[None]] = []
        self._pool: ThreadPoolExecutor | None = None

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Frames, Infos]:
        """Start an episode in every environment, or in those of ``options["reset_mask"]``
        (num_envs,), booleans.

        Raises:
            InputError: a list of seeds, or a mask, of another length, or another option.
        """
        if unknown := [name for name in options or {} if name != "reset_mask"]:
            raise unknown_name("option", str(unknown[0]), ("reset_mask",), "FanTracking: reset")
        seeds = (
            [None if seed is None else seed + i for i in range(self.num_envs)]
            if seed is None or isinstance(seed, int | np.integer)
            else list(seed)
        )
        mask = np.asarray((options or {}).get("reset_mask", self._all))
        if len(seeds) != self.num_envs or mask.shape != (self.num_envs,) or mask.dtype != np.bool_:
            raise InputError(
                f"FanTracking: reset: expected {self.num_envs} seeds, and booleans in reset_mask; "
                f"got {len(seeds)} and {mask!r}"
            )

        self._start_all(mask, seeds)
        self._decisions[mask], self._over[mask] = 0, False
        return self._frames(), self._infos()

    def step(self, actions: Frames) -> tuple[Frames, NDArray[np.float64], Flags, Flags, Infos]:
        """Fly 80 ms in every environment with commanded velocities (num_envs, 1) m/s along y.

        Raises:
            InputError: another shape, or a number that is not finite; nothing has flown then.
        """
        actions = np.asarray(actions, dtype=np.float64)
        if actions.shape != (self.num_envs, 1) or not np.all(np.isfinite(actions)):
            raise InputError(
                f"FanTracking: actions must be finite numbers in m/s, shape ({self.num_envs}, 1), "
                f"got {actions!r}"
            )
        if not self._episodes["loop"].all():
            raise InputError("FanTracking: call reset before step")
        self._commands[:], self._resting[:] = actions[:, 0], self._over
        self._fly()
        if self._over.any():
            self._start_all(self._resting)
        self._decisions = np.where(self._over, 0, self._decisions + 1)
        out, truncated = self._outcomes, self._decisions >= self.max_episode_steps
        lost, rewards = out["lost"].copy(), out["reward_tracking"] + out["reward_change"]
        over = lost | truncated
        if self.autoreset_mode is AutoresetMode.NEXT_STEP or not over.any():
            self._over = over
            return self._frames(), rewards, lost, truncated, self._infos()
        ended, last = self._final_infos(over), self._frames()
        final = np.full(self.num_envs, None, dtype=object)
        for i in np.flatnonzero(over):
            final[i] = last[i]
        self._start_all(over)
        self._decisions[over] = 0
        masks = {"_final_obs": over.copy(), "_final_info": over.copy()}
        infos = self._infos() | {"final_obs": final, "final_info": ended} | masks
        return self._frames(), rewards, lost, truncated, infos

    def _make_envs(self, kwargs: dict[str, Any]) -> list[FanTrackingEnv]:
        """Return the environments, whose episodes are those of ``_episodes``."""
        envs = [FanTrackingEnv(**kwargs) for _ in range(self.num_envs)]
        for i, env in enumerate(envs):
            env.episode = self._episodes[i : i + 1]
        return envs

    def _calls(self) -> tuple[Callable[[], None], Callable[[], None]]:
        """Return what flies a decision, and the same for a thread that helps."""
        given = self._episodes, self._commands, self._resting, DECISION_TICKS, self._tasks
        entry = specialised(decide, *given, PATIENCE)
        return partial(entry, *given, 0), partial(entry, *given, PATIENCE)

    def _fly(self) -> None:
        """Fly a decision of all environments that do not rest."""
        if self._call is None or self._help is None:
            self._call, self._help = self._calls()
        left = open_tasks(self._tasks) - 1  # without this thread
        if left:
            self._helpers = [
                *(h for h in self._helpers if not h.done()),
                *self._call_others(self._help, left),
            ]
        try:
            self._call()
            while not all_done(self._tasks, self._parts):
                for helper in self._helpers:
                    if helper.done():
                        helper.result()
        except BaseException:
            wait(self._helpers)  # what they have in hand must not be flown by two
            self._tasks[2] = self.threads
            raise

    def _call_others(self, work: Callable[[], None], count: int) -> list[Future[None]]:
        """Have ``count`` threads beside this one call ``work``."""
        if count and self._pool is None:
            self._pool = ThreadPoolExecutor(self.threads - 1)
        return [self._pool.submit(work) for _ in range(count)] if self._pool else []

    def _start_all(self, which: Flags, seeds: Sequence[int | None] | None = None) -> None:
        """Start an episode in all environments that ``which`` (num_envs,) names."""

        def start(i: int) -> None:
            if which[i]:
                self.envs[i].reset(seed=None if seeds is None else seeds[i])
                self._motions[i] = self.envs[i].fan_motion

        self._spread(start, self.num_envs)

    def _spread(self, work: Callable[[int], None], count: int) -> None:
        """Call ``work`` with 0 to ``count - 1``, once each; this thread works, too.

        Whoever is done takes the next, so that nobody waits for a thread that the machine held up.
        """
        numbers = iter(range(count))

        def take_tasks() -> None:
            for n in numbers:
                work(n)

        others = self._call_others(take_tasks, self.threads - 1)
        try:
            take_tasks()
        finally:
            others = [
                other for other in others if not other.cancel()
            ]  # the rest came too late to find any
            wait(others)
        for other in others:
            other.result()

    def _frames(self) -> Frames:
        view = self.envs[0].view
        if view.is_plain:
            frames: Frames = self._outcomes["observation"].copy()
            return frames
        if view.is_of_a_frame:
            return view.of_frames(self._outcomes["observation"])
        return np.stack([env.observation() for env in self.envs])

    def _infos(self) -> Infos:
        """Return what the environments say as Gymnasium's vector environments do: an array and a
        mask for each entry.
        """
        infos: Infos = {name: self._outcomes[name].copy() for name in INFO}
        infos["fan_motion"] = self._motions.copy()
        return infos | {f"_{name}": self._all.copy() for name in infos}

    def _final_infos(self, over: Flags) -> Infos:
        """Return the infos of the episodes that ended: zeros, and a mask, where none did."""
        infos: Infos = {}
        for name, values in self._infos().items():
            if not name.startswith("_"):
                kept = values.copy()
                kept[~over] = None if kept.dtype == object else 0
                infos[name], infos[f"_{name}"] = kept, over.copy()
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


def _mode(given: AutoresetMode | str) -> AutoresetMode:
    known = (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP)
    for mode in known:
        if given is mode or given in (mode.value, mode.name):
            return mode
    raise InputError(
        f"FanTracking: autoreset_mode must be {' or '.join(m.name for m in known)} of "
        f"gymnasium.vector.AutoresetMode, got {given!r}"
    )
