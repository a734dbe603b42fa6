"""How fast: one filter step, flights against real time, and start-up, side by side with peers that
are installed.

Every round runs all contenders one after the other, so that a machine whose speed drifts slows all
of them; figures are medians over rounds, and ratios are taken round by round. One process, one
thread.
"""

import importlib.util
import os
import platform
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path

from ..dynamics import load_vehicle
from ..estimator import ConstantGainFilter, NonlinearObserver, UKFTuning, WrenchEKF, WrenchUKF
from ..estimator.consistency import ModelRun
from ..runtime.page_files import write_text
from ..runtime.provenance import commit, made_by
from .filter_step import (
    PERIOD,
    PeerFilter,
    compiled_loop,
    make_run,
    time_batch,
    time_step,
)


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
    """What a contender came to over the rounds, and its ratio to the reference of its unit: median,
    least, largest.
    """

    contender: Contender
    value: tuple[float, float, float]
    ratio: tuple[float, float, float]


def _peer_step(peer: PeerFilter, run: ModelRun) -> float:
    """Return the time of a peer's step in us."""
    return 1e6 * time_step(peer, run, 60)


def filters() -> list[Contender]:
    """Return the filters, and filterpy's where it is installed."""
    vehicle, tuning, run = load_vehicle("ardrone2"), UKFTuning(), make_run(2000)
    out = []
    for name, estimator, includes in (
        (
            "WrenchUKF",
            WrenchUKF(vehicle, tuning, PERIOD),
            "predict, correct, copy of state and covariance",
        ),
        (
            "ConstantGainFilter",
            ConstantGainFilter(vehicle, tuning, PERIOD),
            "the same with a constant covariance",
        ),
        ("WrenchEKF", WrenchEKF(vehicle, tuning, PERIOD), "as WrenchUKF"),
        ("NonlinearObserver", NonlinearObserver(vehicle, None, PERIOD), "no covariance"),
    ):
        time_step(estimator, run, 3)  # compiles
        out.append(
            Contender(
                name,
                "us a step",
                includes,
                lambda e=estimator: 1e6 * time_step(e, run, 2000),  # type: ignore[misc]
                reference=name == "WrenchUKF",
            )
        )
    out.append(
        Contender(
            "WrenchUKF in a compiled loop", "us a step", "predict and correct", compiled_loop(run)
        )
    )
    for count in (16, 256):
        out.append(
            Contender(
                f"WrenchUKFBatch, {count} filters",
                "us a step",
                "predict, correct, copy of state",
                time_batch(run, count),
            )
        )
    if importlib.util.find_spec("filterpy"):
        for words, by_component in (("numpy.cross", False), ("by component", True)):
            peer = PeerFilter(vehicle, tuning, PERIOD, by_component)
            out.append(
                Contender(
                    f"filterpy {version('filterpy')} UKF, {words}",
                    "us a step",
                    "the same state and model",
                    partial(_peer_step, peer, run),
                )
            )
    return out


_FIRST_STEP = (
    "import gymnasium, windwrench\nenv = "
    "gymnasium.make('windwrench/FanTracking-v0')\nenv.reset(seed=0)\n"
    "env.step(env.action_space.sample())"
)


def starts() -> list[Contender]:
    """Return the times from a fresh process to the package, and to the first step of an
    environment.
    """
    return [
        Contender(
            "import windwrench",
            "s",
            "a fresh process",
            lambda: _fresh("import windwrench"),
            reference=True,
        ),
        Contender(
            "first make, reset and step",
            "s",
            "a fresh process, compiled code on disk",
            lambda: _fresh(_FIRST_STEP),
        ),
    ]


def _fresh(code: str, environment: Mapping[str, str] | None = None) -> float:
    timed = f"import time; t = time.perf_counter()\n{code}\nprint(time.perf_counter() - t)"
    done = subprocess.run(
        [sys.executable, "-c", timed], capture_output=True, text=True, check=True, env=environment
    )
    return float(done.stdout.split()[-1])


