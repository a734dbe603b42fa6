"""Where the time of an environment's step goes: its parts, each repeated by itself on the state of
a flight.
"""

import time
from collections.abc import Callable

import numpy as np

from ..controllers.flight import fly, move_setpoint
from ..dynamics.motion import Array
from ..envs.closed_loop import ESTIMATORS, ClosedLoop
from ..envs.fan import gust, jet_wrench
from ..envs.fan_tracking import DECISION_TICKS, FanTrackingEnv
from ..envs.plain_steps import normals_of
from ..envs.plant import NOISE, SUBSTEPS, TICK, actuate, sense
from ..runtime.addresses import call_at, call_step
from ..runtime.compiled import compiled_without_gil
from .contenders import Section

_REPEATS = 2000  # ticks


@compiled_without_gil
def _filter(loops: np.ndarray, count: int) -> None:
    loop = loops[0]
    for _ in range(count):
        call_step(loop.step, loop.filter, 3, TICK, loop.plant.battery)


@compiled_without_gil
def _jet(
    loops: np.ndarray,
    axial: Array,
    radial: Array,
    qpos: Array,
    qvel: Array,
    noise: Array,
    count: int,
) -> None:
    loop = loops[0]
    plant, fan = loop.plant, loop.fan
    for _ in range(count):
        gust(fan, noise[:36])
        jet_wrench(
            fan,
            axial,
            radial,
            qpos[0:3],
            plant.rotation,
            qvel[0:3],
            qvel[3:6],
            plant.body.com,
            plant.scratch,
            plant.jet,
        )


@compiled_without_gil
def _plant(
    loops: np.ndarray,
    axial: Array,
    radial: Array,
    qpos: Array,
    qvel: Array,
    noise: Array,
    xfrc: Array,
    count: int,
) -> None:
    loop = loops[0]
    plant, flight, x = loop.plant, loop.flight, loop.filter.x
    for _ in range(count):
        plant.seen = sense(plant, qpos, noise)
        move_setpoint(flight, x, TICK)
        fly(flight, x, TICK)
        actuate(plant, flight.command, loop.fan, axial, radial, qpos, qvel, noise, xfrc)


@compiled_without_gil
def _mujoco(loops: np.ndarray, count: int) -> None:
    loop = loops[0]
    for _ in range(count * SUBSTEPS):
        call_at(loop.mj_step, loop.model, loop.data)


@compiled_without_gil
def _normals(function: int, bits: int, out: Array, count: int) -> None:
    for _ in range(count):
        call_at(function, bits, out.size, out.ctypes.data)


def _per_tick(work: Callable[[], object], ticks: int) -> float:
    begin = time.perf_counter()
    work()
    return 1e6 * (time.perf_counter() - begin) / ticks


def profile(rounds: int = 5, estimator: str = "ukf") -> Section:
    """Return the parts of a step of one environment, in us a tick of 5 ms and as shares: the least
    of several rounds.
    """
    env, action = FanTrackingEnv("static", estimator=estimator), np.zeros(1, dtype=np.float32)
    env.reset(seed=0)
    loop = env.loop
    assert isinstance(loop, ClosedLoop)
    rng, noise = np.random.default_rng(0), np.zeros(NOISE)
    q, v = (part.copy() for part in loop.motion)
    copy = loop.record.copy()  # the parts run on it, the flight goes on as it was
    copy["plant"]["seen"] = 3
    twin = ClosedLoop(env.vehicle, drawn=False)  # for MuJoCo alone
    twin.reset(rng, q[:3])
    normals = normals_of(rng, noise.size)

    def look_on() -> None:
        for _ in range(100):
            env._decide(0)
            env.observation()
            env._info()

    def fly_on() -> None:
        for _ in range(12):
            env.step(action)

    parts: dict[str, Callable[[], float]] = {
        f"filter ({estimator})": lambda: _per_tick(lambda: _filter(copy, _REPEATS), _REPEATS),
        "jet and gusts": lambda: _per_tick(
            lambda: _jet(copy, *loop.jet_table, q, v, noise, _REPEATS), _REPEATS
        ),
        "MuJoCo": lambda: _per_tick(lambda: _mujoco(twin.record, _REPEATS), _REPEATS),
        "random numbers": lambda: _per_tick(
            lambda: _normals(normals.function, normals.bits, noise, _REPEATS), _REPEATS
        ),
        "reward, info, Python": lambda: _per_tick(look_on, 100 * DECISION_TICKS),
        "motors, sensors, flight loop": lambda: _per_tick(
            lambda: _plant(copy, *loop.jet_table, q, v, noise, np.zeros(6), _REPEATS), _REPEATS
        ),
        "whole": lambda: _per_tick(fly_on, 12 * DECISION_TICKS),
    }
    times: dict[str, list[float]] = {name: [] for name in parts}
    for k in range(rounds + 1):
        for name, work in parts.items():
            taken = work()
            if k > 0:  # the first compiles
                times[name].append(taken)
    least = {name: min(values) for name, values in times.items()}
    rest = "motors, sensors, flight loop"
    least[rest] = max(least[rest] - least["jet and gusts"], 0.0)  # it contains them
    whole = least.pop("whole")
    least["what the parts disturb in each other"] = max(whole - sum(least.values()), 0.0)
    largest = max(least, key=lambda name: least[name])
    rows = [
        [name, f"{value:.2f}", f"{value / whole:.0%}"]
        for name, value in sorted(least.items(), key=lambda p: -p[1])
    ]
    rows.append(["whole step", f"{whole:.2f}", "100%"])
    without = TICK * 1e6 / (whole - least[largest])
    return Section(
        f"Where the time goes: {estimator}",
        ["part", "us a tick", "share"],
        rows,
        f"One environment, a tick of 5 ms: {TICK * 1e6 / whole:.0f} times real time. The next "
        f"limit is: {largest}; "
        f"if that cost nothing, it would be {without:.0f} times real time.",
    )


def profiles(rounds: int) -> list[Section]:
    """Return the profile with each estimator."""
    return [profile(rounds, name) for name in ESTIMATORS]
