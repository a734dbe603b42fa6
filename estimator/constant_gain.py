"""The wrench filter with its converged gain: less than a tenth of the work, for training and for
many vehicles.

The gain of a Kalman filter in steady flight converges. Here ``WrenchUKF`` at hover gives the gain
once. The same functions carry the mean, (2)-(5), (11)-(14), and nothing carries the covariance. A
yawed vehicle sees the same problem turned about the vertical: the innovation is turned into the
vehicle's heading, and the correction back.

After a gap, a restart or a refused measurement a covariance takes over. Its model is linearised at
hover, in the frame of the vehicle's heading. So the covariance depends on the measurements and
their times, not on the vehicle's path: a filter in C with single precision comes back to its
constant gain at the same step, and needs no Jacobian. At large tilts and fast turns the covariance
is an approximation, as is the constant gain itself. ``core/constant_gain.hpp`` steps the filter.
"""

import math
from functools import lru_cache

import numpy as np

from .. import _core
from ..runtime.errors import InputError
from .estimate import Array
from .filter_record import FILTER
from .recovery import N
from .ukf import WrenchUKF

_MEASURED = (0, 1, 2, 6, 7, 8)  # rows of (rho, x) in the error state
_LONGEST = 60  # s of hover until the gain must have converged
_CONVERGED = 1e-9  # relative change of the covariance in a second
_HEIGHT = 1.2  # m, in hover
_NOTHING = 1e-9  # share of an acceleration's largest deviation: rounding of a derivative
# The variances must have been near for so many time constants of the wrench. A difference of e^-4
# remains: a step earlier or later makes no difference.
_SETTLE = 2.0


class ConstantGainFilter(WrenchUKF):
    """The wrench filter with a constant gain; ``reset`` and ``step`` are those of ``WrenchUKF``.

    The gain is converged from the start: a wrong first guess of pose or wrench takes the rise time
    to correct. Up to 0.1 s without a measurement, or a part of one, the filter coasts: the state
    moves on by the model, and the gain stays. After a longer gap, a restart or a refused
    measurement the filter has a covariance until convergence: that of the model linearised at
    hover. ``covariance`` is always that of a vehicle facing along x. With noise that differs
    between x and y, the gain is exact at this heading only.

    Arguments are those of ``WrenchUKF``.

    Raises:
        InputError: a setting is out of range, or the filter does not converge at hover.
    """

    _step_at = staticmethod(_core.step_with_gain)
    _step_address = staticmethod(_core.step_with_gain_address)
    _no_imu = "correct_imu needs a covariance; use WrenchUKF"
    _converged: Array | None = None

    def _prepare(self) -> None:
        """Converge at hover."""
        self.reset((0.0, 0.0, _HEIGHT), (1.0, 0.0, 0.0, 0.0))
        P, hover = _converged(self.record.tobytes(), self.vehicle.voltage_ref)
        self._converged, f = P, self.record[0]
        f["hover"] = hover
        inverse = 1.0 / f["noise"]
        # with P after the correction: K = P H' / R, and the innovation's inverse covariance is (R -
        # H P H') within / R
        f["gain"] = P[:, list(_MEASURED)] * inverse
        remainder = np.diag(f["noise"]) - P[np.ix_(_MEASURED, _MEASURED)]
        f["information"] = inverse[:, None] * remainder * inverse
        f["P"] = f["converged"] = P
        walks = f["thrust"] / f["force_walk"], f["motor_torque"] / f["torque_walk"]
        f["settle"] = _SETTLE * self.period * math.sqrt(float(np.max(walks)))
        f["steady"] = 1

    def _begin(self) -> None:
        """Start with the converged covariance, whatever ``reset`` was given."""
        if self._converged is not None:
            f = self.record[0]
            f["P"], f["steady"] = self._converged, 1


@lru_cache(maxsize=32)
def _converged(start: bytes, voltage: float) -> tuple[Array, Array]:
    """Return the converged covariance (18, 18) after a correction of ``WrenchUKF``, its record
    given at hover, and the derivatives (6, 18) of its accelerations there.

    Raises:
        InputError: no convergence.
    """
    record = np.frombuffer(start, dtype=FILTER).copy()
    f, address = record[0], record.ctypes.data
    z = np.concatenate([f["last_speeds"], f["x"][:7]])
    second = max(1, round(1.0 / float(f["period"])))
    for _ in range(_LONGEST):
        before = f["P"].copy()
        _core.hold_still(address, z, second, voltage)
        scale = np.sqrt(np.diag(f["P"]))
        if np.all(np.abs(f["P"] - before) <= _CONVERGED * np.outer(scale, scale)):
            return np.array(f["P"]), _jacobian_at_hover(address, voltage, scale)
    raise InputError(
        f"ConstantGainFilter: the gain does not converge within {_LONGEST} s of hover; use "
        f"WrenchUKF"
    )


def _jacobian_at_hover(address: int, voltage: float, deviations: Array) -> Array:
    """Return the derivatives (6, 18) of angular (body) and linear acceleration by the error state
    of the filter at an address, without rounding errors. The filter hovers facing along x.

    Args:
        address: the filter's record.
        voltage: V.
        deviations: (18,) of the error state: the scale of an acceleration's parts.
    """
    out = np.zeros((6, N))
    _core.hover_jacobian(address, voltage, out)
    size = np.abs(out) * deviations
    out[size < _NOTHING * size.max(axis=1, keepdims=True)] = 0.0
    return out
