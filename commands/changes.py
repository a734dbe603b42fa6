"""Two sets of flights of one vehicle, compared."""

import os
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from typer.core import TyperCommand

from ..runtime.errors import InputError
from .flight_logs import AS_THEY_ARE, LogOptions, log_notes, read_flights
from .terminal import console, results_folder, say, show_table

_AGAINST = "--against"
_FLOWN = Path(__file__).parent.parent / "identification" / "comparison" / "example"
_EXAMPLE = """A Crazyflie 2.1 flies 26 s with a propeller of the rear left rotor that was cut from \
47 to 39 mm, and three times before with whole ones (CrazyPAD, Masalimov and others, Data 2024, 9, \
79; MIT licence, beside the logs). The logs hold motor commands and the battery's voltage alone."""


def compare(
    logs: list[Path] | None = None,
    against: list[Path] | None = None,
    by_folder: bool = False,
    example: bool = False,
    reading: LogOptions = AS_THEY_ARE,
    out: Path = Path("results/compare"),
) -> dict[str, Any]:
    """Find what changed between two sets of flights. Name the rotor or side; the vehicle's
    model need not be right. Write change.json and change.png.

    Example: windwrench compare today.csv --against yesterday.csv --vehicle my_drone.yaml
    """
    from ..identification.comparison.change import compare as find_change
    from ..identification.comparison.trim import trim_of_log
    from ..identification.comparison.words import change_data, write_change

    if example:
        if logs or against:
            raise InputError(
                f"--example: has logs of its own and takes no other log and no {_AGAINST}"
            )
        console.print(_EXAMPLE)
        logs, reading = [_FLOWN / "cut.csv.gz"], AS_THEY_ARE
        against = sorted(_FLOWN.glob("normal-*.csv.gz"))
    if not logs or not against:
        raise InputError(
            f"compare: expected logs after the change and {_AGAINST} logs before it, or --example"
        )
    paths = [*logs, *against]
    every, model = read_flights(paths, reading)
    # a folder by the name that was given: links to flights may lie in folders by session
    sessions = [os.path.dirname(os.path.abspath(path)) if by_folder else "" for path in paths]
    folder = results_folder(out)
    trims = [
        replace(trim_of_log(log, model), session=session)
        for log, session in zip(every, sessions, strict=True)
    ]
    change = find_change(trims[: len(logs)], trims[len(logs) :])
    written = write_change(change, folder)
    result = change_data(change)
    console.print(result["headline"])
    console.print(f"vehicle: {model.name}")
    log_notes(text for log in every for text in log.notes)
    for session in dict.fromkeys(sessions) if by_folder else ():
        after, before = (
            part.count(session) for part in (sessions[: len(logs)], sessions[len(logs) :])
        )
        console.print(f"session {session}: {after} after, {before} before")
    places = sorted(change.probabilities.items(), key=lambda item: -item[1])
    rows = [(name, f"{chance:.3f}") for name, chance in places]
    show_table(("where something changed", "probability"), rows)
    say(*written)
    return result


class LogsAgainstLogs(TyperCommand):
    """A command whose ``--against`` takes every log up to the next option. With logs behind
    ``--against`` alone, it takes one.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Return the rest of the words of a command line."""
        options = (one for one in self.params if not getattr(one, "is_flag", True))
        valued = {name for one in options for name in one.opts}
        return super().parse_args(ctx, list(_each_against(args, valued)))


def _each_against(words: Sequence[str], valued: Collection[str]) -> Iterator[str]:
    """Yield the words with ``--against`` before each log of its list; ``valued`` options have a
    value.
    """
    has_logs, in_list, option = False, False, ""
    for word in words:
        if option:  # its value
            in_list, option = has_logs and option == _AGAINST, ""
        elif word.startswith("-"):
            in_list, option = False, word if word in valued else ""
        elif in_list:
            yield _AGAINST
        else:
            has_logs = True
        yield word
