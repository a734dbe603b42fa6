"""Many fan-tracking environments in one process, on MuJoCo or in the lanes of a vector unit."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from ..runtime.errors import InputError, unknown_name
from .fan_tracking import FanTrackingEnv
from .task import Frame

Flags = NDArray[np.bool_]
Infos = dict[str, Any]

# entries of ``infos``, beside ``fan_motion``
VALUES = np.dtype(
    [
        *[(name, "f8") for name in ("reward_tracking", "reward_change")],
        *[(name, "f8") for name in ("fan_y", "fan_velocity", "y", "offset")],
        ("force", "f8", (3,)),
        ("torque", "f8", (3,)),
        ("time", "f8"),
        ("lost", "?"),
    ],
    align=True,
)


class FanTrackingVectorEnv(gym.vector.VectorEnv[Frame, Frame, NDArray[Any]]):
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
        threads: over which the environments are spread; the results do not depend on it. MuJoCo
            gains little by threads: most of a step is Python's.
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
        self.num_envs, self.max_episode_steps = num_envs, max_episode_steps
        self.threads = min(threads, num_envs)
        self.envs = self._make_envs(kwargs)
        first = self.envs[0]
        self.metadata = {**first.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = first.render_mode
        self.single_action_space = first.action_space
        self.single_observation_space = first.observation_space
        self.action_space = gym.vector.utils.batch_space(first.action_space, num_envs)
        self.observation_space = gym.vector.utils.batch_space(first.observation_space, num_envs)
        self._decisions = np.zeros(num_envs, dtype=np.int64)  # of the episode in hand
        self._begun = np.zeros(num_envs, dtype=np.bool_)
        self._over = np.zeros(num_envs, dtype=np.bool_)  # episodes that ended at the last step
        self._frames = np.zeros(self.observation_space.shape or (), dtype=np.float32)
        self._table = np.zeros(num_envs, dtype=VALUES)
        self._values = {name: self._table[name] for name in VALUES.names or ()}
        self._values["fan_motion"] = np.zeros(num_envs, dtype=object)
        self._all = np.ones(num_envs, dtype=np.bool_)
        self._pool: ThreadPoolExecutor | None = None

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
        self._start(mask, seeds)
        self._over[mask] = False
        return self._frames.copy(), self._infos()

    def step(self, actions: Frame) -> tuple[Frame, NDArray[np.float64], Flags, Flags, Infos]:
        """Fly 80 ms in every environment with commanded velocities (num_envs, 1) m/s along y.

        Raises:
            InputError: another shape, or a number that is not finite; nothing has flown then.
        """
        commands = np.asarray(actions, dtype=np.float64)
        if commands.shape != (self.num_envs, 1) or not np.all(np.isfinite(commands)):
            raise InputError(
                f"FanTracking: actions must be finite numbers in m/s, shape ({self.num_envs}, 1), "
                f"got {commands!r}"
            )
        if not self._begun.all():
            raise InputError("FanTracking: call reset before step")
        self._fly(commands, ~self._over)
        self._decisions += 1
        if self._over.any():
            self._start(self._over)
        values, truncated = self._values, self._decisions >= self.max_episode_steps
        lost, rewards = values["lost"].copy(), values["reward_tracking"] + values["reward_change"]
        over = lost | truncated
        if self.autoreset_mode is AutoresetMode.NEXT_STEP or not over.any():
            self._over = over
            return self._frames.copy(), rewards, lost, truncated, self._infos()
        ended, final = self._final_infos(over), np.full(self.num_envs, None, dtype=object)
        for i in np.flatnonzero(over):
            final[i] = self._frames[i].copy()
        self._start(over)
        masks = {"_final_obs": over.copy(), "_final_info": over.copy()}
        infos = self._infos() | {"final_obs": final, "final_info": ended} | masks
        return self._frames.copy(), rewards, lost, truncated, infos

    def _start(self, which: Flags, seeds: Sequence[int | None] | None = None) -> None:
        """Start an episode in all environments that ``which`` (num_envs,) names."""
        self._begun[which] = False
        self._begin(np.flatnonzero(which).tolist(), seeds)
        self._begun[which], self._decisions[which] = True, 0

    def _make_envs(self, kwargs: dict[str, Any]) -> list[FanTrackingEnv]:
        """Return the environments."""
        return [FanTrackingEnv(**kwargs) for _ in range(self.num_envs)]

    def _begin(self, which: list[int], seeds: Sequence[int | None] | None) -> None:
        """Start an episode in some environments; write frames and values."""

        def begin(n: int) -> None:
            i = which[n]
            self._note(i, *self.envs[i].reset(seed=None if seeds is None else seeds[i]))

        self._spread(begin, len(which))

    def _fly(self, commands: NDArray[np.float64], which: Flags) -> None:
        """Fly a decision in some environments; write frames and values."""
        flying = np.flatnonzero(which).tolist()

        def fly(n: int) -> None:
            i = flying[n]
            frame, _, _, _, info = self.envs[i].step(commands[i])
            self._note(i, frame, info)

        self._spread(fly, len(flying))

    def _note(self, i: int, frame: Frame, info: dict[str, Any]) -> None:
        self._frames[i] = frame
        for name, value in info.items():
            self._values[name][i] = value

    def _spread(self, work: Callable[[int], None], count: int) -> None:
        """Call ``work`` with 0 to ``count - 1``, once each; this thread works, too.

        A thread that is done takes the next number, so that no thread waits for a slow one.
        """
        numbers = iter(range(count))

        def take_numbers() -> None:
            for n in numbers:
                work(n)

        helpers = min(self.threads, count) - 1
        if helpers < 1:
            take_numbers()
            return
        if self._pool is None:
            self._pool = ThreadPoolExecutor(self.threads - 1)
        others = [self._pool.submit(take_numbers) for _ in range(helpers)]
        try:
            take_numbers()
        finally:
            others = [other for other in others if not other.cancel()]  # the rest came too late
            wait(others)
        for other in others:
            other.result()

    def _infos(self) -> Infos:
        """Return what the environments say as Gymnasium's vector environments do: an array and a
        mask for each entry.
        """
        infos: Infos = {name: values.copy() for name, values in self._values.items()}
        return infos | {f"_{name}": self._all.copy() for name in infos}

    def _final_infos(self, over: Flags) -> Infos:
        """Return the infos of the episodes that ended: zeros, and a mask, where none did."""
        infos: Infos = {}
        for name, values in self._values.items():
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
