"""All results of a log, in one go: ``windwrench LOG``."""

import re
import shlex
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..runtime.errors import InputError, UnreadLogError
from ..runtime.page_files import write_text
from .flight_logs import AS_THEY_ARE, LogOptions, read_logs
from .terminal import (
    command_line,
    console,
    note,
    results_folder,
    run,
    say,
    show_page,
    silently,
)

_VEHICLE = "my_drone.yaml"


def is_path(word: str) -> bool:
    """Return whether the first word of a command line is a file's path, and no command."""
    return Path(word).exists() or "/" in word or bool(Path(word).suffix)


def look(
    log: Path,
    reading: LogOptions = AS_THEY_ARE,
    no_open: bool = False,
    out: Path = Path("results/log"),
) -> dict[str, Any]:
    """Check a flight log, estimate the wrench and name missing effects. Do as much as the log
    allows, and write one page.

    Example: windwrench look flight.csv --vehicle crazyflie
    """
    from ..demo.steps import Step, write_page
    from ..dynamics.vehicle_file import preset_names
    from .checking import check
    from .diagnosing import diagnose
    from .estimating import estimate

    folder = results_folder(out)
    own_map = folder / "map.yaml"
    try:
        with silently():
            checked = check(log, reading, out=folder)
    except InputError as refused:
        unread = refused.__cause__
        if not isinstance(unread, UnreadLogError):
            raise
        write_text(unread.map_text, own_map)
        raise InputError(
            f"{unread}; edit {own_map}, then: windwrench {log} --map {own_map}"
        ) from unread
    if checked["fields"]:  # its map was guessed
        write_text(checked["map"], own_map)
        reading = replace(reading, map=str(own_map))
    for text in checked["doubts"]:
        note(f"warning: {text}")
    steps = [
        Step(
            "The log", _what_it_holds(checked), _typed("check", log, reading), folder / "check.png"
        )
    ]
    _tell(steps[0])
    sentence, then = checked["headline"], ""
    if reading.vehicle is None and checked["vehicle"] in preset_names():
        reading = replace(reading, vehicle=checked["vehicle"])
    results: dict[str, Any] = {"check": checked}
    if reading.vehicle is None:
        then = _how_to_make_a_vehicle(log, reading)
    else:
        ways: tuple[tuple[str, str, Callable[..., Any], Any], ...] = (
            ("estimate", "The wrench", estimate, log),
            ("diagnose", "Missing effects", diagnose, [log]),
        )
        for name, title, work, logs in ways:
            command = _typed(name, log, reading)
            try:
                with silently():
                    results[name] = work(logs, reading=reading, out=folder / name)
            except InputError as refused:
                steps.append(Step(title, (f"Not from this log: {refused}",), command))
            else:
                sentence = results[name]["headline"]
                picture = folder / name / "wrench.png" if name == "estimate" else None
                report = "" if picture else f"{name}/report.html"
                said = re.sub(r"^Doubt: .+?\. ", "", sentence)  # the log's, said above
                steps.append(Step(title, (said,), command, picture, report))
            _tell(steps[-1])
    page = folder / "log.html"
    write_page(checked["log"], sentence, steps, then, command_line(), page, checked["doubts"])
    run.record = folder / "run.json"
    if then:
        console.print(then, soft_wrap=True)
    say(page)
    show_page(page, not no_open)
    return {**results, "sentence": sentence, "page": page}


def _typed(command: str, log: Path, reading: LogOptions) -> str:
    """Return the command line of one step alone."""
    given = vars(reading).items()
    options = [str(x) for name, value in given if value is not None for x in (f"--{name}", value)]
    return shlex.join(["windwrench", *filter(None, [command]), str(log), *options])


def _how_to_make_a_vehicle(log: Path, reading: LogOptions) -> str:
    """Return the commands that make a vehicle of a log, or the reason why none can."""
    from ..identification.vehicle_fit.identify import checked_pieces

    try:
        checked_pieces(read_logs([log], reading))
    except InputError as refused:
        return f"Force and torque need a vehicle, and identify refuses this log: {refused}"
    then = _typed("", log, replace(reading, vehicle=_VEHICLE))
    return (
        "Force and torque need --vehicle: a preset, or a file from this log and a mass:\n"
        f"{_typed('identify', log, reading)} --mass KG --out {_VEHICLE}\n{then}"
    )


def _tell(step: Any) -> None:
    console.print(f"{step.title}: {' '.join(step.sentences)}")
    console.print(f"  this step alone: {step.command}", soft_wrap=True, style="dim")


def _what_it_holds(checked: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the result of ``check`` as sentences."""
    read = f"{checked['samples']} rows, {checked['seconds']:.1f} s, read by {checked['read_by']}."
    rates = (f"{name} {c['rate_hz']:.3g} Hz" for name, c in checked["channels"].items())
    return (checked["headline"], read, f"Channels: {', '.join(rates)}.")
