"""The steady wind whose drag an external force would be, of a vehicle that declares rotor drag.

The declared drag is that of still air. In a horizontal wind w it grows by
``sum_i W_i R diag(kdx, kdy, 0) R' w`` (``dynamics.effects.rotor_drag``), which the filter sees as
external force. That is linear in w, and solved for it; what else pushes the vehicle is taken for
wind as well.
"""

import numpy as np

from ...dynamics.rotation import matrix_of
from ...dynamics.vehicle import Vehicle
from ..filtering import Output
from ..messages import Array

_TILTED = 0.2  # of the drag of a level vehicle, below which the rest is no measure of wind


class Wind:
    """From a wrench to a wind.

    Args:
        vehicle: that may declare ``rotor_drag``.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        given = next((e.coefficients for e in vehicle.effects if e.name == "rotor_drag"), {})
        self._drag = np.array([given.get("kdx", 0.0), given.get("kdy", 0.0), 0.0])

    def of(self, output: Output) -> tuple[Array, Array] | None:
        """Return the wind (3,) in m/s, world, and its standard deviation (3,), of which the
        vertical ones are zero: none is assumed; None where the vehicle declares no drag.
        """
        if not np.all(self._drag[:2] > 0.0):
            return None
        R = matrix_of(output.estimate.quaternion)
        total = float(np.sum(output.row.rotor_speeds))
        drag = (total * (R * self._drag) @ R.T)[:2, :2]
        level = total * float(np.min(self._drag[:2]))
        if not level > 0.0 or float(np.linalg.eigvalsh(drag)[0]) < _TILTED * level:
            return None
        inverse = np.linalg.inv(drag)
        wind, std = np.zeros(3), np.zeros(3)
        wind[:2] = inverse @ output.estimate.force[:2]
        covariance = inverse @ output.estimate.covariance[15:17, 15:17] @ inverse.T
        std[:2] = np.sqrt(np.diagonal(covariance))
        return wind, std
