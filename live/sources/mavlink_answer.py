"""The wrench on its way back to an autopilot, in north, east, down."""

import math
import time
from typing import Any

from ...dynamics.vehicle import Vehicle
from ...estimator.estimate import STATUSES
from ..filtering import Output
from .mavlink_messages import HALF_TURN, WRAP
from .wind import Wind


class WrenchSender:
    """Sends estimates.

    Args:
        vehicle: that flies; its declared drag makes a wind of the force.
        plotted: s between values for plots.
    """

    def __init__(self, vehicle: Vehicle, plotted: float) -> None:
        self._wind = Wind(vehicle)
        self._plotted = plotted
        self._due_plot = 0  # ns

    def send(self, mav: Any, output: Output) -> None:
        """Send an estimate with pymavlink's ``MAVLink``.

        Raises:
            OSError: the link does not take it.
        """
        force = output.estimate.force * HALF_TURN
        torque = output.estimate.torque * HALF_TURN
        status = float(STATUSES.index(output.estimate.status))
        microseconds = max(round(1e6 * output.t), 0)
        data = [*force, *torque, *output.std, output.estimate.nis, status]
        padded = [float(x) for x in data] + [0.0] * (58 - len(data))
        mav.debug_float_array_send(microseconds, b"wrench", 1, padded)
        now = time.monotonic_ns()
        if now < self._due_plot:
            return
        self._due_plot = now + round(self._plotted * 1e9)
        milliseconds = (microseconds // 1000) % WRAP
        for name, values in (("force", force), ("torque", torque)):
            for axis, value in zip("ned", values, strict=True):
                mav.named_value_float_send(milliseconds, f"{name}_{axis}".encode(), float(value))
        wind = self._wind.of(output)
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
