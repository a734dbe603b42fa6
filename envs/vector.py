"""Many fan-tracking environments in one process: one compiled call flies a decision of all of
them, and one writes what came of it.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numba import typed, typeof
from numpy.typing import NDArray

from ..controllers.observation import OBSERVATION_SIZE
from ..dynamics.motion import Array
from ..runtime.compiled import compiled_without_gil, specialised
from ..runtime.errors import InputError, unknown_name
from .closed_loop import is_healthy, run_ticks
from .fan_tracking import (
    AWAY,
    DECISION_TICKS,
    FAN_TIMES,
    FanTrackingEnv,
    reward_terms,
    see,
)
from .normals import draw_normals, generator_list
from .observing import View
from .plant import NOISE, TICK
from .task import LOST_OFFSET, UPRIGHT, Frame
from .untimed import Untimed

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
            gains little by threads: its step is called through Python.
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
        self._ticks = np.zeros(num_envs, dtype=np.int64)  # likewise
        self._begun = np.zeros(num_envs, dtype=np.bool_)
        self._over = np.zeros(num_envs, dtype=np.bool_)  # episodes that ended at the last step
        self._broken = np.zeros(num_envs, dtype=np.bool_)  # MuJoCo started over on its own
        # each environment's own; one that was not reset yet has another's
        self._generators = generator_list([np.random.default_rng(0)] * num_envs)
        self._paths = np.zeros((num_envs, FAN_TIMES.size))  # m, the fan's y, a column a tick
        self._distance = np.zeros(num_envs)  # m, from the fan at the start
        self._commands, self._changes = np.zeros(num_envs), np.zeros(num_envs)  # m/s
        view = first.view
        self._views = [View(view.observe, view.normalize) for _ in range(num_envs)]
        self._frames = np.zeros(self.observation_space.shape or (), dtype=np.float32)
        self._whole = self._frames  # frames before a view is taken of them
        if not view.is_plain:
            self._whole = np.zeros((num_envs, OBSERVATION_SIZE), dtype=np.float32)
        self._table = np.zeros(num_envs, dtype=VALUES)
        self._values = {name: self._table[name] for name in VALUES.names or ()}
        self._values["fan_motion"] = np.zeros(num_envs, dtype=object)
        self._all = np.ones(num_envs, dtype=np.bool_)
        self._pool: ThreadPoolExecutor | None = None
        self._compiled: dict[Any, Callable[..., None]] = {}
        self._motion = self._make_memory()

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
        flying, limit = ~self._over, self.envs[0].largest_action
        self._call(take_commands, flying, commands, limit, self._commands, self._changes)
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
        started = np.flatnonzero(which).tolist()
        self._begun[which] = False
        for numbers in (self._decisions, self._ticks, self._commands, self._changes, self._broken):
            numbers[which] = 0
        self._hover(started, seeds or [None] * self.num_envs)
        for i in started:
            self._views[i].restart(self._state(i))
        self._look(which)
        for name in ("reward_tracking", "reward_change", "lost"):  # decided by steps
            self._values[name][which] = 0
        self._begun[which] = True

    def _make_envs(self, kwargs: dict[str, Any]) -> list[FanTrackingEnv]:
        """Return the environments."""
        return [FanTrackingEnv(**kwargs) for _ in range(self.num_envs)]

    def _make_memory(self) -> tuple[Array, Array, Array, Array]:
        """Make what ``_fly`` works on.

        Returns position and quaternion (7,), velocities (6,), true external wrench (6,) and
        estimated state (20,) of all environments, which ``_fly`` writes: arrays (n, size, lanes),
        environment i in row ``i // lanes`` and lane ``i % lanes``.
        """
        # an environment that was not reset yet has the first one's flight
        first = self.envs[0]
        flight = first.make_loop(first.truth, first.fan).flight
        self._flights = typed.List.empty_list(typeof(flight))
        for _ in range(self.num_envs):
            self._flights.append(flight)
        position, velocity, wrench, state = (
            np.zeros((self.num_envs, size, 1)) for size in (7, 6, 6, 20)
        )
        return position, velocity, wrench, state

    def _hover(self, which: list[int], seeds: Sequence[int | None]) -> None:
        """Draw an episode of some environments, and let their vehicles hover at its start."""

        def hover(n: int) -> None:
            i = which[n]
            env = self.envs[i]
            env.reset(seed=seeds[i])
            self._generators[i], self._flights[i] = env.np_random, env.loop.flight
            self._distance[i], self._paths[i] = env.distance, env.path[:, 0]
            self._values["fan_motion"][i] = env.fan_motion

        self._spread(hover, len(which))
        self._move(np.isin(np.arange(self.num_envs), which), 0)

    def _fly(self, which: Flags) -> None:
        """Fly a decision in some environments at ``_commands``."""
        own_stages, flying = bool(self.envs[0].stages), np.flatnonzero(which).tolist()
        for i in flying if own_stages else ():
            self.envs[i].command[0] = self._commands[i]
            self.envs[i].fly()
            self._ticks[i] += DECISION_TICKS
        self._move(which, 0 if own_stages else DECISION_TICKS)
        for i in flying:
            self._broken[i] = self.envs[i].loop.was_reset

    def _move(self, which: Flags, ticks: int) -> None:
        """Run some ticks of the kit's own stages, and write ``_motion``."""
        parts = 1 if self.threads == 1 else self.num_envs
        given = self._flights, self._generators, which, self._commands, self._paths
        height = self.envs[0].fan.height

        def move(part: int) -> None:
            first, last = part * self.num_envs // parts, (part + 1) * self.num_envs // parts
            self._call(fly_loops, first, last, *given, height, self._ticks, ticks, *self._motion)

        with Untimed():
            self._spread(move, parts)

    def _state(self, i: int) -> Array:
        """Return the estimated state (20,) of an environment."""
        states = self._motion[3]
        state: Array = states[i // states.shape[2], :, i % states.shape[2]]
        return state

    def _look(self, which: Flags) -> None:
        """Write frames and values of some environments, as ``FanTrackingEnv`` has them."""
        env, frames = self.envs[0], self._whole
        moves = self._commands, self._changes, self._broken
        episodes = which, self._ticks, self._paths, self._distance, env.fan.height
        self._call(look, *episodes, *moves, *self._motion, frames, self._table)
        if env.view.is_of_a_frame and not env.view.is_plain:
            self._frames[which] = env.view.of_frames(frames[which])
        elif not env.view.is_plain:
            for i in np.flatnonzero(which).tolist():
                self._frames[i] = self._views[i].of(frames[i], self._state(i), int(self._ticks[i]))
        if self.render_mode == "human":
            self.render()

    def _call(self, function: Callable[..., None], *arguments: Any) -> None:
        """Call a compiled function, always with arguments of the same types."""
        if function not in self._compiled:
            self._compiled[function] = specialised(function, *arguments)
        self._compiled[function](*arguments)

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


@compiled_without_gil
def take_commands(
    which: Flags, wanted: Array, limit: float, commands: Array, changes: Array
) -> None:
    """Write the commands (n,) m/s of the environments ``which``, within ``limit``, and their
    changes.
    """
    for n in np.flatnonzero(which):
        value = min(max(wanted[n, 0], -limit), limit)
        changes[n], commands[n] = value - commands[n], value


@compiled_without_gil
def fly_loops(
    begin: int,
    end: int,
    flights: Any,
    generators: Any,
    which: Flags,
    commands: Array,
    paths: Array,
    height: float,
    ticks: np.ndarray,
    count: int,
    position: Array,
    velocity: Array,
    wrench: Array,
    state: Array,
) -> None:
    """Fly ``count`` ticks of those environments from ``begin`` to ``end - 1`` that fly.

    Args:
        begin: an environment.
        end: likewise.
        flights: (n,) of ``ClosedLoop.flight``; a typed list.
        generators: (n,) that the noise is drawn from; a typed list.
        which: (n,) booleans, whether they fly.
        commands: (n,) m/s, along y.
        paths: (n, m) m, the fan's y, a column a tick.
        height: m, of the fan's axis.
        ticks: (n,) since the start of the episode; written.
        count: of ticks.
        position: (n, 7, 1) m and quaternion; written, as are the next three.
        velocity: (n, 6, 1) m/s, world, and rad/s, body.
        wrench: (n, 6, 1) N and Nm, the true external one.
        state: (n, 20, 1) as the filter estimates it.
    """
    path, last = np.full((count, 2), height), paths.shape[1] - 1
    for n in range(begin, end):
        if not which[n]:
            continue
        record, world, move = flights[n]
        loop, noise = record[0], np.empty((count, NOISE))
        loop.flight.setpoint[4] = commands[n]
        for k in range(count):
            path[k, 0] = paths[n, min(ticks[n] + k, last)]
        draw_normals(generators, n, noise)
        run_ticks(record, world, path, noise, move)
        ticks[n] += count
        position[n, :, 0], velocity[n, :, 0] = world.qpos, world.qvel
        wrench[n, :, 0], state[n, :, 0] = loop.plant.external, loop.filter.x


@compiled_without_gil
def look(
    which: Flags,
    ticks: np.ndarray,
    paths: Array,
    distance: Array,
    height: float,
    commands: Array,
    changes: Array,
    broken: Flags,
    position: Array,
    velocity: Array,
    wrench: Array,
    states: Array,
    frames: Frame,
    values: np.ndarray,
) -> None:
    """Write frames and the truth of the environments ``which`` as ``FanTrackingEnv`` has them."""
    lanes = states.shape[2]
    for n in np.flatnonzero(which):
        b, lane = n // lanes, n % lanes
        p, v, state = position[b, :, lane], velocity[b, :, lane], states[b, :, lane].copy()
        see(state, commands[n], frames[n])
        k, value = min(ticks[n], paths.shape[1] - 1), values[n]
        value.time, value.fan_y = ticks[n] * TICK, paths[n, max(k - 1, 0)]
        value.fan_velocity = (paths[n, k] - value.fan_y) / TICK
        value.y, value.offset = p[1], p[1] - value.fan_y
        value.force[:], value.torque[:] = wrench[b, :3, lane], wrench[b, 3:, lane]
        value.reward_tracking, value.reward_change = reward_terms(value.offset, changes[n])
        # written such that a number that is not finite counts as lost
        value.lost = broken[n] or not (
            is_healthy(state, v)
            and 1.0 - 2.0 * (p[4] * p[4] + p[5] * p[5]) >= UPRIGHT
            and abs(value.offset) <= LOST_OFFSET
            and abs(p[0] - distance[n]) <= AWAY
            and abs(p[2] - height) <= AWAY
        )
