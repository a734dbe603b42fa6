"""``python -m evidence.speed`` measures processor times of the kit, beside Gymnasium's Ant.

Every round runs all contenders of a group one after the other: a machine whose speed drifts slows
all of them alike. Ratios are taken round by round, and one thread does the work.
"""

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from typing import Annotated, Any, NamedTuple

import gymnasium as gym
import numpy as np
import typer

from windwrench.dynamics import load_vehicle
from windwrench.estimator import ConstantGainFilter, WrenchUKF, WrenchUKFBatch
from windwrench.evidence.runner import start
from windwrench.identification.logs.flight_log import write_log
from windwrench.identification.logs.reading import read_log
from windwrench.runtime.errors import unknown_name
from windwrench.runtime.page_files import write_text
from windwrench.runtime.provenance import commit, made_by

STEP, REAL_TIME, SECONDS = "us a step", "x real time", "s"
BEGIN, END = "<!-- measured -->\n", "<!-- end of what was measured -->"  # of the table of a page
ROW = "| {} | {:.3g} {} | {:.3g} - {:.3g} | {:.3g} ({:.3g} - {:.3g}) | {} |"
HEADER = "| what | median | least - largest | ratio to the first of its kind | includes |"
FIRST_STEP = """import gymnasium, windwrench
env = gymnasium.make("windwrench/FanTracking-v1")
env.reset(seed=0)
env.step(env.action_space.sample())"""
# task, scenario and s between decisions
FLOWN = (
    ("FanTracking", "static", 0.08),
    ("FanTracking2D", "base", 0.08),
    ("WindHover", "turbulent", 0.04),
    ("WindTrajectory", "base", 0.04),
)


class Contender(NamedTuple):
    """One thing that is timed; ``run`` does the work once and returns the figure."""

    name: str
    unit: str
    includes: str
    run: Callable[[], float]


def rows(contenders: list[Contender], rounds: int) -> list[str]:
    """Run all contenders in turn ``rounds`` times; return the rows of their table."""
    values = np.array([[one.run() for one in contenders] for _ in range(rounds)]).T
    units = [one.unit for one in contenders]
    found = []
    for one, kept in zip(contenders, values, strict=True):
        first = values[units.index(one.unit)]
        median, low, high = np.quantile(kept, [0.5, 0.0, 1.0])
        middle, least, most = np.quantile(kept / first, [0.5, 0.0, 1.0])
        numbers = median, one.unit, low, high, middle, least, most
        found.append(ROW.format(one.name, *numbers, one.includes))
    return found


def seconds(work: Callable[[], object]) -> float:
    """Return the processor time of some work, with the programs that it starts: other load on the
    machine counts little.
    """
    begin = processor_time()
    work()
    return processor_time() - begin


def processor_time() -> float:
    """Return the processor time of this process and its ended programs, s."""
    return time.process_time() + sum(getrusage(RUSAGE_CHILDREN)[:2])


def stepping(made: Any, sample: Any, pose: Any, count: int) -> Callable[[], float]:
    """Return a run of 2000 steps of one of ``count`` filters that step together."""
    steps = 2000 // count
    made.reset(*pose)
    made.step(*sample)
    return lambda: (
        1e6 / (steps * count) * seconds(lambda: [made.step(*sample) for _ in range(steps)])
    )


def filters() -> list[Contender]:
    """Return the filters, hovering at 200 Hz with a pose at every step."""
    vehicle, count = load_vehicle("ardrone2"), 256
    pose = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0, 0.0])
    given = np.full(4, vehicle.hover_rate), *pose
    tiled = [np.tile(part, (count, 1)) for part in given]
    alone, together = "predict, correct, copy of the estimate", "the same, of each of 256"
    found = [
        Contender(kind.__name__, STEP, alone, stepping(kind(vehicle), given, pose, 1))
        for kind in (WrenchUKF, ConstantGainFilter)
    ]
    for precision in ("double", "single"):
        batch = WrenchUKFBatch(vehicle, count, precision=precision)
        run = stepping(batch, tiled, pose, count)
        found.append(Contender(f"WrenchUKFBatch, {precision}", STEP, together, run))
    return found


