"""Anyone's log: what is in it, and in this kit's own format."""

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from ..runtime.errors import InputError
from .terminal import (
    MapOption,
    ReaderOption,
    console,
    note,
    offering,
    say,
    vehicle_names,
    working,
)

CheckVehicleOption = Annotated[
    str | None,
    typer.Option(
        "--vehicle",
        help="Vehicle that flew, a preset or a YAML file: with it commands become rotor speeds, "
        "and units and conventions are checked against its weight and rotors.",
        autocompletion=offering(vehicle_names),
    ),
]


def convert(
    log: Annotated[Path, typer.Argument(help="Flight log of any kind.")],
    map: MapOption = None,
    reader: ReaderOption = None,
    vehicle: CheckVehicleOption = None,
    out: Annotated[
        Path, typer.Option("--out", help="Flight log to write: .csv, .csv.gz or .parquet.")
    ] = Path("results/flight.csv.gz"),
) -> dict[str, Any]:
    """Write a log in the kit's own format, from any that can be read.

    Example: windwrench convert theirs.csv --map rpm --out flight.csv.gz
    """
    import numpy as np

    from ..dynamics.vehicle_file import load_vehicle
    from ..identification.logs.flight_log import write_log
    from ..identification.logs.reading import read_log

    model = None if vehicle is None else load_vehicle(vehicle)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # the notes say the same
        flight = read_log(log, reader, model, map)
    if out.exists() and out.samefile(log):
        raise InputError(f"--out {out}: is the log itself; expected another file")
    notes = list(flight.notes)
    if flight.commanded and flight.command is not None:
        # what a command makes is the vehicle's to say each time the log is read
        flight = replace(flight, rotor_speeds=np.full_like(flight.rotor_speeds, np.nan))
        notes.append("the motor commands are written, and not the rotor speeds that follow them")
    with working("writing"):
        write_log(flight, out)
    for text in notes:
        note(text)
    channels = [
        name
        for name, there in (
            ("pose", flight.has_pose),
            ("rotor speeds", flight.has_rotor_speeds),
            ("motor commands", flight.command is not None),
            ("voltage", flight.voltage is not None),
            ("accelerometer", flight.accelerometer is not None),
            ("gyro", flight.gyro is not None),
            ("true wrench", flight.force is not None),
        )
        if there
    ]
    seconds = float(flight.t[-1] - flight.t[0])
    console.print(
        f"{flight.name}: {len(flight.t)} samples, {seconds:.1f} s: {', '.join(channels)}",
        highlight=False,
        markup=False,
    )
    say(out)
    return {
        "log": flight.name,
        "samples": len(flight.t),
        "seconds": seconds,
        "channels": channels,
        "notes": notes,
    }
