"""Messages of a vehicle, and the rows of a flight made from them.

A source returns a ``Measurement``: the quantities in one message in this kit's frames and units,
the sender's time of measurement, and the time of arrival. The filter and the recording take a
``Row``: a row of a flight log, in the stream's own time.
"""

from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from ..identification.logs.flight_log import NORM_TOLERANCE
from ..runtime.arrays import Array

SECOND = 1_000_000_000  # ns


class Malformed(ValueError):  # noqa: N818 - of one message, not of the request
    """A message without a usable measurement: the reason, in words."""


def normalised(quaternion: Any) -> Array:
    """Return a quaternion (..., 4) of length 1.

    Raises:
        Malformed: its length is far from 1.
    """
    length = float(np.linalg.norm(quaternion))
    if not abs(length - 1.0) <= NORM_TOLERANCE:
        raise Malformed(
            f"a quaternion of length {length:.4g}; expected 1 within {NORM_TOLERANCE:g}"
        )
    return np.asarray(quaternion) / length


@dataclass(slots=True, kw_only=True)
class Measured:
    """Quantities at one time; None: not measured."""

    position: Array | None = None  # (3,) m, world
    quaternion: Array | None = None  # (4,) body to world, scalar first, of length 1
    rotor_speeds: Array | None = None  # (4,) rad/s
    command: Array | None = None  # (4,) motor commands, 0 to 1
    voltage: float | None = None  # V
    gyro: Array | None = None  # (3,) rad/s, body
    accelerometer: Array | None = None  # (3,) m/s2, body
    force: Array | None = None  # (3,) N, world: the true one, from a simulator
    torque: Array | None = None  # (3,) Nm, likewise

    @property
    def has_pose(self) -> bool:
        """Whether a whole pose was measured."""
        return self.position is not None and self.quaternion is not None

    @property
    def has_imu(self) -> bool:
        """Whether an inertial sensor measured something."""
        return self.gyro is not None or self.accelerometer is not None

    @property
    def measured(self) -> dict[str, Any]:
        """Measured and commanded quantities, by name."""
        values = ((name, getattr(self, name)) for name in QUANTITIES)
        return {name: value for name, value in values if value is not None}

    @property
    def has_motors(self) -> bool:
        """Whether rotor speeds were measured, or commands given."""
        return self.rotor_speeds is not None or self.command is not None


QUANTITIES = tuple(one.name for one in fields(Measured))


@dataclass(slots=True)
class Measurement(Measured):
    """One message."""

    kind: str  # messages of one kind share a clock
    stamp: int | None  # ns, time of measurement on the sender's clock; None: not stated
    arrival: int  # ns, this machine's monotonic clock
    whole: bool = False  # a row by itself: pose and rotor speeds at one time
    anew: bool = False  # the first of another sender, with another clock


@dataclass(slots=True)
class Row(Measured):
    """A row of the flight: all quantities at one time."""

    t: float  # s, stream's time
    arrival: int  # ns, of its last message
    rotor_speeds: Array = field(kw_only=True)  # always known
    commanded: bool = False  # the rotor speeds follow from commands
    stamp: int | None = None  # ns, sender's clock, of its last message
