"""A decision of the fan-tracking task, all of it compiled: its flight, the observation, the reward
and the truth behind it.
"""

import math

import numpy as np
from numba import carray

from ..controllers.observation import MAX_COMMAND, OBSERVATION_SIZE
from ..dynamics.motion import Array
from ..runtime.addresses import call_at, numbers_at, pointer_to
from ..runtime.compiled import Record, compiled, compiled_without_gil
from ..runtime.work_sharing import next_task, stop_looking, task_done, tasks_open
from .closed_loop import FASTEST, LOOP, has_been_reset
from .plant import NOISE, TICK

DECISION_TICKS = 16  # 12.5 Hz
TRACKING_WIDTH = 0.3  # m, offset at which the tracking reward is a half
CHANGE_COST = 0.05  # per (m/s)^2 of change of the command
LOST_OFFSET = 2.5  # m
_AWAY = 1.0  # m, off its height or its distance
_UPRIGHT = 0.34  # cosine of 70 degrees

# largest size of an observation's numbers
LIMITS = (10.0, 10.0, 10.0, 1.0, 1.0, 1.0, 5.0, MAX_COMMAND)

# one environment's decision; the names are those of ``info``
OUTCOME = np.dtype(
    [
        ("observation", "f4", (OBSERVATION_SIZE,)),
        ("reward_tracking", "f8"),
        ("reward_change", "f8"),
        ("fan_y", "f8"),
        ("fan_velocity", "f8"),
        ("y", "f8"),
        ("offset", "f8"),
        ("force", "f8", (3,)),
        ("torque", "f8", (3,)),
        ("time", "f8"),
        ("lost", "?"),
    ]
)
INFO = OUTCOME.names[1:]  # type: ignore[index]


# an episode in progress
EPISODE = np.dtype(
    [
        # addresses: of the closed loop's record and of what runs it, of NumPy's normals and their
        # bits, of where these normals are written if not where the caller says (or 0), of the
        # fan's path
        *[(name, "i8") for name in ("loop", "run", "normals", "bits", "drawn", "path")],
        ("path_count", "i8"),  # of that path's places (m), one a tick
        ("ticks", "i8"),  # since its start
        ("distance", "f8"),  # m, where the vehicle started
        ("height", "f8"),
        ("command", "f8"),  # m/s, the last
        # 2, of the offset in the reward; the compiler would make a product of a constant one, which
        # rounds otherwise than C's ``pow`` once in a thousand times, and rewards keep their bits
        ("power", "f8"),
        ("outcome", OUTCOME),
    ]
)


@compiled
def look(
    x: Array, external: Array, qpos: Array, qvel: Array, started_over: bool, episode: Record
) -> None:
    """Write what there is to see now into ``episode.outcome``, all but the reward.

    Args:
        x: estimated state (20,).
        external: true external wrench (6,), world.
        qpos: true position and quaternion (7,).
        qvel: true velocity, world, and body rate (6,).
        started_over: whether the simulator could not go on.
        episode: of ``EPISODE``.
    """
    e, out = episode, episode.outcome
    path = numbers_at(e.path, (e.path_count,))
    for i in range(OBSERVATION_SIZE):
        value = x[16 + i] if i < 3 else x[10 + i] if i < 6 else x[8] if i == 6 else e.command
        out.observation[i] = min(max(value, -LIMITS[i]), LIMITS[i]) if math.isfinite(value) else 0.0
    k = min(e.ticks, e.path_count - 1)
    out.fan_y = path[max(k - 1, 0)]
    out.fan_velocity = (path[k] - path[k - 1]) / TICK if k > 0 else 0.0
    out.y = qpos[1]
    out.offset = qpos[1] - out.fan_y
    for i in range(3):
        out.force[i] = external[i]
        out.torque[i] = external[3 + i]
    out.time = e.ticks * TICK
    flying = (
        math.isfinite(x[:19].sum())
        and 1.0 - 2.0 * (qpos[4] * qpos[4] + qpos[5] * qpos[5]) >= _UPRIGHT
    )
    for i in range(6):
        flying = flying and abs(qvel[i]) < FASTEST
    # all of them such that a number that is none counts as lost
    out.lost = started_over or not (
        flying
        and abs(out.offset) <= LOST_OFFSET
        and abs(qpos[0] - e.distance) <= _AWAY
        and abs(qpos[2] - e.height) <= _AWAY
    )


@compiled
def take_command(e: Record, command: float) -> float:
    """Let an episode go on at a command in m/s, clipped; return how it changes."""
    value = min(max(command, -MAX_COMMAND), MAX_COMMAND)
    change: float = value - e.command
    e.command = value
    return change


@compiled
def reward(e: Record, change: float) -> None:
    """Write the reward's terms into the outcome that ``look`` wrote."""
    out = e.outcome
    out.reward_tracking = 1.0 / (1.0 + (out.offset / TRACKING_WIDTH) ** e.power)
    out.reward_change = -CHANGE_COST * change * change


@compiled
def _decide(e: Record, command: float, ticks: int, noise: Array) -> None:
    loop = carray(pointer_to(e.loop), 1, LOOP)[0]
    change = take_command(e, command)
    loop.flight.setpoint[4] = e.command
    if ticks > 0:
        drawn = e.drawn if e.drawn != 0 else noise.ctypes.data
        call_at(e.normals, e.bits, noise.size, drawn)
        call_at(e.run, e.loop, drawn, ticks, e.path, e.path_count, e.ticks)
        e.ticks += ticks
    qpos, qvel = numbers_at(loop.qpos, (7,)), numbers_at(loop.qvel, (6,))
    look(loop.filter.x, loop.plant.external, qpos, qvel, has_been_reset(loop), e)
    reward(e, change)


@compiled_without_gil
def decide(
    episodes: np.ndarray,
    commands: Array,
    resting: np.ndarray,
    ticks: int,
    tasks: np.ndarray,
    patience: int,
) -> None:
    """Fly ``ticks`` ticks of each episode that does not rest, at its command in m/s, and write its
    outcome.

    Other threads run meanwhile; several may call this with the same arguments and share the
    episodes out. All that an episode's record has the addresses of must live.

    Args:
        episodes: (n,) of ``EPISODE``.
        commands: (n,) m/s.
        resting: (n,) booleans.
        ticks: of ``TICK`` s.
        tasks: of the episodes, open (``work_sharing.open_tasks``).
        patience: looks at the tasks after the last, should they open again meanwhile.
    """
    noise = np.empty((ticks, NOISE))
    while True:
        n = next_task(tasks)
        if n < len(episodes):
            if not resting[n]:
                _decide(episodes[n], commands[n], ticks, noise)
            task_done(tasks)
        elif not tasks_open(tasks, len(episodes), patience):
            stop_looking(tasks)
            break
