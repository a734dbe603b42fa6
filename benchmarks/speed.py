"""How fast: one filter step, flights against real time, and start-up, side by side with peers that are installed.

Every round runs all contenders one after the other, so that a machine whose speed drifts slows all of them; figures are
medians over rounds, and ratios are taken round by round. One process, one thread.
"""

import importlib.util
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

from ..dynamics import load_vehicle
from ..dynamics.files import replaced
from ..estimator import NonlinearObserver, UKFTuning, WrenchEKF, WrenchUKF
from .filter_step import PERIOD, PeerFilter, make_run, time_step


@dataclass(frozen=True)
class Contender:
    """Something that is timed; ``run`` returns its figure once."""

    name: str
    unit: str  # "us a step", "x real time" or "s"
    includes: str
    run: Callable[[], float]
    reference: bool = False  # the one that the others of its unit are compared with


@dataclass(frozen=True)
class Figure:
    """What a contender came to over the rounds, and its ratio to the reference of its unit: median, least, largest."""

    contender: Contender
    value: tuple[float, float, float]
    ratio: tuple[float, float, float]


def filters() -> list[Contender]:
    """Return the filters, and filterpy's where it is installed."""
    vehicle, tuning, run = load_vehicle("ardrone2"), UKFTuning(), make_run(2000)
    out = []
    for name, estimator, includes in (
        ("WrenchUKF", WrenchUKF(vehicle, tuning, PERIOD), "predict, correct, copy of state and covariance"),
        ("WrenchEKF", WrenchEKF(vehicle, tuning, PERIOD), "the same"),
        ("NonlinearObserver", NonlinearObserver(vehicle, None, PERIOD), "no covariance"),
    ):
        time_step(estimator, run, 3)  # compiles
        out.append(Contender(name, "us a step", includes, lambda e=estimator: 1e6 * time_step(e, run, 2000),  # type: ignore[misc]
                             reference=name == "WrenchUKF"))
    if importlib.util.find_spec("filterpy"):
        for words, by_component in (("numpy.cross", False), ("by component", True)):
            peer = PeerFilter(vehicle, tuning, PERIOD, by_component)
            out.append(Contender(f"filterpy {version('filterpy')} UKF, {words}", "us a step", "the same state and model",
                                 lambda p=peer: 1e6 * time_step(p, run, 60)))  # type: ignore[misc]
    return out


def flights() -> list[Contender]:
    """Return what flies, in simulated seconds a second; peers have no wind, no sensors and no estimator."""
    import gymnasium as gym

    from ..envs.fan_tracking import DECISION_TICKS, FanTrackingEnv
    from ..envs.plant import TICK
    from ..envs.vector import FanTrackingVectorEnv

    def ours(decisions: int = 120) -> float:
        single.reset(seed=0)
        action = np.zeros(1, dtype=np.float32)
        begin = time.perf_counter()
        for _ in range(decisions):
            single.step(action)
        return decisions * DECISION_TICKS * TICK / (time.perf_counter() - begin)

    def many(decisions: int = 12) -> float:
        several.reset(seed=0)
        actions = np.zeros((16, 1), dtype=np.float32)
        begin = time.perf_counter()
        for _ in range(decisions):
            several.step(actions)
        return 16 * decisions * DECISION_TICKS * TICK / (time.perf_counter() - begin)

    single, several = FanTrackingEnv("base"), FanTrackingVectorEnv(16, scenario="base")
    everything = "jet at 12 stations, gusts, motors, sensors, 200 Hz UKF, flight loop, MuJoCo at 400 Hz"
    ours(2)
    out = [Contender("FanTracking, 1 environment", "x real time", everything, ours, reference=True),
           Contender("FanTracking, 16 in one process", "x real time", "the same, all of them together", many)]
    ant = gym.make("Ant-v5")

    def ant_run(steps: int = 60) -> float:
        ant.reset(seed=0)
        action = np.zeros(ant.action_space.shape or (), dtype=np.float32)
        begin = time.perf_counter()
        for _ in range(steps):
            ant.step(action)
        return steps * float(ant.unwrapped.dt) / (time.perf_counter() - begin)  # type: ignore[attr-defined]

    out.append(Contender("Gymnasium Ant-v5", "x real time", "MuJoCo at 100 Hz with contacts", ant_run))
    if importlib.util.find_spec("rotorpy"):
        out.append(_rotorpy())
    return out


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

    return Contender(f"RotorPy {version('rotorpy')}", "x real time", "rigid body, motors and aerodynamics at 100 Hz", run)


