"""Flights against real time: the tasks alone, side by side and in lanes, and other simulators."""

import importlib.util
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

import gymnasium as gym
import numpy as np

from ..dynamics import load_vehicle
from .contenders import Contender

UNIT = "x real time"
_EVERYTHING = (
    "jet at 12 stations, gusts, motors, sensors, 200 Hz UKF, flight loop, MuJoCo at 400 Hz"
)
_DECISIONS = 128  # of a run of one environment
_TOGETHER = 512  # of a run of many environments, over all of them
_IN_LANES = 4096  # likewise, in lanes
# task, scenario and s between decisions of the tasks that fly in wind
_WINDY = (
    ("FanTracking2D", "base", 0.08),
    ("WindHover", "base", 0.04),
    ("WindHover", "turbulent", 0.04),
    ("WindTrajectory", "base", 0.04),
)


def flights(count: int = 256) -> list[Contender]:
    """Return what flies, in simulated seconds a second; ``count`` environments fly together.

    Peers have no wind, no sensors and no estimator; those that are not installed are left out.
    """
    cores, same = os.cpu_count() or 1, "the same, all of them together"
    lanes = "the same, MuJoCo's integrator in lanes"
    found = [
        Contender("FanTracking, 1", UNIT, _EVERYTHING, alone("FanTracking", "static", 0.08)),
        Contender(f"FanTracking, {count}", UNIT, same, together(count)),
        Contender(f"FanTracking, {count} in lanes", UNIT, lanes, in_lanes(count)),
    ]
    if cores > 1:
        on = f"on {cores} threads"
        found += [
            Contender(f"FanTracking, {count} {on}", UNIT, same, together(count, cores)),
            Contender(f"FanTracking, {count} in lanes {on}", UNIT, lanes, in_lanes(count, cores)),
        ]
    run = alone("FanTracking", "static", 0.08, estimator="constant-gain")
    found.append(Contender("FanTracking, 1, constant gain", UNIT, "a constant-gain filter", run))
    found += [
        Contender(f"{task}, {scenario}, 1", UNIT, "full filter", alone(task, scenario, period))
        for task, scenario, period in _WINDY
    ]
    ant = "MuJoCo at 100 Hz with contacts"
    found.append(Contender("Gymnasium Ant-v5", UNIT, ant, _stepping(gym.make("Ant-v5"), 0.05, 60)))
    for name, peer in (("rotorpy", _rotorpy), ("PyFlyt", _pyflyt), ("crazyflow", _crazyflow)):
        if importlib.util.find_spec(name):
            found.append(peer())
    return found


def alone(task: str, scenario: str, period: float, **more: Any) -> Callable[[], float]:
    """Return a run of one environment, ``period`` s between decisions; the run returns how many
    times faster than real time the environment flew.
    """
    name = f"windwrench:windwrench/{task}-v0"
    env = gym.make(name, scenario=scenario, disable_env_checker=True, **more)
    return _stepping(env.unwrapped, period, _DECISIONS)


def _stepping(env: Any, period: float, steps: int) -> Callable[[], float]:
    """Return a run of ``steps`` decisions of an environment or of several, ``period`` s of flight
    each, over all of them.
    """
    action = np.zeros(env.action_space.shape, dtype=np.float32)

    def run() -> float:
        env.reset(seed=0)
        begin = time.perf_counter()
        for _ in range(steps):
            env.step(action)
        return steps * period / (time.perf_counter() - begin)

    run()  # compiles
    return run


def together(count: int, threads: int = 1) -> Callable[[], float]:
    """Return a run of ``count`` environments that step together; their fans stand still and leave
    no vehicle behind, so that no reset falls into a run.
    """
    from ..envs.vector import TaskVectorEnv

    envs = TaskVectorEnv(count, max_episode_steps=10**9, threads=threads, scenario="static")
    return _stepping(envs, 0.08 * count, max(2, _TOGETHER // count))


def in_lanes(count: int, threads: int = 1) -> Callable[[], float]:
    """Return the same in the lanes of a vector unit."""
    from ..envs.lanes.vector import TaskLanes

    envs = TaskLanes(count, 10**9, threads, scenario="static")
    return _stepping(envs, 0.08 * count, max(2, _IN_LANES // count))


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

    words = "rigid body, motors and aerodynamics at 100 Hz"
    return Contender(f"RotorPy {version('rotorpy')}", UNIT, words, run)


def _pyflyt() -> Contender:
    from PyFlyt.core import Aviary

    start, level = np.array([[0.0, 0.0, 1.0]]), np.zeros((1, 3))
    world: Any = Aviary(start_pos=start, start_orn=level, drone_type="quadx", render=False)

    def run(steps: int = 60) -> float:
        world.reset()
        world.set_mode(7)  # a position is held
        world.set_setpoint(0, np.array([0.0, 0.0, 0.0, 1.0]))
        begin, before = time.perf_counter(), world.elapsed_time
        for _ in range(steps):
            world.step()
        return float(world.elapsed_time - before) / (time.perf_counter() - begin)

    words = "PyBullet at 240 Hz, motors, a position controller"
    return Contender(f"PyFlyt {version('PyFlyt')}", UNIT, words, run)


# crazyflow wants a setting of SciPy's before SciPy is imported: a process of its own, a run a line
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
    begin = time.perf_counter()
    world.step(ticks)
    jax.block_until_ready(world.data.states.pos)
    return count * ticks / float(world.freq) / (time.perf_counter() - begin)
run()  # compiles
for line in sys.stdin:
    print("measured", run(), flush=True)
"""


def _crazyflow(count: int = 1024) -> Contender:
    worker = subprocess.Popen(
        [sys.executable, "-c", _CRAZYFLOW.format(count=count)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=os.environ | {"SCIPY_ARRAY_API": "1"},
        cwd=tempfile.gettempdir(),  # where MuJoCo writes its warnings
    )

    def run() -> float:
        to, back = worker.stdin, worker.stdout
        assert to is not None
        assert back is not None
        print(file=to, flush=True)
        for line in back:  # its libraries print, too
            if line.startswith("measured"):
                return float(line.split()[1])
        raise RuntimeError("crazyflow: the measurement ended without a result")

    words = "its default dynamics and attitude controller at 500 Hz in JAX, on all cores"
    return Contender(f"crazyflow {version('crazyflow')}, {count} vehicles", UNIT, words, run)