def flight(name: str, includes: str, env: Any, period: float, count: int, steps: int) -> Contender:
    """Return decisions, ``period`` s apart, of ``count`` environments that step together."""
    action = np.zeros(env.action_space.shape, dtype=np.float32)

    def run() -> float:
        env.reset(seed=0)
        return count * steps * period / seconds(lambda: [env.step(action) for _ in range(steps)])

    run()
    return Contender(name, REAL_TIME, includes, run)


def flights() -> list[Contender]:
    """Return what flies, in simulated seconds a second; MuJoCo at 400 Hz, a filter at 200 Hz."""
    found = []
    for name, scenario, period in FLOWN:
        for gain in ("ukf", "constant-gain"):
            env = gym.make(f"windwrench/{name}-v1", scenario=scenario, estimator=gain)
            found.append(flight(f"{name}, {scenario}", gain, env.unwrapped, period, 1, 128))
    sides: tuple[tuple[str, int, dict[str, Any]], ...] = (
        ("mujoco", 2, {"plant": "mujoco"}),
        ("lanes", 16, {"plant": "lanes"}),
        ("lanes of 32 bits", 16, {"plant": "lanes", "precision": "single"}),
    )
    for name, steps, how in sides:
        envs = gym.make_vec(
            "windwrench/FanTracking-v1", 256, "vector_entry_point", scenario="static", **how
        )
        found.append(flight(f"256 FanTracking, {name}", "ukf", envs, 0.08, 256, steps))
    return [*found, flight("Ant-v5", "MuJoCo at 100 Hz", gym.make("Ant-v5"), 0.05, 1, 60)]


def program(name: str, includes: str, *words: object) -> Contender:
    """Return a fresh process of Python."""
    command = [sys.executable, *map(str, words)]
    run = partial(seconds, partial(subprocess.run, command, check=True))
    return Contender(name, SECONDS, includes, run)


def starts() -> list[Contender]:
    """Return a fresh process to the package, and to an environment's first step."""
    return [
        program("import windwrench", "a fresh process", "-c", "import windwrench"),
        program("first make, reset and step", "a fresh process", "-c", FIRST_STEP),
    ]


def logs() -> list[Contender]:
    """Return a flight of a minute, read in each form that logs have, and diagnosed."""
    folder = Path(tempfile.mkdtemp())
    first, kit = folder / "flight.csv", ("-m", "windwrench")
    program("", "", *kit, "record", "--seconds", 60, "--out", first, "--quiet").run()
    recorded = read_log(first)
    found = []
    for suffix in (".csv", ".csv.gz", ".parquet"):
        file = first.with_suffix(suffix)
        write_log(recorded, file)
        words = "60 s of flight at 200 Hz, read and checked"
        run = partial(seconds, partial(read_log, file))
        found.append(Contender(f"reading {suffix}", SECONDS, words, run))
    words = "a fresh process, 60 s of flight, to the written report"
    given = "diagnose", first, "--out", folder / "diagnosis", "--quiet"
    return [*found, program("diagnosis", words, *kit, *given)]


GROUPS = {one.__name__: one for one in (filters, flights, starts, logs)}


def study(
    groups: Annotated[list[str] | None, typer.Argument(help=f"Of {', '.join(GROUPS)}.")] = None,
    rounds: int = 7,
    markdown: Annotated[Path | None, typer.Option(help="Page whose table is written anew.")] = None,
) -> None:
    """Measure groups, default: all, and print their table."""
    for name in groups or ():
        if name not in GROUPS:
            raise unknown_name("group", name, GROUPS)
    words = " ".join(["python -m evidence.speed", *(groups or ()), f"--rounds {rounds}"])
    lines = [HEADER, "| --- " * 5 + "|"]
    for name in groups or GROUPS:
        lines += rows(GROUPS[name](), rounds)
    table = "\n".join([*lines, "", made_by(words, [commit()])])
    print(table)
    if markdown is not None:
        before, rest = markdown.read_text(encoding="utf-8").split(BEGIN)
        write_text(f"{before}{BEGIN}{table}\n{END}{rest.split(END)[1]}", markdown)


if __name__ == "__main__":
    start(study)
