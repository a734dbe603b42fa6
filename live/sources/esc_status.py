"""MAVLink's ESC_STATUS: a message of PX4, missing in pymavlink's dialects. This file adds the
message to a dialect.

Message 291 of MAVLink's common set: index (of the first of four ESCs), time_usec, rpm[4] (with the
sense of rotation), voltage[4] in V, current[4] in A.
"""

import struct
from typing import Any

NUMBER = 291
# MAVLink's check that sender and receiver have one definition
CHECKSUM = 10
_LAYOUT = "<Q4i4f4fB"  # in the order of the wire: larger types first


def add_esc_status(dialect: Any) -> Any:
    """Return the class of the message in a dialect; add a missing one."""
    if NUMBER in dialect.mavlink_map:
        return dialect.mavlink_map[NUMBER]

    class EscStatus(dialect.MAVLink_message):  # type: ignore[misc]
        """ESC status."""

        id = NUMBER
        msgname = "ESC_STATUS"
        name = "ESC_STATUS"
        fieldnames = ("index", "time_usec", "rpm", "voltage", "current")
        orders = (4, 0, 1, 2, 3)
        lengths = (1, 4, 4, 4, 1)
        crc_extra = CHECKSUM
        unpacker = struct.Struct(_LAYOUT)

        def __init__(self, *values: Any) -> None:
            super().__init__(NUMBER, self.name)
            self._fieldnames = self.fieldnames
            for name, value in zip(self.fieldnames, values, strict=True):
                setattr(self, name, value)

        def pack(self, mav: Any, force_mavlink1: bool = False) -> Any:
            """Return the message's bytes."""
            payload = self.unpacker.pack(
                self.time_usec, *self.rpm, *self.voltage, *self.current, self.index
            )
            return self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1)

    dialect.mavlink_map[NUMBER] = EscStatus
    return EscStatus
