"""Tables that blackbox_decode makes of a blackbox of Betaflight or INAV.

They have the log's numbers without its headers, so what the headers would say is told from the
numbers, and a note says how. ``betaflight_units`` says what the fields become.
"""

from pathlib import Path

from ....dynamics.vehicle import Vehicle
from ....runtime.errors import InputError
from ..flight_log import FlightLog
from ..tables import open_table
from .betaflight_units import FIELDS, betaflight_log, magnet_poles

SIGNATURE = ("time (us)", "motor[0]", "motor[3]")

_UNITS = (" (g)", " (m/s2)", " (deg/s)", " (rad/s)", " (V)", " (mV)", "")


def read(path: Path, vehicle: Vehicle | None = None, option: str = "") -> FlightLog:
    """Read a table of blackbox_decode; ``option``: number of the motors' magnet poles, for eRPM.

    Raises:
        InputError: the file cannot be read, or lacks a column.
    """
    poles = magnet_poles(option, path)
    table = open_table(path)
    missing = [name for name in SIGNATURE if name not in table.header]
    if missing:
        raise InputError(
            f"{path}: missing column(s) {', '.join(missing)}; expected those of blackbox_decode"
        )
    found: dict[str, tuple[str, str]] = {}  # field to column and unit
    for field in FIELDS:
        for unit in _UNITS:
            if f"{field}{unit}" in table.header:
                found[field] = f"{field}{unit}", unit.strip(" ()")
    columns = table.read(["time (us)", *(name for name, _ in found.values())])
    return betaflight_log(
        path,
        "betaflight_csv",
        1e-6 * columns["time (us)"],
        {field: columns[name] for field, (name, _) in found.items()},
        {field: unit for field, (_, unit) in found.items()},
        {},
        poles,
        vehicle,
        (),
    )
