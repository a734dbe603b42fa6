"""The channels of a log's file: those of a PX4 log at their own rates, others as their reader gives
them.
"""

from pathlib import Path

from ...dynamics.vehicle import Vehicle
from ..logs.flight_log import FlightLog
from ..logs.readers import px4_channels
from ..logs.readers.recognise import reader_by_content
from ..logs.reading import read_log
from .channels import Channels, channels_of_log


def read_channels(
    path: Path,
    reader: str | None = None,
    vehicle: Vehicle | None = None,
    log_map: str | None = None,
) -> tuple[Channels, tuple[str, ...]]:
    """Return a log's gyro, accelerometer and commands, and notes on where they came from.

    Raises:
        InputError: the file cannot be read, or lacks one of the three.
    """
    if log_map is None and reader in (None, "px4_ulog") and _is_ulog(path):
        return _of_ulog(path)
    log = read_log(path, reader, vehicle, log_map)
    return channels_of_log(log), log.notes


def channels_of(path: Path, log: FlightLog) -> Channels:
    """Return the channels of a log that was read from a file: a PX4 log's own rates are in the file
    alone.

    Raises:
        InputError: gyro, accelerometer or commands are missing.
    """
    return _of_ulog(path)[0] if _is_ulog(path) else channels_of_log(log)


def _is_ulog(path: Path) -> bool:
    reader = reader_by_content(path)
    return reader is not None and reader.name == "px4_ulog"


def _of_ulog(path: Path) -> tuple[Channels, tuple[str, ...]]:
    streams, notes, motors = px4_channels.read_streams(path)
    first, second, third, fourth = (f"PX4 motor {motor}" for motor in motors)
    channels = Channels(
        str(path),
        *streams["gyro"],
        *streams["accelerometer"],
        *streams["command"],
        motor_names=(first, second, third, fourth),
    )
    return channels, notes
