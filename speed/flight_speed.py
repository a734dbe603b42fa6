"""Flights against real time: the fan-tracking environment alone and side by side, and other
simulators beside it.
"""

import importlib.util
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

import numpy as np

from ..dynamics import load_vehicle
from .contenders import Contender

UNIT = "x real time"
_EVERYTHING = (
    "jet at 12 stations, gusts, motors, sensors, 200 Hz UKF, flight loop, MuJoCo at 400 Hz"
)
_DECISIONS = 128  # of a run of one environment
_TOGETHER = 512  # of a run of many, over all of them
_IN_LANES = 4096  # likewise, in lanes


def flights(counts: tuple[int, ...] = (16, 256)) -> list[Contender]:
    """Return what flies, in simulated seconds a second; peers have no wind, no sensors and no
    estimator.

    ``counts``: how many environments fly together.
    """
    cores = os.cpu_count() or 1
    out = [
        Contender("FanTracking, 1 environment", UNIT, _EVERYTHING, _single("ukf"), reference=True)
    ]
    for count in counts:
        out.append(
            Contender(
                f"FanTracking, {count} in one process",
                UNIT,
                "the same, all of them together",
                many(count),
            )
        )
        if cores > 1:
            out.append(
                Contender(
                    f"FanTracking, {count} on {cores} threads",
                    UNIT,
                    "the same",
                    many(count, threads=cores),
                )
            )
    together = counts[-1]
    out.append(
        Contender(
            f"FanTracking in lanes, {together} in one process",
            UNIT,
            "the same, MuJoCo's integrator in lanes",
            in_lanes(together),
        )
    )
    if cores > 1:
        out.append(
            Contender(
                f"FanTracking in lanes, {together} on {cores} threads",
                UNIT,
                "the same",
                in_lanes(together, threads=cores),
            )
        )
    out += [
        Contender(
            "constant gain, 1 environment",
            UNIT,
            "the same, with a filter of constant gain",
            _single("constant-gain"),
        ),
        Contender(
            f"constant gain, {counts[0]} in one process",
            UNIT,
            "the same, all of them together",
            many(counts[0], estimator="constant-gain"),
        ),
        _ant(),
    ]
    for name, peer in (("rotorpy", _rotorpy), ("PyFlyt", _pyflyt), ("crazyflow", crazyflow)):
        if importlib.util.find_spec(name):
            out.append(peer())
    return out


def _single(estimator: str) -> Callable[[], float]:
    from ..envs.fan_tracking import DECISION_TICKS, FanTrackingEnv
    from ..envs.plant import TICK

    env, action = FanTrackingEnv("base", estimator=estimator), np.zeros(1, dtype=np.float32)

    def run() -> float:
        env.reset(seed=0)
        begin = time.perf_counter()
        for _ in range(_DECISIONS):
            env.step(action)
        return _DECISIONS * DECISION_TICKS * TICK / (time.perf_counter() - begin)

    run()  # compiles
    return run


