"""The residual wrench of a log: the wrench of the measured motion less the wrench of a model."""

import numpy as np
from numpy.typing import NDArray

from windwrench.dynamics.vehicle import Vehicle
from windwrench.identification.motion.residual import acting_wrench, needed_wrench
from windwrench.identification.motion.signals import Signals


def residual_wrench(signals: Signals, vehicle: Vehicle) -> NDArray[np.float64]:
    """Return the residual (n, 6): force in the world frame (N), torque about the centre of mass in
    the body frame (Nm).
    """
    acting, body = acting_wrench(signals, vehicle)
    return needed_wrench(signals, body) - acting