def cold_start() -> "Section":
    """Return the time of a first flight where nothing is compiled yet, in a fresh process, once."""
    with tempfile.TemporaryDirectory() as cache:
        taken = _fresh(_FIRST_STEP, {**os.environ, "NUMBA_CACHE_DIR": cache})
    return Section(
        "Once for an installation",
        ["what", "s"],
        [["first make, reset and step", f"{taken:.1f}"]],
        "Nothing compiled on disk; filter and loop are compiled in a process each.",
    )


def measure(
    contenders: list[Contender], rounds: int, advance: Callable[[], None] = lambda: None
) -> list[Figure]:
    """Run all contenders in turn ``rounds`` times; ``advance`` is called after each run."""
    values: list[list[float]] = [[] for _ in contenders]
    for _ in range(rounds):
        for kept, contender in zip(values, contenders, strict=True):
            kept.append(contender.run())
            advance()
    references = {c.unit: kept for c, kept in zip(contenders, values, strict=True) if c.reference}

    def spread(numbers: list[float]) -> tuple[float, float, float]:
        return statistics.median(numbers), min(numbers), max(numbers)

    return [
        Figure(
            c, spread(kept), spread([v / r for v, r in zip(kept, references[c.unit], strict=True)])
        )
        for c, kept in zip(contenders, values, strict=True)
    ]


def rows_of(figures: list[Figure]) -> list[list[str]]:
    """Return the figures as the cells of a table: name, figure, spread, ratio to the reference,
    what it includes.
    """
    out = []
    for f in figures:
        digits = 2 if f.contender.unit == "s" else 1 if f.value[0] < 100 else 0
        value, low, high = (f"{v:.{digits}f}" for v in f.value)
        ratio = (
            "1"
            if f.contender.reference
            else f"{f.ratio[0]:.3g} ({f.ratio[1]:.3g} - {f.ratio[2]:.3g})"
        )
        out.append(
            [
                f.contender.name,
                f"{value} {f.contender.unit}",
                f"{low} - {high}",
                ratio,
                f.contender.includes,
            ]
        )
    return out


@dataclass(frozen=True)
class Section:
    """A table beside the contenders', and what it shows in words."""

    title: str
    header: list[str]
    rows: list[list[str]]
    words: str = ""


HEADER = ["what", "median", "least - largest", "ratio to the first of its kind", "includes"]


def write_markdown(
    figures: list[Figure], rounds: int, path: Path, sections: Sequence[Section] = (), hour: str = ""
) -> None:
    """Write a run as a page; ``hour`` is the further option it was run with."""
    lines = [
        "# Speed",
        "",
        made_by(f"windwrench speed --rounds {rounds}{hour} --markdown docs/speed.md", [commit()]),
        "",
        "One run: one process, all "
        "contenders in turn in every round; medians, with ratios taken round by round. One thread, "
        "where no other number "
        "is given. Peers are measured where they are installed (`pip install "
        "'windwrench[peers]'`).",
        "",
        f"Python {platform.python_version()}, "
        + ", ".join(f"{n} {version(n)}" for n in ("numpy", "numba", "mujoco"))
        + f", {platform.machine()}, {os.cpu_count()} cores.",
        "",
        *_table(HEADER, rows_of(figures)),
        "",
        "`x real time` is simulated seconds a second, summed over the environments. A batch takes "
        "filters side by "
        "side, eight to a vector register, with the functions of the single filter. The filter "
        "of filterpy has 37 sigma "
        "points and additive noise. Its model is measured as one writes it down, with vectors and "
        "`numpy.cross`, and "
        "with every product by component in plain Python numbers. `python -m "
        "windwrench.speed.filter_step` prints "
        "how far it agrees with `WrenchUKF`.",
        "",
    ]
    for section in sections:
        lines += [f"## {section.title}", "", *_table(section.header, section.rows), ""]
        lines += [section.words, ""] if section.words else []
    write_text("\n".join(lines), path)


def _table(header: list[str], rows: list[list[str]]) -> list[str]:
    return [
        f"| {' | '.join(header)} |",
        f"|{' --- |' * len(header)}",
        *(f"| {' | '.join(row)} |" for row in rows),
    ]