def many(
    count: int,
    threads: int = 1,
    estimator: str = "ukf",
    clock: Callable[[], float] = time.perf_counter,
) -> Callable[[], float]:
    """Return what flies ``count`` environments together and returns how many times faster than real
    time, by a clock in s.
    """
    from ..envs.vector import FanTrackingVectorEnv

    envs = FanTrackingVectorEnv(
        count, max_episode_steps=10**9, threads=threads, scenario="static", estimator=estimator
    )
    return _flying(envs, max(2, _TOGETHER // count), clock)


def in_lanes(
    count: int, threads: int = 1, clock: Callable[[], float] = time.perf_counter
) -> Callable[[], float]:
    """Return the same of environments in the lanes of a vector unit."""
    from ..envs.lanes.vector import FanTrackingLanes

    envs = FanTrackingLanes(count, 10**9, threads, scenario="static")
    return _flying(envs, max(2, _IN_LANES // count), clock)


def _flying(envs: Any, steps: int, clock: Callable[[], float]) -> Callable[[], float]:
    """Return what flies environments of which the fan stands still: it never leaves the vehicle
    behind, so that no reset falls into a run.
    """
    from ..envs.fan_tracking import DECISION_TICKS
    from ..envs.plant import TICK

    count = envs.num_envs
    actions = np.zeros((count, 1), dtype=np.float32)
    envs.reset(seed=0)

    def run() -> float:
        begin = clock()
        for _ in range(steps):
            envs.step(actions)
        return float(count * steps * DECISION_TICKS * TICK / (clock() - begin))

    return run


def many_us(count: int) -> Callable[[], float]:
    """Return what flies ``count`` environments and returns the time of one environment's tick in
    us.
    """
    from ..envs.plant import TICK

    run = many(count)
    return lambda: 1e6 * TICK / run()


def _ant() -> Contender:
    import gymnasium as gym

    ant = gym.make("Ant-v5")
    action = np.zeros(ant.action_space.shape or (), dtype=np.float32)

    def run(steps: int = 60) -> float:
        ant.reset(seed=0)
        begin = time.perf_counter()
        for _ in range(steps):
            ant.step(action)
        return steps * float(ant.unwrapped.dt) / (time.perf_counter() - begin)  # type: ignore[attr-defined]

    return Contender("Gymnasium Ant-v5", UNIT, "MuJoCo at 100 Hz with contacts", run)


def _rotorpy() -> Contender:
    from rotorpy.vehicles.hummingbird_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor

    vehicle = Multirotor(quad_params)
    command = {"cmd_motor_speeds": np.full(4, load_vehicle("hummingbird").hover_rate)}

    def run(steps: int = 60) -> float:
        state = vehicle.initial_state
        begin = time.perf_counter()
        for _ in range(steps):
            state = vehicle.step(state, command, 0.01)
        return steps * 0.01 / (time.perf_counter() - begin)

    return Contender(
        f"RotorPy {version('rotorpy')}", UNIT, "rigid body, motors and aerodynamics at 100 Hz", run
    )


def _pyflyt() -> Contender:
    from PyFlyt.core import Aviary

    world: Any = Aviary(
        start_pos=np.array([[0.0, 0.0, 1.0]]),
        start_orn=np.zeros((1, 3)),
        drone_type="quadx",
        render=False,
    )
    world.set_mode(7)  # a position is held

    def run(steps: int = 60) -> float:
        world.reset()
        world.set_mode(7)
        world.set_setpoint(0, np.array([0.0, 0.0, 0.0, 1.0]))
        begin, start = time.perf_counter(), world.elapsed_time
        for _ in range(steps):
            world.step()
        return float(world.elapsed_time - start) / (time.perf_counter() - begin)

    return Contender(
        f"PyFlyt {version('PyFlyt')}",
        UNIT,
        "PyBullet at 240 Hz, motors, a position controller",
        run,
    )


# crazyflow wants a setting of SciPy's that must be there before SciPy is imported: a process of its
# own, one run a line
_CRAZYFLOW = """
import sys, time
import jax, numpy as np
from crazyflow.sim import Sim
count, ticks = {count}, 50
world = Sim(n_worlds=count)
command = np.zeros((count, 1, 4), dtype=np.float32)  # level, 0.3 N
command[..., 3] = 0.3
def run():
    world.attitude_control(command)
    jax.block_until_ready(world.data.states.pos)
    begin = time.{clock}()
    world.step(ticks)
    jax.block_until_ready(world.data.states.pos)
    return count * ticks / float(world.freq) / (time.{clock}() - begin)
run()  # compiles
for line in sys.stdin:
    print("measured", run(), flush=True)
"""


def crazyflow(count: int = 1024, clock: str = "perf_counter") -> Contender:
    """Return crazyflow's batch of vehicles, by a clock of ``time``; it must be installed."""
    worker: list[subprocess.Popen[str]] = []

    def run() -> float:
        if not worker:
            worker.append(
                subprocess.Popen(
                    [sys.executable, "-c", _CRAZYFLOW.format(count=count, clock=clock)],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.DEVNULL,
                    text=True,
                    env=os.environ | {"SCIPY_ARRAY_API": "1"},
                    cwd=tempfile.gettempdir(),
                )
            )  # where MuJoCo's log of its warnings goes
        to, back = worker[0].stdin, worker[0].stdout
        assert to is not None
        assert back is not None
        to.write("\n")
        to.flush()
        for line in back:  # its libraries print, too
            if line.startswith("measured"):
                return float(line.split()[1])
        raise RuntimeError("crazyflow: the measurement ended without a result")

    return Contender(
        f"crazyflow {version('crazyflow')}, {count} vehicles",
        UNIT,
        "its default dynamics and attitude controller at 500 Hz in JAX, on all cores",
        run,
    )
