"""Control laws of the tasks in the wind: an observation (27,) gives an acceleration (3,) m/s2,
added to the flight loop's.

Each law is its paper's law for the position loop; attitude and rates stay with the flight loop. The
accelerations add to its proportional, derivative and weak integral action. Laws that cancel the
torque ask the flight loop's attitude loop for a tilt against the torque.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..dynamics.vehicle import Vehicle
from ..runtime.arrays import Array, Floats
from ..runtime.errors import InputError
from .axis_models import tilting
from .briefing import Briefing, standard_vehicle
from .flight import FlightGains
from .wind_observation import (
    FORCE,
    MAX_ACCELERATION,
    POSITION_ERROR,
    REFERENCE_VELOCITY,
    ROTOR_FORCE,
    SPECIFIC_FORCE,
    TORQUE,
    VELOCITY,
    WIND_PERIOD,
)

# s, of the attitude loop behind an acceleration that is asked for; upwards there is none
_ATTITUDE_LAG = FlightGains.rate / FlightGains.attitude * np.array([1.0, 1.0, 0.0])


@dataclass(eq=False)
class _WindLaw:
    """Base of the laws: proportional, derivative and integral action on the position error.

    ``a = kp e + kd de/dt + ki (integral of e)``, beside the flight loop's own; the integral stops
    where the action is limited.
    """

    kp: float = 0.0  # 1/s2
    kd: float = 0.0  # 1/s
    ki: float = 0.0  # 1/s3
    vehicle: Vehicle = field(default_factory=standard_vehicle)

    def __post_init__(self) -> None:
        self.reset()

    def brief(self, briefing: Briefing) -> None:
        """Fly the declared vehicle."""
        self.vehicle = briefing.vehicle

    def reset(self) -> None:
        """Forget the last episode."""
        self._sum: Array = np.zeros(3)
        self._last: dict[str, Array] = {}

    def __call__(self, observation: Floats, info: Mapping[str, Any] | None = None) -> Floats:
        """Return the action (3,) m/s2 for an observation (27,)."""
        o = np.asarray(observation, dtype=np.float64)
        error = o[POSITION_ERROR]
        free = (
            self.kp * error
            + self.kd * (o[REFERENCE_VELOCITY] - o[VELOCITY])
            + self.against_the_wind(o, info)
        )
        grown = self._sum + WIND_PERIOD * error
        within = np.abs(free + self.ki * grown) < MAX_ACCELERATION
        self._sum = np.where(within, grown, self._sum)
        wanted = free + self.ki * self._sum
        return np.clip(wanted, -MAX_ACCELERATION, MAX_ACCELERATION).astype(np.float32)

    def against_the_wind(self, o: Array, info: Mapping[str, Any] | None) -> Array:
        """Return the part (3,) m/s2 against the wind; none in this law."""
        return np.zeros(3)

    def _led(self, name: str, value: Array, lead: float | Array) -> Array:
        """Return ``value + lead dvalue/dt`` by the change of this ``name`` over a decision."""
        last = self._last.get(name, value)
        self._last[name] = value
        led: Array = value + lead * ((value - last) / WIND_PERIOD)
        return led

    def _tilting(self, o: Array, lead: float) -> Array:
        """Return the tilting parts of the estimated torque, led, along x and y, and 0: (3,) Nm."""
        return self._led("torque", np.array([*tilting(o[TORQUE]), 0.0]), lead)

    def _turned(self, o: Array, lead: float) -> Array:
        """Return the acceleration (3,) m/s2 for which the attitude loop makes the angular
        acceleration of the estimated torque, led.
        """
        against_tilt = np.diag(self.vehicle.inertia)[[1, 0]]  # kg m2, along x and y
        turn = self.vehicle.gravity / (FlightGains.attitude * against_tilt)
        return np.array([*turn, 0.0]) * self._tilting(o, lead)


class FlightLoopAlone(_WindLaw):
    """Adds nothing to the flight loop: the lower end of the score, 0."""


class PID(_WindLaw):
    """A PID position controller: it waits for the error."""


@dataclass(eq=False)
class PIDWithForce(_WindLaw):
    """A PID controller with the estimated force fed forward: ``- gain f / m``.

    ``f`` is the external force from the unscented Kalman filter (McKinnon and Schoellig, IROS
    2016).
    """

    gain: float = 1.0  # share of the force that is cancelled
    lead: float = 0.0  # s, by which the force's change over a decision is added

    def against_the_wind(self, o: Array, info: Mapping[str, Any] | None) -> Array:
        """Return ``- gain (f + lead df/dt) / m``."""
        return -self.gain / self.vehicle.mass * self._led("force", o[FORCE], self.lead)


@dataclass(eq=False)
class PIDWithWrench(PIDWithForce):
    """The same with the estimated torque, too: torque tilts the vehicle, and the tilt carries the
    vehicle away.
    """

    # m/s2 for 1 Nm on the standard vehicle, on others by inertia; g / (J k_attitude) cancels all of
    # a steady torque: 30
    tilt: float = 10.0
    tilt_lead: float = 0.1  # s, by which the torque's change over a decision is added

    def against_the_wind(self, o: Array, info: Mapping[str, Any] | None) -> Array:
        """Return the force's part, and ``- tilt (tau + tilt_lead dtau/dt)`` across."""
        tilt: float = self.tilt * standard_vehicle().inertia[0, 0] / self.vehicle.inertia[0, 0]
        return super().against_the_wind(o, info) - tilt * self._tilting(o, self.tilt_lead)


