"""``python -m studies.map_guesses``: random tables, and how often their guessed maps are right."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from windwrench.commands.terminal import share_bars_by_part
from windwrench.runtime.page_files import write_json
from windwrench.studies.map_guesses.study import run


def study(
    count: Annotated[int, typer.Option(min=1, help="Random tables.")] = 300,
    seed: Annotated[int, typer.Option(min=0, help="Of everything random.")] = 0,
    out: Annotated[Path, typer.Option(help="File of the figures.")] = Path(
        "results/map_guesses.json"
    ),
) -> None:
    """Guess maps for random tables, with and without the vehicle (some minutes)."""
    with share_bars_by_part() as report:
        found = [
            run(count, seed, told, partial(report, f"vehicle {'given' if told else 'not given'}"))
            for told in (False, True)
        ]
    for result in found:
        print(f"vehicle {'given' if result['vehicle_given'] else 'not given'}:")
        for name, (n, low, high) in result["outcomes"].items():
            print(f"  {name}: {n} of {count}, {low:.1%} to {high:.1%}")
    write_json(found, out)


if __name__ == "__main__":
    typer.run(study)
