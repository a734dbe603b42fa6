"""The wrench on its way back to an autopilot, in north, east, down; and the steady wind whose drag
the force would be, of a vehicle that declares rotor drag.

The declared drag is that of still air. In a horizontal wind w it grows by
``sum_i W_i R diag(kdx, kdy, 0) R' w`` (``dynamics.effects.rotor_drag``), which the filter sees as
external force. The wind is solved for in that linear equation: any other force counts as wind too.
"""

import math
import time
from typing import Any

import numpy as np

from ...dynamics.rotation import matrix_of
from ...dynamics.vehicle import Vehicle
from ..filtering import Output
from ..messages import Array
from .mavlink_messages import HALF_TURN, WRAP

_PLOTTED = 100_000_000  # ns between values for plots
_TILTED = 0.2  # of the drag of a level vehicle, below which the rest is no measure of wind


class WrenchSender:
    """Sends estimates.

    Args:
        vehicle: that flies; its declared drag makes a wind of the force.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._due_plot = 0  # ns

    def send(self, mav: Any, output: Output) -> None:
        """Send an estimate with pymavlink's ``MAVLink``.

        Raises:
            OSError: the link does not take it.
        """
        force = output.estimate.force * HALF_TURN
        torque = output.estimate.torque * HALF_TURN
        microseconds = max(round(1e6 * output.t), 0)
        data = [*force, *torque, *output.std, output.estimate.nis, output.estimate.status_code]
        padded = [float(x) for x in data] + [0.0] * (58 - len(data))
        mav.debug_float_array_send(microseconds, b"wrench", 1, padded)
        now = time.monotonic_ns()
        if now < self._due_plot:
            return
        self._due_plot = now + _PLOTTED
        milliseconds = (microseconds // 1000) % WRAP
        for name, values in (("force", force), ("torque", torque)):
            for axis, value in zip("ned", values, strict=True):
                mav.named_value_float_send(milliseconds, f"{name}_{axis}".encode(), float(value))
        wind = wind_of(self._vehicle, output)
        if wind is not None:
            velocity, std = wind[0] * HALF_TURN, wind[1]
            horizontal = float(math.hypot(std[0], std[1]) / math.sqrt(2.0))
            mav.wind_cov_send(
                microseconds,
                *(float(x) for x in velocity),
                horizontal,
                float(std[2]),
                float(output.estimate.position[2]),
                horizontal,
                float(std[2]),
            )


def wind_of(vehicle: Vehicle, output: Output) -> tuple[Array, Array] | None:
    """Return the wind (3,) in m/s, world, and its standard deviation (3,), of which the vertical
    ones are zero: none is assumed; None where the vehicle declares no ``rotor_drag``.
    """
    given = next((e.coefficients for e in vehicle.effects if e.name == "rotor_drag"), {})
    still = np.array([given.get("kdx", 0.0), given.get("kdy", 0.0), 0.0])
    if not np.all(still[:2] > 0.0):
        return None
    R = matrix_of(output.estimate.quaternion)
    total = float(np.sum(output.row.rotor_speeds))
    drag = (total * (R * still) @ R.T)[:2, :2]
    level = total * float(np.min(still[:2]))
    if not level > 0.0 or float(np.linalg.eigvalsh(drag)[0]) < _TILTED * level:
        return None
    inverse = np.linalg.inv(drag)
    wind, std = np.zeros(3), np.zeros(3)
    wind[:2] = inverse @ output.estimate.force[:2]
    covariance = inverse @ output.estimate.covariance[15:17, 15:17] @ inverse.T
    std[:2] = np.sqrt(np.diagonal(covariance))
    return wind, std
