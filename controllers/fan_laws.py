"""Hand-designed laws of the tasks with a fan: velocities along y, or along y and z, of the wrench.

The fan is at the origin and its jet along +x. The world's ``tau_z`` is positive at positive y, and
``tau_y`` negative above the axis. The velocity ``(-k tau_z, +k tau_y)`` leads to the axis. (In the
body frame of a vehicle facing the fan, y and the sign turn round.)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..runtime.arrays import Floats
from .observation import DECISION_PERIOD, FORCE_X, MAX_COMMAND, TORQUE_Y, TORQUE_Z


class _FanLaw:
    """Base of the laws: limits the command, without a memory."""

    def __post_init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget the last episode."""
        self._last: float | None = None

    def _rate(self, x: float) -> float:
        """Return the rate of ``x`` since the last decision, per second; zero at first."""
        last, self._last = self._last, x
        return 0.0 if last is None else (x - last) / DECISION_PERIOD

    def command(self, o: Floats, info: Mapping[str, Any] | None) -> tuple[float, ...]:
        """Return the wanted velocity along each commanded axis, m/s."""
        raise NotImplementedError

    def __call__(self, observation: Floats, info: Mapping[str, Any] | None = None) -> Floats:
        """Return the command (1,) m/s for an observation (8,), or (2,) for one of (10,)."""
        wanted = self.command(observation, info)
        return np.clip(wanted, -MAX_COMMAND, MAX_COMMAND).astype(np.float32)


@dataclass(eq=False)
class Hover(_FanLaw):
    """Stays in place: the lower bound, score 0."""

    axes: int = 1  # that are commanded

    def command(self, o: Floats, info: Mapping[str, Any] | None) -> tuple[float, ...]:
        """Return no velocity."""
        return (0.0,) * self.axes


@dataclass(eq=False)
class Admittance(_FanLaw):
    """The admittance controller of McKinnon and Schoellig (2016): velocity in proportion to the yaw
    torque and, with a second commanded axis, to the pitch torque.

    ``gain`` times the jet's largest torque is the largest speed of a fan followed by the law.
    """

    gain: float = 18.0  # m/s per Nm, sideways
    gain_z: float | None = None  # m/s per Nm, up and down; None: not commanded

    def command(self, o: Floats, info: Mapping[str, Any] | None) -> tuple[float, ...]:
        """Return ``-gain tau_z``, and ``gain_z tau_y``."""
        if self.gain_z is None:
            return (-self.gain * o[TORQUE_Z],)
        return -self.gain * float(o[TORQUE_Z]), self.gain_z * float(o[TORQUE_Y])


@dataclass(eq=False)
class Ratio(Admittance):
    """Velocity in proportion to ``tau_z / f_x``. The ratio grows with the offset, even far out
    where ``tau_z`` falls again.
    """

    gain: float = 8.0  # m/s per m, as ``gain_z``
    least_force: float = 0.1  # N, below which the force is held to be no jet at all

    def command(self, o: Floats, info: Mapping[str, Any] | None) -> tuple[float, ...]:
        """Return ``-gain tau_z / f_x``, and ``gain_z tau_y / f_x``."""
        force = max(float(o[FORCE_X]), self.least_force)
        return tuple(each / force for each in super().command(o, info))


@dataclass(eq=False)
class Lead(_FanLaw):
    """Ratio with derivative: ``x = tau_z / max(f_x, least_force)``, ``u = -(gain x + lead dx/dt)``.

    The rate is the difference between decisions. It compensates a part of the filter's lag, so the
    vehicle turns round earlier.
    """

    gain: float = 11.35  # 1/s
    lead: float = 2.79  # m/s per m/s
    least_force: float = 0.183  # N, below which the force is held to be no jet at all

    def command(self, o: Floats, info: Mapping[str, Any] | None) -> tuple[float, ...]:
        """Return ``-(gain x + lead dx/dt)``."""
        x = float(o[TORQUE_Z]) / max(float(o[FORCE_X]), self.least_force)
        return (-(self.gain * x + self.lead * self._rate(x)),)


@dataclass(eq=False)
class AdmittancePID(_FanLaw):
    """The admittance law with integral and lead: ``u = -(gain tau_z + integral S + lead
    dtau_z/dt)``, ``S`` the integral of ``tau_z``.

    The integral follows an evenly moving fan without the steady offset of a proportional law. The
    integral stops while the command is at its bound (no windup).
    """

    gain: float = 20.0  # m/s per Nm
    integral: float = 0.4  # m/s per Nm s
    lead: float = 7.0  # m/s per Nm/s

    def reset(self) -> None:
        """Forget the last episode."""
        super().reset()
        self._sum = 0.0

    def command(self, o: Floats, info: Mapping[str, Any] | None) -> tuple[float, ...]:
        """Return the sum of the three parts."""
        torque = float(o[TORQUE_Z])
        proportional = self.gain * torque + self.lead * self._rate(torque)
        total = self._sum + DECISION_PERIOD * torque
        command = -(proportional + self.integral * total)
        if abs(command) < MAX_COMMAND or command * torque > 0.0:
            self._sum = total
        return (-(proportional + self.integral * self._sum),)
