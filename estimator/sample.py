"""One sample on its way into an estimator: rotor speeds and pose, checked, and the estimate on its
way out.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.ma import MaskedArray
from numpy.typing import ArrayLike

from ..runtime.arguments import described, real_numbers
from ..runtime.errors import InputError
from .estimate import Array

POSITION, ATTITUDE = 1, 2  # the parts of a pose; their sum is both


class Sample:
    """A buffer (11,) of rotor speeds, position and quaternion for the core.

    Args:
        z: the buffer, contiguous.
    """

    __slots__ = ("_position", "_quaternion", "_speeds", "z")

    def __init__(self, z: Array) -> None:
        self.z = z
        view = memoryview(self.z)  # type: ignore[arg-type]
        self._speeds, self._position, self._quaternion = view[0:4], view[4:7], view[7:11]

    def read(
        self, rotor_speeds: ArrayLike, position: ArrayLike | None, quaternion: ArrayLike | None
    ) -> int:
        """Take in rotor speeds (4,) and what there is of a pose, (3,) and (4,); return its parts.

        Masked numbers were not measured.

        Raises:
            InputError: a shape or a type is wrong, or a rotor speed is negative.
        """
        if MaskedArray in (type(rotor_speeds), type(position), type(quaternion)):
            return convert(self.z, rotor_speeds, position, quaternion)
        try:
            # a memory view takes in arrays of doubles of its own shape, in half the time that NumPy
            # would need
            self._speeds[:] = rotor_speeds  # type: ignore[assignment]
            a, b, c, d = self._speeds
            if a < 0.0 or b < 0.0 or c < 0.0 or d < 0.0:
                raise ValueError
            if position is None:
                if quaternion is None:
                    return 0
                self._quaternion[:] = quaternion  # type: ignore[assignment]
                return ATTITUDE
            self._position[:] = position  # type: ignore[assignment]
            if quaternion is None:
                return POSITION
            self._quaternion[:] = quaternion  # type: ignore[assignment]
            return POSITION + ATTITUDE
        # a list, another shape, memory out of order, another type of number: each a different error
        # of a memory view
        except (TypeError, ValueError, BufferError, NotImplementedError):
            return convert(self.z, rotor_speeds, position, quaternion)

    def bad_quaternion(self) -> InputError:
        """Return the error for a quaternion that is no rotation."""
        return InputError(
            f"step: quaternion must have length 1, got {np.linalg.norm(self.z[7:11]):g}"
        )


def convert(
    z: Array, rotor_speeds: ArrayLike, position: ArrayLike | None, quaternion: ArrayLike | None
) -> int:
    """Take anything that NumPy can make numbers of into samples (..., 11): rotor speeds (..., 4)
    and what there is of poses, (..., 3) and (..., 4); return its parts.

    Raises:
        InputError: a shape or a type is wrong, or a rotor speed is negative.
    """
    parts = 0
    for name, value, where, part, unit in (
        ("rotor_speeds", rotor_speeds, z[..., 0:4], 0, "of rad/s"),
        ("position", position, z[..., 4:7], POSITION, "in m or None"),
        ("quaternion", quaternion, z[..., 7:11], ATTITUDE, "or None"),
    ):
        if value is None and part:
            where[...] = math.nan
            continue
        array = real_numbers(value)
        if array is None or array.shape != where.shape:
            raise InputError(f"step: expected {name} {where.shape} {unit}, got {described(value)}")
        if not part and np.any(array < 0.0):
            where[...] = math.nan  # not known: the last ones hold for what comes next
            raise InputError(
                f"step: rotor_speeds must not be negative, got {np.nanmin(array):g} rad/s; the "
                "vehicle's spin says in which direction a rotor turns"
            )
        where[...] = array
        parts += part
    return parts
