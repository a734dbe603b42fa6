"""The demonstration."""

import json
import os
import shlex
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..runtime.errors import InputError
from ..runtime.workers import SINGLE_THREADED
from .diagnosing import STAGES
from .terminal import console, results_folder, say, show_page, working

HIDDEN = "constant_torque:tz=0.01"
EVERY = 4.0  # s between two signs of life where there is no terminal
_BOARD = ("hover", "admittance", "ratio", "oracle")


def demo(
    vehicle: str = "ardrone2",
    effect: str = HIDDEN,
    episodes: int = 3,
    seed: int = 0,
    no_open: bool = False,
    out: Path = Path("results/demo"),
) -> dict[str, Any]:
    """Show what this kit does, in two minutes. Fly in the wind, estimate it, record a flight with a
    hidden effect, diagnose it, and fly better; write one page of all of it.

    Example: windwrench demo --no-open
    """
    from ..dynamics.effects import parse_setting

    begun = time.monotonic()
    parse_setting(effect)  # refused before anything is made
    folder = results_folder(out)
    console.print(
        "A vehicle flies in a fan's jet, is diagnosed, and flies better. The first start also "
        "compiles.",
    )
    with working("loading", every=EVERY):
        from ..demo import story
        from ..demo.page import write_page
        from ..dynamics.vehicle_file import load_vehicle

        model = load_vehicle(vehicle)
        request = story.Request(
            model, vehicle, parse_setting(effect, model), seed, episodes, folder
        )
    count = 6
    with working(f"1 of {count}: flying in the jet", every=EVERY) as progress:
        steps = story.fly_and_feel(request, progress)
    _tell(1, count, steps[0])
    _tell(2, count, steps[1])
    # what flies is compiled by now: the leaderboard flies on another core
    with _benchmark(folder / "leaderboard", episodes, seed) as board:
        with working(f"3 of {count}: recording a flight", every=EVERY) as progress:
            recorded, log = story.record(request, progress)
        steps.append(recorded)
        _tell(3, count, recorded)
        with working(f"4 of {count}: diagnosing it", every=EVERY) as progress:
            diagnosed, found, reports = story.find(
                request,
                log,
                lambda text: progress(STAGES.get(text), f"4 of {count}: {text}"),
            )
        steps.append(diagnosed)
        _tell(4, count, diagnosed)
        with working(f"5 of {count}: flying with both models", every=EVERY) as progress:
            better = story.fly_better(request, found, progress)
        steps.append(better)
        _tell(5, count, better)
        with working(f"6 of {count}: comparing controllers", every=EVERY):
            rows = _rows(board, folder / "leaderboard")
    compared = story.Step(
        "Compare controllers",
        (
            f"{len(_BOARD)} controllers fly the same {episodes} episodes of each scenario. Score "
            f"0 is a vehicle that hovers, 1 one that sees the fan.",
        ),
        _board_command(episodes, seed, folder / "leaderboard"),
        folder / "leaderboard" / "leaderboard.png",
    )
    steps.append(compared)
    best = [
        f"{row['controller']} {row['rmse_m']:.3f} m" for row in rows if row["scenario"] == "base"
    ]
    console.print(f"6 of {count}: RMSE on base: {', '.join(best)}")
    page = folder / "demo.html"
    command = shlex.join(["windwrench", *sys.argv[1:]])
    seconds = time.monotonic() - begun
    write_page(steps, diagnosed, compared, rows, command, seconds, page)
    say(*reports, *(s.picture for s in steps if s.picture is not None), page)
    console.print(f"{seconds:.0f} s in all")
    show_page(page, not no_open)
    return {
        "effect": request.effect_words,
        "found": [e.name for e in found.effects],
        "verdict": found.verdict,
        "steps": [
            {"title": s.title, "sentences": s.sentences, "command": s.command} for s in steps
        ],
        "leaderboard": rows,
        "page": page,
    }


def _tell(number: int, count: int, step: Any) -> None:
    words = " ".join(step.sentences[1:])
    console.print(f"{number} of {count}: {step.title}. {words}", soft_wrap=True)


def _board_command(episodes: int, seed: int, out: Path) -> str:
    return (
        f"windwrench benchmark --controllers {','.join(_BOARD)} --episodes {episodes} "
        f"--seed {seed} --out {out}"
    )


@contextmanager
def _benchmark(out: Path, episodes: int, seed: int) -> Iterator[subprocess.Popen[str]]:
    """Give a process that flies the leaderboard; it ends with the block."""
    arguments = shlex.split(_board_command(episodes, seed, out))[1:]
    folders = os.pathsep.join(filter(None, sys.path))
    with subprocess.Popen(
        [sys.executable, "-m", "windwrench", *arguments, "--jobs", "1", "--quiet"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={**SINGLE_THREADED, **os.environ, "PYTHONPATH": folders},
    ) as process:
        try:
            yield process
        except BaseException:
            process.kill()
            raise


def _rows(process: subprocess.Popen[str], out: Path) -> list[dict[str, Any]]:
    _, words = process.communicate()
    if process.returncode:
        last = (words or "").strip().splitlines()[-1:] or ["no message"]
        raise InputError(f"demo: the leaderboard was not flown: {last[0]}")
    rows: list[dict[str, Any]] = json.loads((out / "leaderboard.json").read_text(encoding="utf-8"))
    return rows
