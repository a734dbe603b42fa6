"""How fast the kit is, beside the peers that are installed: ``python -m windwrench.speed``.

Peers: ``pip install filterpy rotorpy PyFlyt crazyflow``. One process; a table for each group.
"""

import argparse
import tempfile
from collections.abc import Callable
from pathlib import Path

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from .contenders import HEADER, Contender, cells, measure
from .filters import filters
from .flights import flights
from .programs import decisions, logs, starts


def main() -> None:
    """Measure the groups that are asked for, and print a table of each."""
    with tempfile.TemporaryDirectory() as folder:
        groups: dict[str, Callable[[], list[Contender]]] = {
            "filters": filters,
            "flights": flights,
            "decisions": decisions,
            "starts": starts,
            "logs": lambda: logs(Path(folder)),
        }
        parser = argparse.ArgumentParser(description=__doc__)
        parser.add_argument("groups", nargs="*", metavar="GROUP", help=f"of {', '.join(groups)}")
        parser.add_argument("--rounds", type=int, default=7, help="medians are over rounds")
        given = parser.parse_args()
        unknown = set(given.groups) - set(groups)
        if unknown:
            parser.error(f"unknown group {min(unknown)}; expected some of {', '.join(groups)}")
        for name in given.groups or groups:
            _print(name, groups[name], given.rounds)


def _print(name: str, contenders: Callable[[], list[Contender]], rounds: int) -> None:
    console = Console()
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task(f"{name}: compiling", total=None)
        found = contenders()
        progress.update(task, description=name, total=rounds * len(found))
        figures = measure(found, rounds, lambda: progress.advance(task))
    table = Table(title=f"{name}, medians of {rounds} rounds")
    for column in HEADER:
        table.add_column(column, no_wrap=column != HEADER[-1])
    for figure in figures:
        table.add_row(*cells(figure))
    console.print(table)


if __name__ == "__main__":
    main()
