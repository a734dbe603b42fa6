"""How fast fan-tracking environments fly in lanes: ``python -m windwrench.speed.lane_speed``.

In turn in every round: environments on MuJoCo and in lanes, all with the full filter, and
crazyflow's batch where it is installed; and the parts of a tick in lanes. Simulated seconds a
second of processor time, that of all threads together: what a core does, whoever else uses the
machine.
"""

import argparse
import importlib.util
import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numba import types

from ..dynamics.motion import Array
from ..envs.fan_tracking import FanTrackingEnv
from ..envs.lanes.flight import tick_lanes
from ..envs.lanes.memory import Blocks
from ..envs.plant import NOISE
from ..estimator.ukf_lanes import new_work, take_up
from ..runtime.addresses import address_of, call_at
from ..runtime.compiled import compiled_without_gil
from ..runtime.page_files import write_text
from ..runtime.pcg_normals import draw_normals, pcg_state
from ..runtime.random_normals import bits_address, normals_address
from ..runtime.vector_lanes import WIDTH
from .contenders import HEADER, Contender, Section, measure, rows_of
from .flight_speed import UNIT, crazyflow, in_lanes, many

_TICKS = 400
_BOUNDS = "<!-- speed: begin -->\n", "<!-- speed: end -->"


def contenders(count: int = 256) -> list[Contender]:
    """Return what flies, one environment on MuJoCo first, by the time of all processors."""
    cores, clock = os.cpu_count() or 1, time.process_time
    full = "full filter, jet, noise, sensors, flight loop"
    out = [
        Contender("MuJoCo, 1 environment", UNIT, full, many(1, clock=clock), reference=True),
        Contender(f"MuJoCo, {count}, one thread", UNIT, full, many(count, clock=clock)),
        Contender(f"MuJoCo, {count}, {cores} threads", UNIT, full, many(count, cores, clock=clock)),
        *(
            Contender(f"lanes, {n}, one thread", UNIT, full, in_lanes(n, clock=clock))
            for n in (16, count)
        ),
        Contender(
            f"lanes, {count}, {cores} threads", UNIT, full, in_lanes(count, cores, clock=clock)
        ),
    ]
    if importlib.util.find_spec("crazyflow"):
        out.append(crazyflow(clock="process_time"))
    return out


@compiled_without_gil
def _ticks(loop: int, work: int, step: int, axial: Array, radial: Array, count: int) -> None:
    for _ in range(count):
        tick_lanes(loop, work, step, axial, radial)


@compiled_without_gil
def _steps(step: int, work: int, count: int) -> None:
    for _ in range(count):
        call_at(step, work)


@compiled_without_gil
def _normals(state: int, function: int, bits: int, out: Array, count: int) -> None:
    for k in range(count):
        draw_normals(state, function, bits, out[:, k % WIDTH])


@compiled_without_gil
def _hold(kept: int, work: int) -> None:
    take_up(kept, work)


def _nothing(_address: int) -> None:
    return


def parts(rounds: int) -> Section:
    """Return the parts of a tick of one environment in lanes, in us of processor time: the least of
    several rounds.
    """
    env = FanTrackingEnv("static")
    rng = np.random.default_rng(0)
    loop = env.hover(rng)[1]
    still = Blocks(1, loop)
    work = new_work(loop.ukf.record)
    at, kept, step, axial, radial = still.given()
    _hold(kept, work.ctypes.data)
    nothing = address_of(_nothing, types.void(types.int64))
    start = still.loops.copy()
    noise = np.zeros((NOISE, WIDTH))
    drawn = pcg_state(rng), normals_address(), bits_address(rng), noise

    def tick(function: int, filtered: int) -> None:
        still.loops[:] = start  # in the jet, at hover
        for _ in range(filtered):
            _ticks(at, work.ctypes.data, function, axial, radial, _TICKS // filtered)
            still.loops[:] = start

    runs: dict[str, Callable[[], None]] = {
        "filter": lambda: _steps(step, work.ctypes.data, _TICKS),
        "jet, gusts, motors, sensors, flight loop, rigid body": lambda: tick(nothing, 20),
        "random numbers": lambda: _normals(*drawn, _TICKS * WIDTH),
    }
    whole = in_lanes(256, clock=time.thread_time)
    whole()
    taken: dict[str, list[float]] = {name: [] for name in (*runs, "whole")}
    for k in range(rounds + 1):
        for name, run in runs.items():
            begin = time.thread_time()
            run()
            if k:  # the first compiles
                taken[name].append(1e6 * (time.thread_time() - begin) / (_TICKS * WIDTH))
        if k:
            taken["whole"].append(5000.0 / whole())
    least = {name: min(values) for name, values in taken.items()}
    total = least.pop("whole")
    least["the parts beside each other, reward, info, Python"] = max(
        total - sum(least.values()), 0.0
    )
    rows = [[name, f"{v:.2f}", f"{v / total:.0%}"] for name, v in least.items()]
    return Section(
        f"A tick in lanes, {WIDTH} to a register",
        ["part", "us a tick", "share"],
        [*rows, ["whole step, 256 environments", f"{total:.2f}", "100%"]],
        f"{5000.0 / total:.0f} times real time a core, by processor time.",
    )


def main() -> None:
    """Print the tables, and put them on a page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--page", type=Path)
    given = parser.parse_args()
    rows = rows_of(measure(contenders(), given.rounds))
    section = parts(given.rounds)
    lines = [
        *(f"| {' | '.join(row)} |" for row in (HEADER, ["---"] * len(HEADER), *rows)),
        "",
        f"{section.title}, us of processor time, the least of {given.rounds} rounds:",
        "",
        *(
            f"| {' | '.join(row)} |"
            for row in (section.header, ["---"] * len(section.header), *section.rows)
        ),
        "",
        section.words,
    ]
    text = "\n".join(lines)
    print(text)
    if given.page is not None:
        page = given.page.read_text(encoding="utf-8")
        before, rest = page.split(_BOUNDS[0])
        write_text(
            f"{before}{_BOUNDS[0]}\n{text}\n\n{_BOUNDS[1]}{rest.split(_BOUNDS[1])[1]}", given.page
        )


if __name__ == "__main__":
    main()
