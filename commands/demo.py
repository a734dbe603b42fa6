"""The demonstration."""

import time
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
    seed: int = 5,  # of a fan that moves: on a still one there is nothing to follow
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
    with working("loading"):
        from ..demo import steps as pages
        from ..demo import story
        from ..dynamics.vehicle_file import load_vehicle
        from ..evaluation.tasks import task_of

        model = load_vehicle(vehicle)
        request = story.Request(
            model, vehicle, parse_setting(effect, model), seed, episodes, folder
        )
    with working("flying in the jet") as progress:
        steps = story.fly_and_feel(request, progress)
    _tell(1, steps[0])
    _tell(2, steps[1])
    with working("recording a flight") as progress:
        recorded, log = story.record(request, progress)
    _tell(3, recorded)
    with working("looking at the logs") as progress:
        diagnosed, found, reports = story.find(request, log, staged(progress))
    _tell(4, diagnosed)
    with working("flying with both models") as progress:
        better = story.fly_better(request, found, progress)
    _tell(5, better)
    laws, worlds, board = story.LAWS, list(task_of("FanTracking").defaults), folder / "leaderboard"
    with working("comparing controllers", len(laws) * len(worlds) * episodes) as progress:
        rows, _ = write_board(board, laws, worlds, episodes, seed, progress, jobs=1)
    compared = story.compare(request, rows, board)
    _tell(6, compared)
    steps += recorded, diagnosed, better, compared
    page = folder / "demo.html"
    seconds = time.monotonic() - begun
    pages.write_page(
        "A vehicle that feels the wind",
        "It flies, feels, is diagnosed, and flies better. All of it was computed on this machine "
        f"in {seconds:.0f} s.",
        steps,
        _YOURS,
        command_line(),
        page,
    )
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


def _tell(number: int, step: Any) -> None:
    words = " ".join(step.sentences[1:])
    console.print(f"{number} of {_COUNT}: {step.title}. {words}", soft_wrap=True)
