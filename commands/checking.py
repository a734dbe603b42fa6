"""Anyone's log: what is in it, and in this kit's own format."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..runtime.errors import InputError, UnreadLogError
from ..runtime.page_files import write_text
from .flight_logs import AS_THEY_ARE, LogOptions
from .terminal import console, note, results_folder, say, show_table, working

if TYPE_CHECKING:
    from ..identification.logs.flight_log import FlightLog


def check(
    log: Path,
    reading: LogOptions = AS_THEY_ARE,
    write_map: Path | None = None,
    write: Path | None = None,
    out: Path = Path("results/check"),
) -> dict[str, Any]:
    """Check the channels, units and conventions of a flight log. Print rates, gaps, doubts and the
    reason of each choice, and draw the channels. For a table of unknown columns propose a map,
    with ? where you must choose.

    Example: windwrench check theirs.csv --vehicle my_drone.yaml --write-map map.yaml
    """
    from ..dynamics.vehicle_file import load_vehicle
    from ..identification.report.log_channels import plot_channels
    from ..identification.report.log_check import check_log

    model = None if reading.vehicle is None else load_vehicle(reading.vehicle)
    try:
        with working("reading"):
            checked = check_log(log, reading.reader, model, reading.map, reading.piece)
    except UnreadLogError as error:
        edit = f"edit {write_map}"
        if write_map is None:
            console.print(error.map_text, soft_wrap=True, highlight=False)
            edit = "edit the map above (--write-map map.yaml writes it)"
        else:
            write_text(error.map_text, write_map)
        raise InputError(
            f"{error}; {edit}, then: windwrench check {log} --map {write_map or 'map.yaml'}"
        ) from error
    if write_map is not None and not checked.map_text:
        raise InputError(
            f"--write-map {write_map}: {log} is read by {checked.read_by} and needs no map"
        )
    flight = checked.log
    said = "" if write is None else _write(flight, log, write)
    folder = results_folder(out)
    picture = plot_channels(flight.name, checked.channels, folder / "check.png")
    if write_map is not None:
        write_text(checked.map_text, write_map)
    for text in (*checked.doubts, *checked.limits):
        note(f"warning: {text}")
    console.print(checked.headline())
    result = checked.as_dict()
    console.print(f"{flight.name}: {result['samples']} rows, read by {checked.read_by}")
    show_table(("vehicle and flight", "", "source"), checked.what_flew())
    show_table(
        ("channel", "rate (Hz)", "gaps", "longest (s)", "from", "to", "unit"),
        [
            (
                c.name,
                f"{c.rate_hz:.4g}",
                str(c.gaps),
                f"{c.longest_gap_s:.3g}",
                f"{c.low:.4g}",
                f"{c.high:.4g}",
                c.unit,
            )
            for c in checked.channels
        ],
    )
    if checked.guess is not None:
        show_table(
            ("field", "", "why"),
            [
                (f"{r.section} {r.field}".strip(), "certain" if r.certain else "GUESS", r.why)
                for r in checked.guess.reasons
            ],
        )
        if write_map is None:
            console.print(checked.map_text, soft_wrap=True, highlight=False)
    for text in flight.notes:
        if not text.startswith("warning"):
            console.print(text)
    if said:
        note(said)
    say(*(path for path in (write, picture, write_map) if path is not None))
    return result


def _write(flight: "FlightLog", log: Path, path: Path) -> str:
    """Write a flight in the kit's own format; return the lines to print."""
    import numpy as np

    from ..identification.logs.flight_log import write_log

    if path.exists() and path.samefile(log):
        raise InputError(f"--write {path}: is the log itself; expected another file")
    said = ""
    if flight.commanded and flight.command is not None:
        # the vehicle gives the result of a command, each time the log is read
        flight = replace(flight, rotor_speeds=np.full_like(flight.rotor_speeds, np.nan))
        said = "the motor commands are written, and not the rotor speeds that follow them"
    with working("writing"):
        write_log(flight, path)
    return said