def starts() -> list[Contender]:
    """Return the times from a fresh process to the package, and to the first step of an environment."""
    def fresh(code: str) -> float:
        done = subprocess.run([sys.executable, "-c", f"import time; t = time.perf_counter()\n{code}\n"
                               "print(time.perf_counter() - t)"], capture_output=True, text=True, check=True)
        return float(done.stdout.split()[-1])

    step = ("import gymnasium, windwrench\nenv = gymnasium.make('windwrench/FanTracking-v0')\nenv.reset(seed=0)\n"
            "env.step(env.action_space.sample())")
    return [Contender("import windwrench", "s", "a fresh process", lambda: fresh("import windwrench"), reference=True),
            Contender("first make, reset and step", "s", "a fresh process, compiled code on disk", lambda: fresh(step))]


def measure(contenders: list[Contender], rounds: int, advance: Callable[[], None] = lambda: None) -> list[Figure]:
    """Run all contenders in turn ``rounds`` times; ``advance`` is called after each run."""
    values: list[list[float]] = [[] for _ in contenders]
    for _ in range(rounds):
        for kept, contender in zip(values, contenders, strict=True):
            kept.append(contender.run())
            advance()
    references = {c.unit: kept for c, kept in zip(contenders, values, strict=True) if c.reference}

    def spread(numbers: list[float]) -> tuple[float, float, float]:
        return statistics.median(numbers), min(numbers), max(numbers)

    return [Figure(c, spread(kept), spread([v / r for v, r in zip(kept, references[c.unit], strict=True)]))
            for c, kept in zip(contenders, values, strict=True)]


def rows_of(figures: list[Figure]) -> list[list[str]]:
    """Return the figures as the cells of a table: name, figure, spread, ratio to the reference, what it includes."""
    out = []
    for f in figures:
        digits = 2 if f.contender.unit == "s" else 1 if f.value[0] < 100 else 0
        value, low, high = (f"{v:.{digits}f}" for v in f.value)
        ratio = "1" if f.contender.reference else f"{f.ratio[0]:.3g} ({f.ratio[1]:.3g} - {f.ratio[2]:.3g})"
        out.append([f.contender.name, f"{value} {f.contender.unit}", f"{low} - {high}", ratio, f.contender.includes])
    return out


HEADER = ["what", "median", "least - largest", "ratio to the first of its kind", "includes"]


def write_markdown(figures: list[Figure], rounds: int, path: Path) -> None:
    """Write a run as a page."""
    lines = ["# Speed", "", f"One run of `windwrench speed --rounds {rounds} --markdown docs/speed.md`: one process, all "
             "contenders in turn in every round; medians, with ratios taken round by round. Peers are measured where they are "
             "installed.", "",
             f"Python {platform.python_version()}, " + ", ".join(f"{n} {version(n)}" for n in ("numpy", "numba", "mujoco"))
             + f", {platform.machine()}.", "", f"| {' | '.join(HEADER)} |", f"|{' --- |' * len(HEADER)}"]
    lines += [f"| {' | '.join(row)} |" for row in rows_of(figures)]
    lines += ["", "filterpy's filter has 37 sigma points and additive noise; its model is measured as one writes it down, with "
              "vectors and `numpy.cross`, and with every product by component in plain Python numbers. "
              "`python -m windwrench.benchmarks.filter_step` prints how far it agrees with `WrenchUKF`.", ""]
    with replaced(path) as partial:
        partial.write_text("\n".join(lines), encoding="utf-8")
