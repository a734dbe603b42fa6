"""All compiled code of the common commands, at once."""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from .benchmarking import benchmark
from .diagnosing import diagnose
from .estimating import estimate
from .flying import fly, record
from .live import live
from .terminal import console, run, silently, working

_SECONDS = 12.0  # s, recorded flight: the shortest for a diagnosis


def warm() -> dict[str, Any]:
    """Compile what the common commands need. Once for this code; no later start waits for it.

    Example: windwrench warm
    """
    with TemporaryDirectory() as folder:
        log, out = Path(folder) / "flight.csv", Path(folder) / "results"
        work: tuple[tuple[str, Callable[[], object]], ...] = (
            ("the simulated flight", lambda: record(log, seconds=_SECONDS)),
            ("the filter on a log", lambda: estimate(log, out=out)),
            ("the diagnosis", lambda: diagnose([log], out=out)),
            ("the tasks", lambda: fly(out=out)),
            ("the benchmark", lambda: benchmark(episodes=1, jobs=1, out=out)),
            ("the live stream", lambda: live("sim:base", seconds=1.0)),
        )
        with working("compiling", len(work)) as progress:
            for done, (what, does) in enumerate(work):
                progress(done, f"compiling {what}")
                with silently():
                    does()
    run.begin()  # nothing of it stays
    console.print("All is compiled.")
    return {"compiled": [what for what, _ in work]}
