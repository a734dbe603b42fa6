"""The demonstration."""

import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from .benchmarking import write_board
from .diagnosing import staged
from .terminal import command_line, console, results_folder, say, show_page, working

_COUNT = 6  # steps
_YOURS = """Your own log, of most autopilots or any table, goes in the same way:
windwrench my_flight.csv --vehicle my_drone.yaml"""


def demo(
    vehicle: str = "ardrone2",
    effect: str = "constant_torque:tz=0.01",
    episodes: int = 3,
    seed: int = 5,  # a moving fan: behind a still one there is nothing to follow
    no_open: bool = False,
    out: Path = Path("results/demo"),
) -> dict[str, Any]:
    """Try each step and write one page, in about a minute. Fly in wind, estimate the wrench,
    record a flight with a hidden effect, diagnose the flight, and fly with the amended model.

    Example: windwrench demo --no-open
    """
    from ..dynamics.effects import parse_setting

    begun = time.monotonic()
    parse_setting(effect)  # refused before anything is made
    folder = results_folder(out)
    console.print(
        "A quadrotor flies in a fan's jet, is diagnosed, and flies again with a better model.",
    )
    with working("loading"):
        from ..demo.steps import Step, write_page
        from ..demo.story import LAWS, Story
        from ..dynamics.vehicle_file import load_vehicle
        from ..evaluation.benchmark import Request
        from ..evaluation.tasks import task_of

        model = load_vehicle(vehicle)
        story = Story(model, vehicle, parse_setting(effect, model), seed, episodes, folder)
    steps: list[Step] = []
    parts: tuple[tuple[str, Callable[[Callable[..., None]], list[Step]]], ...] = (
        ("flying in the jet", story.fly_and_feel),
        ("recording a flight", story.record),
        ("looking at the logs", lambda progress: story.find(staged(progress))),
        ("flying with both models", story.fly_better),
    )
    for text, part in parts:
        with working(text) as progress:
            new = part(progress)
        _tell(steps, new)
    board = folder / "leaderboard"
    request = Request(LAWS, task_of("FanTracking").defaults, episodes, seed)
    with working("comparing controllers", request.flights()) as progress:
        rows, _ = write_board(board, request, progress, jobs=1)
    _tell(steps, story.compare(rows, board))
    page = folder / "demo.html"
    seconds = time.monotonic() - begun
    write_page(
        "A vehicle that feels the wind",
        "A quadrotor flies in a fan's jet, is diagnosed, and flies again with a better model. "
        f"Computed on this machine in {seconds:.0f} s.",
        steps,
        _YOURS,
        command_line(),
        page,
    )
    say(*story.reports, *(s.picture for s in steps if s.picture is not None), page)
    console.print(f"{seconds:.0f} s in all")
    show_page(page, not no_open)
    return {
        "effect": story.effect_words,
        "found": [e.name for e in story.diagnosis.effects],
        "verdict": story.diagnosis.verdict,
        "steps": [
            {"title": s.title, "sentences": s.sentences, "command": s.command} for s in steps
        ],
        "leaderboard": rows,
        "page": page,
    }


def _tell(steps: list[Any], new: Iterable[Any]) -> None:
    """Add and print steps."""
    for step in new:
        steps.append(step)
        words = " ".join(step.sentences[1:])
        console.print(f"{len(steps)} of {_COUNT}: {step.title}. {words}", soft_wrap=True)
