"""Tables of a Crazyflie's log variables, as cflib's examples and cfclient write them.

Columns bear the firmware's names (``motor.m1``, ``acc.x``, ``stateEstimate.x`` ...), beside a time:
``timestamp``, ``Timestamp`` or ``tick``, in milliseconds, or ``t`` or ``time`` in seconds. An empty
field is a variable that was not sampled in that row, so that blocks of different rates may share a
table. ``crazyflie_variables`` says what the variables become.
"""

from pathlib import Path

import numpy as np

from ....dynamics.vehicle import Vehicle
from ....runtime.errors import InputError
from ..flight_log import FlightLog
from ..tables import open_table
from .crazyflie_variables import MOTORS, crazyflie_log

SIGNATURE = MOTORS[0]

_TIMES = {"timestamp": 1e-3, "Timestamp": 1e-3, "tick": 1e-3, "t": 1.0, "time": 1.0}  # s per unit


def read(path: Path, vehicle: Vehicle | None = None) -> FlightLog:
    """Read a table of log variables; ``vehicle`` turns motor set points into rotor speeds.

    Raises:
        InputError: the file cannot be read, has no time, or lacks motors, or a pose and inertial
            sensors.
    """
    table = open_table(path)
    time = next((name for name in _TIMES if name in table.header), None)
    if time is None:
        raise InputError(
            f"{path}: no time; expected a column {', '.join(_TIMES)}, found "
            f"{', '.join(table.header[:20])}"
        )
    variables = [name for name in table.header if "." in name]
    columns = table.read([time, *variables])
    t = _TIMES[time] * columns.pop(time)
    there = np.isfinite(t)
    if there.sum() < 2:
        raise InputError(f"{path}: column {time}: no two times are numbers; expected some")
    found = {name: column[there] for name, column in columns.items()}
    unit = "milliseconds" if _TIMES[time] < 1.0 else "seconds"
    return crazyflie_log(
        path,
        "crazyflie_csv",
        [("table", t[there], found)],
        vehicle,
        (f"column {time} taken as {unit}",),
    )
