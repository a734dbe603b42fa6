"""The channels of a log's file: those of a PX4 log at their own rates, others as their reader gives
them.
"""

from pathlib import Path

from ...dynamics.vehicle import Vehicle
from ..logs.readers import px4_channels, px4_ulog
from ..logs.reading import read_log
from .channels import Channels, channels_of_log


def read_channels(
    path: Path, reader: str | None = None, vehicle: Vehicle | None = None
) -> tuple[Channels, tuple[str, ...]]:
    """Return a log's gyro, accelerometer and commands, and notes on where they came from.

    Raises:
        InputError: the file cannot be read, or lacks one of the three.
    """
    if reader in (None, "px4_ulog") and path.name.lower().endswith(px4_ulog.SUFFIXES):
        streams, notes, motors = px4_channels.read_streams(path)
        names = tuple(f"PX4 motor {motor}" for motor in motors)
        channels = Channels(
            str(path),
            *streams["gyro"],
            *streams["accelerometer"],
            *streams["command"],
            motor_names=(names[0], names[1], names[2], names[3]),
        )
        return channels, notes
    log = read_log(path, reader, vehicle)
    return channels_of_log(log), log.notes
