"""All that a log allows, in one go: ``windwrench LOG``."""

import shlex
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..runtime.errors import InputError, UnreadLogError
from ..runtime.page_files import write_text
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

if TYPE_CHECKING:
    from ..identification.report.log_check import LogCheck

_MAKE_A_VEHICLE = """Force and torque need a vehicle. Make its file from this log and a mass:
windwrench identify {log} --mass KG --out my_drone.yaml
windwrench {log} --vehicle my_drone.yaml"""


def is_path(word: str) -> bool:
    """Return whether the first word of a command line is a file's path, and no command."""
    return Path(word).exists() or "/" in word or bool(Path(word).suffix)


def look(
    log: Path,
    vehicle: str | None = None,
    map: str | None = None,
    reader: str | None = None,
    piece: int | None = None,
    no_open: bool = False,
    out: Path = Path("results/log"),
) -> dict[str, Any]:
    """Say of a flight log all that it allows. What it holds, which force and torque act, and what
    the vehicle's model lacks; write one page.

    Example: windwrench look flight.csv --vehicle crazyflie
    """
    from ..demo.steps import Step, write_page
    from .diagnosing import diagnose
    from .estimating import estimate

    folder = results_folder(out)
    found, used = _checked(log, reader, vehicle, map, piece, folder)
    options = {"--map": used, "--reader": reader, "--piece": piece}
    steps = [_what_it_holds(found, _typed("check", log, options | {"--vehicle": vehicle}), folder)]
    _tell(steps[0])
    sentence, then = f"{steps[0].sentences[0]} No vehicle is known.", ""
    flew = vehicle or _preset(found)
    results: dict[str, Any] = {"check": found.as_dict()}
    if flew is None:
        then = _MAKE_A_VEHICLE.format(log=shlex.quote(str(log)))
    else:
        options["--vehicle"] = flew
        given = {"reader": reader, "map": used, "piece": piece, "vehicle": flew}
        ways: tuple[tuple[str, str, Callable[..., Any], Any, Callable[..., Any]], ...] = (
            ("estimate", "Which force and torque act", estimate, log, _what_acts),
            ("diagnose", "What the model lacks", diagnose, [log], _what_lacks),
        )
        for name, title, work, logs, told in ways:
            command = _typed(name, log, options)
            try:
                with silently():
                    results[name] = work(logs, out=folder / name, **given)
            except InputError as refused:
                steps.append(Step(title, (f"Not from this log: {refused}",), command))
            else:
                sentence, rest = told(results[name])
                picture = folder / name / "wrench.png" if name == "estimate" else None
                report = "" if picture else f"{name}/report.html"
                steps.append(Step(title, (sentence, *rest), command, picture, report))
            _tell(steps[-1])
    page = folder / "log.html"
    write_page(found.log.name, sentence, steps, then, command_line(), page)
    run.record = folder / "run.json"
    for line in then.splitlines():
        console.print(line, soft_wrap=True)
    say(page)
    show_page(page, not no_open)
    console.print(sentence)
    return {**results, "sentence": sentence, "page": page}


def _checked(
    log: Path,
    reader: str | None,
    vehicle: str | None,
    map: str | None,
    piece: int | None,
    folder: Path,
) -> "tuple[LogCheck, str | None]":
    """Return what is in a log, and the map by which it is read from now on.

    Raises:
        InputError: it cannot be read; a map that lacks something is written.
    """
    from ..dynamics.vehicle_file import load_vehicle
    from ..identification.report.log_check import check_log

    model = None if vehicle is None else load_vehicle(vehicle)
    path = folder / "map.yaml"
    try:
        with silently():
            found = check_log(log, reader, model, map, piece)
    except UnreadLogError as error:
        write_text(error.map_text, path)
        raise InputError(
            f"{error}. The map so far is {path}: edit it, then windwrench {log} --map {path}"
        ) from error
    if found.guess is None:
        return found, map
    write_text(found.map_text, path)
    for text in found.doubts:
        note(f"warning: {text}")
    return found, str(path)


def _preset(found: "LogCheck") -> str | None:
    """Return the vehicle that a log names, where it comes with the kit."""
    from ..dynamics.vehicle_file import preset_names

    return found.log.vehicle if found.log.vehicle in preset_names() else None


def _typed(command: str, log: Path, options: Mapping[str, object]) -> str:
    """Return what a user types for one step alone."""
    given = [str(x) for flag, value in options.items() if value is not None for x in (flag, value)]
    return shlex.join(["windwrench", command, str(log), *given])


def _tell(step: Any) -> None:
    console.print(f"{step.title}: {' '.join(step.sentences)}")
    console.print(f"  {step.command}", soft_wrap=True, style="dim")


def _what_it_holds(found: "LogCheck", command: str, folder: Path) -> Any:
    from ..demo.steps import Step
    from ..identification.report.log_channels import plot_channels

    with silently():
        picture = plot_channels(found.log.name, found.channels, folder / "check.png")
    said = [f"{len(found.doubts)} doubts: the command below tells them."] if found.doubts else []
    names = ", ".join(f"{c.name} {c.rate_hz:.3g} Hz" for c in found.channels)
    sentences = (f"{found.sentence()}.", f"Channels: {names}.", *said)
    return Step("What the log holds", sentences, command, picture)


def _what_acts(result: Mapping[str, Any]) -> tuple[str, list[str]]:
    """Return the mean force as a sentence, and further sentences."""
    mean, spread = result["force_mean_N"], result["force_std_N"]
    force = ", ".join(f"{x:+.2g} ({s:.2g})" for x, s in zip(mean, spread, strict=True))
    return f"Beside the model act {force} N along x, y and z: mean (standard deviation).", []


def _what_lacks(result: Mapping[str, Any]) -> tuple[str, list[str]]:
    """Return the first sentence of a diagnosis, and what is left of the force: in that sentence
    where it has no number of its own, else as a further one.
    """
    headline, error = result["headline"], result["error"]
    before, after = (1e3 * error[when]["force_rms_N"] for when in ("before", "after"))
    told = (
        f"The force that it leaves on unseen stretches falls from {before:.3g} to {after:.3g} mN."
        if result["effects"]
        else f"The force that it leaves on unseen stretches is {before:.3g} mN."
    )
    whole = headline if any(x.isdigit() for x in headline) else f"{headline} {told}"
    return whole, [] if whole != headline else [told]
