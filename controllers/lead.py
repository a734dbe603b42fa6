"""Hand-designed laws with a memory: what the admittance law becomes when the rate and the sum of
the torque count, too.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .observation import DECISION_PERIOD, FORCE_X, MAX_COMMAND, TORQUE_Z

Array = NDArray[np.floating[Any]]


def _command(value: float) -> Array:
    return np.array([np.clip(value, -MAX_COMMAND, MAX_COMMAND)], dtype=np.float32)


class Lead:
    """Ratio with derivative: ``x = tau_z / max(f_x, least_force)``, ``u = -(gain x + lead dx/dt)``.

    The rate is that from one decision to the next. It makes good for part of the filter's lag, and
    a vehicle that falls behind turns round earlier.

    Args:
        gain: 1/s.
        lead: of the rate, m/s per m/s.
        least_force: N, below which the force is held to be no jet at all.
    """

    def __init__(self, gain: float = 11.35, lead: float = 2.79, least_force: float = 0.183) -> None:
        self.gain, self.lead, self.least_force = gain, lead, least_force
        self.reset()

    def reset(self) -> None:
        """Forget the last episode."""
        self._last: float | None = None

    def __call__(self, observation: Array, info: Mapping[str, Any] | None = None) -> Array:
        """Return the command (1,) m/s for an observation (8,)."""
        x = float(observation[TORQUE_Z]) / max(float(observation[FORCE_X]), self.least_force)
        rate = 0.0 if self._last is None else (x - self._last) / DECISION_PERIOD
        self._last = x
        return _command(-(self.gain * x + self.lead * rate))


class AdmittancePID:
    """The admittance law with integral and lead: ``u = -(gain tau_z + integral S + lead
    dtau_z/dt)``, ``S`` the integral of ``tau_z``.

    The integral follows a fan that moves evenly without the steady offset that a proportional law
    needs. It stops while the command is at its bound and would grow further (no windup).

    Args:
        gain: m/s per Nm.
        integral: m/s per Nm s.
        lead: m/s per Nm/s.
    """

    def __init__(self, gain: float = 20.0, integral: float = 0.4, lead: float = 7.0) -> None:
        self.gain, self.integral, self.lead = gain, integral, lead
        self.reset()

    def reset(self) -> None:
        """Forget the last episode."""
        self._sum = 0.0
        self._last: float | None = None

    def __call__(self, observation: Array, info: Mapping[str, Any] | None = None) -> Array:
        """Return the command (1,) m/s for an observation (8,)."""
        torque = float(observation[TORQUE_Z])
        rate = 0.0 if self._last is None else (torque - self._last) / DECISION_PERIOD
        self._last = torque
        proportional = self.gain * torque + self.lead * rate
        total = self._sum + DECISION_PERIOD * torque
        command = -(proportional + self.integral * total)
        if abs(command) < MAX_COMMAND or command * torque > 0.0:
            self._sum = total
        return _command(-(proportional + self.integral * self._sum))
