"""All results of a log, in one go: ``windwrench LOG``."""

import shlex
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..runtime.errors import InputError, UnreadLogError
from ..runtime.page_files import write_text
from .flight_logs import AS_THEY_ARE, LogOptions
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

_MAKE_A_VEHICLE = """Force and torque need a vehicle. Make its file from this log and a mass:
windwrench identify {log} --mass KG --out my_drone.yaml
windwrench {log} --vehicle my_drone.yaml"""


def is_path(word: str) -> bool:
    """Return whether the first word of a command line is a file's path, and no command."""
    return Path(word).exists() or "/" in word or bool(Path(word).suffix)


def look(
    log: Path,
    reading: LogOptions = AS_THEY_ARE,
    no_open: bool = False,
    out: Path = Path("results/log"),
) -> dict[str, Any]:
    """Say of a flight log all that it allows. What it holds, which force and torque act, and what
    the vehicle's model lacks; write one page.

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
            f"{unread}. The map so far is {own_map}: edit it, then windwrench {log} --map {own_map}"
        ) from unread
    if checked["fields"]:  # its map was guessed
        write_text(checked["map"], own_map)
        reading = replace(reading, map=str(own_map))
        for text in checked["doubts"]:
            note(f"warning: {text}")
    drawn, said = folder / "check.png", _what_it_holds(checked)
    steps = [Step("What the log holds", said, _typed("check", log, reading), drawn)]
    _tell(steps[0])
    sentence, then = f"{steps[0].sentences[0]} No vehicle is known.", ""
    if reading.vehicle is None and checked["vehicle"] in preset_names():
        reading = replace(reading, vehicle=checked["vehicle"])
    results: dict[str, Any] = {"check": checked}
    if reading.vehicle is None:
        then = _MAKE_A_VEHICLE.format(log=shlex.quote(str(log)))
    else:
        ways: tuple[tuple[str, str, Callable[..., Any], Any, Callable[..., Any]], ...] = (
            ("estimate", "Which force and torque act", estimate, log, _what_acts),
            ("diagnose", "What the model lacks", diagnose, [log], _what_lacks),
        )
        for name, title, work, logs, told in ways:
            command = _typed(name, log, reading)
            try:
                with silently():
                    results[name] = work(logs, reading=reading, out=folder / name)
            except InputError as refused:
                steps.append(Step(title, (f"Not from this log: {refused}",), command))
            else:
                sentence, *_ = said = told(results[name])
                picture = folder / name / "wrench.png" if name == "estimate" else None
                report = "" if picture else f"{name}/report.html"
                steps.append(Step(title, said, command, picture, report))
            _tell(steps[-1])
    page = folder / "log.html"
    write_page(checked["log"], sentence, steps, then, command_line(), page)
    run.record = folder / "run.json"
    for line in then.splitlines():
        console.print(line, soft_wrap=True)
    say(page)
    show_page(page, not no_open)
    console.print(sentence)
    return {**results, "sentence": sentence, "page": page}


def _typed(command: str, log: Path, reading: LogOptions) -> str:
    """Return the command line of one step alone."""
    given = vars(reading).items()
    options = [str(x) for name, value in given if value is not None for x in (f"--{name}", value)]
    return shlex.join(["windwrench", command, str(log), *options])


def _tell(step: Any) -> None:
    console.print(f"{step.title}: {' '.join(step.sentences)}")
    console.print(f"  {step.command}", soft_wrap=True, style="dim")


def _what_it_holds(checked: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the result of ``check`` as sentences."""
    read = f"{checked['samples']} rows, {checked['seconds']:.1f} s, read by {checked['read_by']}."
    rates = (f"{name} {c['rate_hz']:.3g} Hz" for name, c in checked["channels"].items())
    doubts = len(checked["doubts"])
    said = [f"{doubts} doubts: the command below tells them."] if doubts else []
    return (read, f"Channels: {', '.join(rates)}.", *said)


def _what_acts(result: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the mean force as a sentence."""
    mean, spread = result["force_mean_N"], result["force_std_N"]
    force = ", ".join(f"{x:+.2g} ({s:.2g})" for x, s in zip(mean, spread, strict=True))
    return (f"Beside the model act {force} N along x, y and z: mean (standard deviation).",)


def _what_lacks(result: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the first sentence of a diagnosis, and the rest of the force: within a sentence
    without a number of its own, else as a further one.
    """
    headline, error = result["headline"], result["error"]
    before, after = (1e3 * error[when]["force_rms_N"] for when in ("before", "after"))
    change = f"falls from {before:.3g} to {after:.3g}" if result["effects"] else f"is {before:.3g}"
    told = f"The force that it leaves on unseen stretches {change} mN."
    return (headline, told) if any(x.isdigit() for x in headline) else (f"{headline} {told}",)
