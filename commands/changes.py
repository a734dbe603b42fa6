"""Two sets of flights of one vehicle, compared."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

from typer.core import TyperCommand

from ..runtime.errors import InputError
from .flight_logs import AS_THEY_ARE, Reading, log_notes, read_flights
from .terminal import console, results_folder, say, show_table

_AGAINST = "--against"
_EXAMPLE = """A Crazyflie 2.1 flies 26 s with a propeller of the rear left rotor that was cut from \
47 to 39 mm, and three times before with whole ones (CrazyPAD, Masalimov and others, Data 2024, 9, \
79; MIT licence, beside the logs). The logs hold motor commands and the battery's voltage alone."""


def compare(
    logs: list[Path] | None = None,
    against: list[Path] | None = None,
    by_folder: bool = False,
    example: bool = False,
    reading: Reading = AS_THEY_ARE,
    out: Path = Path("results/compare"),
) -> dict[str, Any]:
    """Find what changed between two sets of flights. Which rotor, which side: no model has to be
    true. Write change.json and change.png.

    Example: windwrench compare today.csv --against yesterday.csv --vehicle my_drone.yaml
    """
    if example:
        if logs or against:
            raise InputError(f"--example: has logs of its own; expected it without {_AGAINST}")
        console.print(_EXAMPLE)
        with resources.as_file(
            resources.files("windwrench.identification.comparison") / "example"
        ) as flown:
            normal = sorted(flown.glob("normal-*.csv.gz"))
            return _compare([flown / "cut.csv.gz"], normal, AS_THEY_ARE, by_folder, out)
    if not logs or not against:
        raise InputError(
            f"compare: expected logs after the change and {_AGAINST} logs before it, or --example"
        )
    return _compare(logs, against, reading, by_folder, out)


def _compare(
    logs: Sequence[Path], against: Sequence[Path], reading: Reading, by_folder: bool, out: Path
) -> dict[str, Any]:
    """Compare two sets of flights; write the result."""
    from ..identification.comparison.change import compare as find_change
    from ..identification.comparison.trim import trim_of_log
    from ..identification.comparison.words import change_data, change_headline, write_change

    paths = [*logs, *against]
    every, model = read_flights(paths, reading)
    sessions = [str(path.resolve().parent) if by_folder else "" for path in paths]
    folder = results_folder(out)
    trims = [
        replace(trim_of_log(log, model), session=session)
        for log, session in zip(every, sessions, strict=True)
    ]
    change = find_change(trims[: len(logs)], trims[len(logs) :])
    written = write_change(change, folder)
    log_notes(text for log in every for text in log.notes)
    console.print(f"vehicle: {model.name}")
    console.print(change_headline(change))
    places = sorted(change.places.items(), key=lambda item: -item[1])
    rows = [(name, f"{chance:.3f}") for name, chance in places]
    show_table(("where something changed", "probability"), rows)
    say(*written)
    return change_data(change)


class LogsAgainstLogs(TyperCommand):
    """A command in which ``--against`` takes every log up to the next option."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Return what is left of the words of a command line."""
        return super().parse_args(ctx, list(_each_against(args)))


def _each_against(words: Sequence[str]) -> Iterator[str]:
    """Yield the words with ``--against`` before each log of its list."""
    # where logs come behind the list alone, the list is one log long
    ends = not words or words[0].startswith("-")
    logs = -1
    for word in words:
        if word.startswith("-"):
            logs = 0 if word == _AGAINST and not ends else -1
        elif logs >= 0:
            logs += 1
            if logs > 1:
                yield _AGAINST
        yield word
