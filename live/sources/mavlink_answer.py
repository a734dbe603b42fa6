"""The wrench on its way back to an autopilot, in north, east, down. A vehicle with declared rotor
drag also gets the steady wind whose drag equals the force.

The declared drag holds in still air. A horizontal wind w adds
``sum_i W_i R diag(kdx, kdy, 0) R' w`` (``dynamics.effects.rotor_drag``), an external force for the
filter. This linear equation is solved for the wind: any other force counts as wind too.
"""

import math
from typing import Any

import numpy as np

from ...dynamics.rotation import matrix_of
from ...dynamics.vehicle import Vehicle
from ...runtime.arrays import Array
from ..filtering import Output
from .mavlink_messages import HALF_TURN, WRAP

_TILTED = 0.2  # least share of a level vehicle's drag that still measures wind


def send_wrench(mav: Any, output: Output, vehicle: Vehicle, plotted: bool) -> None:
    """Send an estimate with pymavlink's ``MAVLink``.

    Args:
        mav: pymavlink's.
        output: the estimate.
        vehicle: its declared drag turns the force into a wind.
        plotted: values for plots of ground stations are due too.

    Raises:
        OSError: the link takes no more now.
    """
    force, torque = output.wrench.reshape(2, 3) * HALF_TURN
    microseconds = max(round(1e6 * output.t), 0)
    data = [*force, *torque, *output.std, output.estimate.nis, output.estimate.status_code]
    mav.debug_float_array_send(microseconds, b"wrench", 1, data + [0.0] * (58 - len(data)))
    if not plotted:
        return
    milliseconds = (microseconds // 1000) % WRAP
    for name, values in (("force", force), ("torque", torque)):
        for axis, value in zip("ned", values, strict=True):
            mav.named_value_float_send(milliseconds, f"{name}_{axis}".encode(), value)
    wind = _wind(vehicle, output)
    if wind is not None:
        velocity, std = wind
        north, east = (velocity * HALF_TURN[:2]).tolist()
        horizontal = math.hypot(*std) / math.sqrt(2.0)
        height = output.estimate.position[2]
        mav.wind_cov_send(microseconds, north, east, -0.0, horizontal, 0.0, height, horizontal, 0.0)


def _wind(vehicle: Vehicle, output: Output) -> tuple[Array, Array] | None:
    """Return the horizontal wind (2,) in m/s, world, and its standard deviation (2,), with no
    vertical wind assumed; None: the vehicle declares no ``rotor_drag``.
    """
    coefficients = next((e.coefficients for e in vehicle.effects if e.name == "rotor_drag"), {})
    still = np.array([coefficients.get("kdx", 0.0), coefficients.get("kdy", 0.0), 0.0])
    if not np.all(still[:2] > 0.0):
        return None
    R = matrix_of(output.estimate.quaternion)
    total = np.sum(output.row.rotor_speeds)
    drag = (total * (R * still) @ R.T)[:2, :2]
    level = total * np.min(still[:2])
    if not level > 0.0 or np.linalg.eigvalsh(drag)[0] < _TILTED * level:
        return None
    inverse = np.linalg.inv(drag)
    force = output.estimate.covariance[15:17, 15:17].copy()
    np.fill_diagonal(force, output.std[:2] ** 2)  # noise and the vehicle's uncertainty
    covariance = inverse @ force @ inverse.T
    return inverse @ output.estimate.force[:2], np.sqrt(np.diagonal(covariance))
