"""Whole programs in processes of their own: start-up, a log that is read, a diagnosis, a tracker's
decision.
"""

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from .contenders import Contender

_FIRST_STEP = """
import gymnasium, windwrench
env = gymnasium.make("windwrench/FanTracking-v0")
env.reset(seed=0)
env.step(env.action_space.sample())
"""
_SECONDS = 60.0  # of the flight that is read and diagnosed
_EPISODE = 900_001  # seed of a validation episode


def starts() -> list[Contender]:
    """Return the times of a fresh process to the package and to an environment's first step."""
    step = "a fresh process, compiled code on disk"
    return [
        Contender("import windwrench", "s", "a fresh process", _fresh("import windwrench")),
        Contender("first make, reset and step", "s", step, _fresh(_FIRST_STEP)),
    ]


def _fresh(code: str) -> Callable[[], float]:
    def run() -> float:
        timed = f"import time; t = time.perf_counter()\n{code}\nprint(time.perf_counter() - t)"
        command = [sys.executable, "-c", timed]
        return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)

    return run


def logs(folder: Path) -> list[Contender]:
    """Return the times to read a flight in each form that logs have, and to diagnose one."""
    from ..identification.logs.flight_log import write_log
    from ..identification.logs.reading import read_log

    first = folder / "flight.csv"
    _windwrench("record", "--effect", "rotor_drag", "--seconds", f"{_SECONDS:g}", "--out", first)
    recorded = read_log(first)
    words = f"{_SECONDS:g} s of flight at 200 Hz, read and checked"
    found = []
    for suffix in (".csv", ".csv.gz", ".parquet"):
        file = first.with_suffix(suffix)
        write_log(recorded, file)
        found.append(Contender(f"reading {suffix}", "s", words, _timed(lambda f=file: read_log(f))))  # type: ignore[misc]
    diagnose = "diagnose", first, "--vehicle", "ardrone2", "--out", folder / "diagnosis"
    words = f"a fresh process, {_SECONDS:g} s of flight, to the written report"
    return [*found, Contender("diagnosis", "s", words, _timed(lambda: _windwrench(*diagnose)))]


def _windwrench(*words: object) -> None:
    command = [sys.executable, "-m", "windwrench", *map(str, words), "--quiet"]
    subprocess.run(command, check=True)


def _timed(work: Callable[[], object]) -> Callable[[], float]:
    def run() -> float:
        begin = time.perf_counter()
        work()
        return time.perf_counter() - begin

    return run


def decisions() -> list[Contender]:
    """Return the time within which the trackers take 99 % of their decisions of an episode."""
    from ..controllers import make_controller
    from ..envs.fan_tracking import FanTrackingEnv
    from ..evaluation.episodes import fly_episode

    env = FanTrackingEnv("base")
    found = []
    for name in ("tracker", "tracker-informed"):
        pilot = make_controller(name)
        seen = fly_episode(env, pilot, _EPISODE).observation

        def run(pilot: object = pilot, seen: np.ndarray = seen) -> float:
            pilot.brief(env.briefing())  # type: ignore[attr-defined]
            pilot.reset()  # type: ignore[attr-defined]
            taken = []
            for observation in seen:
                begin = time.process_time()
                pilot(observation)  # type: ignore[operator]
                taken.append(1e3 * (time.process_time() - begin))
            return float(np.quantile(taken, 0.99))

        found.append(Contender(f"{name}, a decision", "ms", "99 % of an episode's, CPU time", run))
    return found
