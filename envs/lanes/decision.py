"""A decision of fan-tracking environments side by side, all of it compiled."""

import numpy as np

from ...dynamics.motion import Array
from ...estimator.ukf_lanes import BLOCK_SIZE, STATE, put_down, take_up
from ...runtime.addresses import call_at, numbers_at
from ...runtime.compiled import compiled, compiled_without_gil
from ...runtime.pcg_normals import draw_normals
from ...runtime.vector_lanes import WIDTH
from ...runtime.work_sharing import next_task, stop_looking, task_done, tasks_open
from ..decision import look, reward, take_command
from ..plant import NOISE
from .flight import LOOPS, tick_lanes

_LOOP_SIZE = LOOPS.dtype.itemsize
# where the numbers lie that are one lane's own affair
_NOISE = LOOPS.offset("noise")
_QPOS, _QVEL = LOOPS.offset("qpos"), LOOPS.offset("qvel")
_FAN_Y = LOOPS.offset("fan", "y")
_SETPOINT = LOOPS.offset("flight", "setpoint")
_EXTERNAL = LOOPS.offset("plant", "external")
_LARGEST = 1e10  # of a number that MuJoCo goes on with


@compiled
def _fly(
    loop: int,
    kept: int,
    work: int,
    step: int,
    axial: Array,
    radial: Array,
    episodes: np.ndarray,
    states: np.ndarray,
    commands: Array,
    resting: np.ndarray,
    ticks: int,
) -> None:
    """Fly one block; its episodes are as many as it has lanes, or fewer."""
    count = len(episodes)
    drawn, changes = np.empty(NOISE), np.zeros(WIDTH)
    noise, fan_y = numbers_at(loop + _NOISE, (NOISE, WIDTH)), numbers_at(loop + _FAN_Y, (WIDTH,))
    setpoint = numbers_at(loop + _SETPOINT, (11, WIDTH))
    take_up(kept, work)
    for n in range(count):
        if not resting[n]:
            changes[n] = take_command(episodes[n], commands[n])
            setpoint[4, n] = episodes[n].command
    for k in range(ticks):
        for n in range(count):
            if resting[n]:
                continue
            e = episodes[n]
            path = numbers_at(e.path, (e.path_count,))
            fan_y[n] = path[min(e.ticks + k, e.path_count - 1)]
            if states[n] != 0:
                draw_normals(states[n], e.normals, e.bits, noise[:, n])
                continue
            where = e.drawn if e.drawn != 0 else drawn.ctypes.data
            call_at(e.normals, e.bits, NOISE, where)
            normals = numbers_at(where, (NOISE,))
            for i in range(NOISE):
                noise[i, n] = normals[i]
        tick_lanes(loop, work, step, axial, radial)
    put_down(kept, work)
    x, external = numbers_at(kept + STATE, (20, WIDTH)), numbers_at(loop + _EXTERNAL, (6, WIDTH))
    qpos, qvel = numbers_at(loop + _QPOS, (7, WIDTH)), numbers_at(loop + _QVEL, (6, WIDTH))
    for n in range(count):
        if resting[n]:
            continue
        episodes[n].ticks += ticks
        broken = _breaks(qpos[:, n]) or _breaks(qvel[:, n])
        if broken:  # MuJoCo starts over
            qpos[:, n], qvel[:, n] = 0.0, 0.0
            qpos[3, n] = 1.0
        look(
            x[:, n].copy(),
            external[:, n].copy(),
            qpos[:, n].copy(),
            qvel[:, n].copy(),
            broken,
            episodes[n],
        )
        reward(episodes[n], changes[n])


@compiled
def _breaks(numbers: Array) -> bool:
    """Return whether a number is so large that MuJoCo does not go on, or none."""
    for number in numbers:  # noqa: SIM110  # slower as a generator
        if not abs(number) <= _LARGEST:
            return True
    return False


@compiled_without_gil
def fly_blocks(
    loops: int,
    kept: int,
    step: int,
    axial: Array,
    radial: Array,
    episodes: np.ndarray,
    states: np.ndarray,
    commands: Array,
    resting: np.ndarray,
    ticks: int,
    tasks: np.ndarray,
    work: int,
    patience: int,
) -> None:
    """Do what ``decision.decide`` does with loops side by side, a block of them after the other.

    Args:
        loops: address of the blocks' records, of ``LOOPS``.
        kept: address of their filters', of ``ukf_lanes``.
        step: address of the step of a block of filters.
        axial: of the jet's table.
        radial: likewise.
        episodes: (n,) of ``EPISODE``; a resting one may be anything.
        states: (n,) addresses of their generators' states (``pcg_state``), or 0.
        commands: (n,) m/s.
        resting: (n,) booleans.
        ticks: of ``TICK`` s; with none the episodes are only looked at.
        tasks: a task for each block, open (``work_sharing.open_tasks``).
        work: address of a record for a block of filters in hand, this thread's own.
        patience: looks at the tasks after the last, should they open again meanwhile.
    """
    blocks = -(-len(episodes) // WIDTH)
    while True:
        b = next_task(tasks)
        if b < blocks:
            first, last = WIDTH * b, min(WIDTH * (b + 1), len(episodes))
            if not resting[first:last].all():
                _fly(
                    loops + b * _LOOP_SIZE,
                    kept + b * BLOCK_SIZE,
                    work,
                    step,
                    axial,
                    radial,
                    episodes[first:last],
                    states[first:last],
                    commands[first:last],
                    resting[first:last],
                    ticks,
                )
            task_done(tasks)
        elif not tasks_open(tasks, blocks, patience):
            stop_looking(tasks)
            break