@dataclass(eq=False)
class INDI(_WindLaw):
    """Incremental nonlinear dynamic inversion of the position loop, and of the torque.

    Tal and Karaman, *Accurate tracking of aggressive quadrotor trajectories using incremental
    nonlinear dynamic inversion and differential flatness*, IEEE TCST 29(3), 2021, the incremental
    law of linear acceleration: ``(tau b_z)_c = (tau b_z)_f + a_c - a_f``. The commanded specific
    thrust is the present one plus the missing acceleration. Both pass the same Butterworth low-pass
    of second order, as of Smeur, Chu and de Croon (JGCD 39(3), 2016). With the flight loop's
    command as ``a_c`` this adds ``-(a_f - (tau b_z)_f + g)``: the low-passed difference of
    accelerometer and rotor model.

    The paper's law of angular acceleration, ``mu_c = mu_f + J (alpha_c - alpha_f)``, takes the
    rotors' unexplained torque from the command. Here the wrench filter estimates this torque, and
    the flight loop's attitude loop, ``alpha = k_attitude a / g``, is inverted: ``a = - g (tau +
    tilt_lead dtau/dt) / (J k_attitude)``. The lead makes good for the lag of estimate and motors.
    Both increments pass the same low-pass, as there. Measurements come as means over 40 ms.

    Raises:
        InputError: ``cutoff`` lies beyond half the rate of decisions.
    """

    cutoff: float = 5.0  # Hz, of the second-order Butterworth low-pass
    tilt_lead: float = 0.25  # s, by which the torque's change over a decision is added

    def __post_init__(self) -> None:
        if not 0.0 < self.cutoff < 0.5 / WIND_PERIOD:
            raise InputError(
                f"INDI: cutoff must lie between 0 and {0.5 / WIND_PERIOD:g} Hz, got {self.cutoff:g}"
            )
        from scipy.signal import butter

        self._filter = butter(2, self.cutoff, fs=1.0 / WIND_PERIOD)
        self.reset()

    def reset(self) -> None:
        """Forget the last episode."""
        super().reset()
        self._state: Array | None = None

    def against_the_wind(self, o: Array, info: Mapping[str, Any] | None) -> Array:
        """Return the low-passed difference of rotor model and accelerometer, less the tilt."""
        from scipy.signal import lfilter, lfilter_zi

        x = o[ROTOR_FORCE] - o[SPECIFIC_FORCE] - self._turned(o, self.tilt_lead)
        if self._state is None:  # as if it had always been so
            self._state = np.outer(lfilter_zi(*self._filter), x)
        y, self._state = lfilter(*self._filter, x[np.newaxis], axis=0, zi=self._state)
        return np.asarray(y[0])


@dataclass(eq=False)
class L1Adaptive(_WindLaw):
    """L1 adaptive augmentation of the position loop, and of the torque.

    Wu, Cheng, Ackerman, Gahlawat, Lakshmanan, Zhao and Hovakimyan, *L1 adaptive augmentation for
    geometric tracking control of quadrotors*, ICRA 2022 (and L1Quad, arXiv 2302.07208): a state
    predictor ``dv^/dt = f/m - g + sigma^ + A_s (v^ - v)``, the piecewise constant adaptation law
    ``sigma^ = -Phi^-1 exp(A_s T) (v^ - v)`` with ``Phi = A_s^-1 (exp(A_s T) - I)``, and a low-pass
    of first order: the control ``-C(s) sigma^``. The predictor's input is the rotors' specific
    force by the declared model, and of the torque the wrench filter's estimate stands for
    ``sigma^``. Neither acts where the command does, before the attitude loop: both are unmatched,
    and the control is ``-C(s) H_m^-1(s) H_um(s) sigma^`` (Xargay, Hovakimyan and Cao, ACC 2010). To
    first order the inverse is ``sigma^ + k_rate / k_attitude dsigma^/dt`` for the force, and as in
    ``INDI`` for the torque.

    Raises:
        InputError: a number is not above zero.
    """

    pole: float = 5.0  # 1/s, -A_s
    bandwidth: float = 5.0  # rad/s, of C(s)
    tilt_lead: float = 0.25  # s, by which the torque's change over a decision is added

    def __post_init__(self) -> None:
        for name in ("pole", "bandwidth"):
            if not getattr(self, name) > 0.0:
                raise InputError(f"L1: {name} must be above 0, got {getattr(self, name)!r}")
        decay = math.exp(-self.pole * WIND_PERIOD)
        self._adapt = self.pole * decay / (1.0 - decay)  # Phi^-1 exp(A_s T), but for its sign
        self._decay, self._phi = decay, (1.0 - decay) / self.pole
        self._keep = math.exp(-self.bandwidth * WIND_PERIOD)
        self.reset()

    def reset(self) -> None:
        """Forget the last episode."""
        super().reset()
        self._gap: Array | None = None  # v^ - v
        self._sigma = self._filtered = self._velocity = np.zeros(3)

    def against_the_wind(self, o: Array, info: Mapping[str, Any] | None) -> Array:
        """Advance predictor and adaptation by a decision; return ``-C(s) sigma^``."""
        v, pushed = o[VELOCITY], o[ROTOR_FORCE] - np.array([0.0, 0.0, self.vehicle.gravity])
        turned = self._turned(o, self.tilt_lead)
        if self._gap is None:  # hovering: the wind is what the rotors balance
            self._gap, self._sigma, self._filtered = np.zeros(3), -pushed, turned - pushed
        else:
            # the predictor over the interval that ends now, with its input and estimate
            risen = (v - self._velocity) / WIND_PERIOD
            self._gap = self._decay * self._gap + self._phi * (pushed + self._sigma - risen)
            self._sigma = -self._adapt * self._gap
            matched = self._led("sigma", self._sigma, _ATTITUDE_LAG) + turned
            self._filtered = matched + self._keep * (self._filtered - matched)
        self._velocity = v.copy()
        return -self._filtered
