"""The declaration of a quadrotor: rigid body, rotors, sensing, the effects in its model and the
accuracy of its numbers.

Vehicles are data: ``vehicle_file`` reads them.
Rotor geometry, mixing and its inverse are equations (1) and (8)-(10) of McKinnon and Schoellig,
IROS 2016.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BeforeValidator, Field

from ..runtime.errors import InputError
from ..runtime.forms import STRICT, Number, Positive, expected, numbers

Array = NDArray[np.float64]

# Rotors as in the paper: 1 front-left, 2 rear-left, 3 rear-right, 4 front-right, with x forward and
# y left.
QUADRANT = np.array([[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0]])
# Turning sense about body +z; the reaction on the body is opposite: tau_z = M1 - M2 + M3 - M4.
SPIN = np.array([-1.0, 1.0, -1.0, 1.0])

_MOST_POWERS = 6  # coefficients of a motor curve


def _must(hold: Callable[[Any], bool], words: str) -> AfterValidator:
    """Return a validator that refuses numbers without a property."""

    def check(value: Any) -> Any:
        if not hold(value):
            raise ValueError(f"must be {words}, got {np.asarray(value).tolist()}")
        return value

    return AfterValidator(check)


def _is_definite(x: Array) -> bool:
    symmetric = np.allclose(x, x.T, rtol=1e-9, atol=0.0)
    return bool(symmetric and np.all(np.linalg.eigvalsh(x) > 0))


def _full_thrust(value: tuple[float, ...]) -> tuple[float, ...]:
    if not sum(value) > 0.0:
        raise ValueError(
            f"at the full command, the sum of its coefficients, is {sum(value):g} N; expected a "
            "positive one"
        )
    return value


def _matrix(value: object) -> object:
    """Return the matrix of three principal values."""
    short = isinstance(value, list) and len(value) == 3 and not isinstance(value[0], list)
    try:
        return np.diag(np.array(value, dtype=np.float64)) if short else value
    except (TypeError, ValueError, OverflowError):
        return value


def _list_of_effects(value: object) -> object:
    if not isinstance(value, list):
        raise ValueError(f"must be a list of {{name, coefficients}}, got {value!r}")
    return value


_Coefficients = Annotated[
    Mapping[str, Number], BeforeValidator(lambda given: {} if given is None else given)
]
# Arrays of numbers as a vehicle file states them
PerRotor = Annotated[Array, numbers(4), _must(lambda x: np.all(x > 0), "four positive numbers")]
InertiaMatrix = Annotated[
    Array,
    numbers(3, 3),
    BeforeValidator(_matrix),
    _must(_is_definite, "symmetric and positive definite (3 principal values or 3 x 3)"),
]
TurningSense = Annotated[
    Array,
    numbers(4),
    _must(lambda x: np.all(abs(x) == 1.0), "four times 1 or -1 (turning sense about body +z)"),
]
NotNegative = Annotated[Number, Field(ge=0.0), expected("a number that is not negative")]
Share = Annotated[Number, Field(ge=0.0, lt=1.0), expected("a share, from 0 to below 1")]


@dataclass(frozen=True)
class Mocap:
    """Motion capture: sampling rate and the standard deviation of one sample, per axis.

    Attributes:
        rate_hz: Hz, poses a second.
        sigma_pos_m: m.
        sigma_att_rad: rad, about each axis.
    """

    __pydantic_config__ = STRICT

    rate_hz: Positive = 200.0
    sigma_pos_m: Positive = 0.001
    sigma_att_rad: Positive = 0.005


@dataclass(frozen=True)
class MotorCurve:
    """Static thrust of one rotor against its command ``u``, 0 to 1:
    ``f(u, V) = sum_i thrust[i] u^i (V / voltage_ref)^voltage_exponent``.

    Attributes:
        thrust: N: coefficients of u^0, u^1, ... at the vehicle's voltage_ref.
        voltage_exponent: 0: thrust does not depend on the battery's voltage.
        command: raw command (PWM counts, us, ...) at u = 0 and at u = 1.
    """

    __pydantic_config__ = STRICT

    thrust: Annotated[
        tuple[Number, ...],
        Field(min_length=2, max_length=_MOST_POWERS),
        expected(
            f"2 to {_MOST_POWERS} numbers, the coefficients in N of u^0, u^1, ... with the command "
            "u from 0 to 1"
        ),
        AfterValidator(_full_thrust),
    ]
    voltage_exponent: Number = 0.0
    command: Annotated[
        tuple[Number, Number],
        _must(lambda ends: ends[0] < ends[1], "rising"),
        expected("the raw command at u = 0 and a larger one at u = 1"),
    ] = (0.0, 1.0)


@dataclass(frozen=True)
class Uncertainty:
    """How well a vehicle's numbers are known: standard deviations, as shares of the numbers, of
    independent errors, constant over a flight. 0: not stated.

    Attributes:
        mass: the mass's.
        thrust: all rotors' ``k`` in common.
        rotor: each rotor's ``k`` beside the others'. A centre of mass off by ``arm_l / 2`` times
            this makes the same torque.
        torque: all rotors' ``p`` in common.
        inertia: the whole tensor's.
        arm_l: all rotors' distances in common.
        command: thrust and torques at one command, from day to day and over a battery; counts
            if a reader computes rotor speeds from commands.
    """

    __pydantic_config__ = STRICT

    mass: Share = 0.0
    thrust: Share = 0.0
    rotor: Share = 0.0
    torque: Share = 0.0
    inertia: Share = 0.0
    arm_l: Share = 0.0
    command: Share = 0.0


@dataclass(frozen=True)
class LoopReaction:
    """How the flight loop of logged flights answers moments that nothing measures.

    Rotor torques of such flights answer unmeasured moments, too, and this part of them turns
    nothing. ``windwrench.identification.predict`` alone reads this section: a plant has its own
    flight loop. About x and y the body turns by

        share (gain m + flapping v' - stiffness tilt) + never_answered v' - (1 - share) damping w

    with the model's angular acceleration ``m``, the angular velocity ``w`` and the velocity
    ``v' = (v_y, -v_x)`` in body axes. The share is of measured moments in the mean square of all,
    ``M^2 / (M^2 + unmeasured^2)``, M the RMS of ``m + flapping v'`` over the horizon. Yaw has a
    gain and a damping. With gains, flapping and M, ``m`` and ``v'`` count from their means in the
    flight so far: rotors answer constant moments, which differ from flight to flight.

    Attributes:
        roll_gain: of the model's angular acceleration about x.
        pitch_gain: about y.
        yaw_gain: about z.
        unmeasured: rad/s2, standard deviation of unmeasured moments over inertia.
        damping: 1/s, of roll and pitch.
        stiffness: 1/s2, to level.
        flapping: rad/s2/(m/s), moment of velocity, answered as the rotors' torque is.
        never_answered: rad/s2/(m/s), the same, never answered.
        yaw_damping: 1/s.
    """

    __pydantic_config__ = STRICT

    roll_gain: NotNegative
    pitch_gain: NotNegative
    yaw_gain: NotNegative
    unmeasured: NotNegative
    damping: NotNegative
    stiffness: NotNegative
    flapping: Number
    never_answered: Number
    yaw_damping: NotNegative


Standing = Literal["identified", "assumed", "refuted"]


@dataclass(frozen=True)
class ModelStatus:
    """Verdict of predictions of held-out flights on a vehicle's model.

    A refuted force keeps the velocity of a prediction, a refuted torque the body rate: see
    ``windwrench.identification.predict``. Plant and filter use the numbers in any case.

    Attributes:
        force: "identified": thrust and drag predict held-out motion no worse than an unchanged
            velocity. "refuted": worse. "assumed": no held-out flight was predicted.
        torque: the same of the rotors' torques and an unchanged body rate.
        coefficients: the source of single numbers, by the names of ``identify``'s table.
    """

    __pydantic_config__ = STRICT

    force: Standing = "assumed"
    torque: Standing = "assumed"
    coefficients: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class EffectSetting:
    """One effect of a vehicle's model: its name and the given coefficients; the others are zero.

    Attributes:
        name: an effect of the library.
        coefficients: values by name, in the effect's units.
    """

    __pydantic_config__ = STRICT

    name: Annotated[str, Field(coerce_numbers_to_str=True)]
    coefficients: _Coefficients = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Vehicle:
    """A declared quadrotor; SI units, body axes x forward, y left, z up.

    Attributes:
        name: in messages and reports.
        mass: kg.
        inertia: (3, 3) kg m2, about the centre of mass.
        arm_l: m, distance of every rotor from the body x and the body y axis.
        k: (4,) N/(rad/s)^2, thrust.
        p: (4,) Nm/(rad/s)^2, reaction torque.
        rotor_radius: m.
        omega_lsb: rad/s, step of the logged rotor speeds; 0: not quantised.
        omega_max: rad/s, fastest rotor speed.
        omega_source: "measured" or "commanded": origin of the rotor speeds in logs.
        voltage_ref: V, battery voltage at which k and p hold; 0: not stated.
        gravity: m/s2.
        spin: (4,) turning sense about body +z.
        rotor_positions: (4, 3) m from the geometric centre; default from arm_l.
        com: (3,) m, centre of mass from the geometric centre.
        mocap: how its pose is measured.
        effects: declared effects of the model.
        motor_curve: thrust against command; None: not known.
        floor_z: m, world, height of the floor.
        ceiling_z: m, world, height of the ceiling.
        uncertainty: how well these numbers are known.
        status: verdict of predictions of held-out flights on force, torque and single numbers.
        closed_loop: the flight loop's reaction, for predictions alone; None: not known.
    """

    __pydantic_config__ = STRICT

    name: Annotated[str, Field(coerce_numbers_to_str=True)]
    mass: Positive
    inertia: InertiaMatrix
    arm_l: Positive
    k: PerRotor
    p: PerRotor
    rotor_radius: Positive = 0.1
    omega_lsb: NotNegative = 0.0
    omega_max: Positive = math.inf
    omega_source: Literal["measured", "commanded"] = "measured"
    voltage_ref: NotNegative = 0.0
    gravity: Positive = 9.81
    spin: TurningSense = field(default_factory=SPIN.copy)
    rotor_positions: Annotated[Array, numbers(4, 3)] | None = None
    com: Annotated[Array, numbers(3)] = field(default_factory=lambda: np.zeros(3))
    mocap: Mocap = Mocap()
    effects: Annotated[tuple[EffectSetting, ...], BeforeValidator(_list_of_effects)] = ()
    motor_curve: MotorCurve | None = None
    floor_z: Number = -math.inf
    ceiling_z: Number = math.inf
    uncertainty: Uncertainty = Uncertainty()
    status: ModelStatus = ModelStatus()
    closed_loop: LoopReaction | None = None

    def __repr__(self) -> str:
        effects = ", ".join(effect.name for effect in self.effects) or "none"
        return (
            f"<{type(self).__name__} {self.name}: {self.mass:g} kg, arm {self.arm_l:g} m, hover "
            f"at {self.hover_rate:.3g} rad/s, declared effects: {effects}>"
        )

    @property
    def positions(self) -> Array:
        """Rotor positions (4, 3) in m from the geometric centre."""
        return self.arm_l * QUADRANT if self.rotor_positions is None else self.rotor_positions

    @property
    def mixing(self) -> Array:
        """Matrix (4, 4) from the squared rotor speeds to total thrust and body torques about the
        centre, (1), (8)-(10).
        """
        x, y = self.positions[:, 0], self.positions[:, 1]
        return np.array([self.k, y * self.k, -x * self.k, -self.spin * self.p])

    @property
    def weight(self) -> float:
        """Weight in N."""
        return self.mass * self.gravity

    @property
    def hover_rate(self) -> float:
        """Rotor speed of hover in rad/s: four equal rotors carry the weight."""
        return math.sqrt(self.weight / float(np.sum(self.k)))

    def rotor_wrench(self, rotor_speeds: Array) -> Array:
        """Return total thrust (N) and body torques (Nm), shape (..., 4), of rotor speeds (..., 4)
        in rad/s, (1).
        """
        return np.square(rotor_speeds) @ self.mixing.T

    def rotor_speeds(self, thrust: float, torque: Array) -> Array:
        """Return the rotor speeds (4,) in rad/s for a thrust (N) and body torques (3,) in Nm, the
        inverse of (1).

        Rotor speeds are clipped at zero and at ``omega_max``.
        """
        square = np.linalg.solve(self.mixing, np.concatenate([[thrust], torque]))
        return np.minimum(np.sqrt(np.maximum(square, 0.0)), self.omega_max)

    def commanded_thrust(self, command: Array, voltage: Array | None = None) -> Array:
        """Return the static thrust (N, 4) in N of motor commands (N, 4), 0 to 1, by the vehicle's
        motor curve; ``voltage`` (N,) in V, default: the curve's. A motor at command 0 stands still.

        Raises:
            InputError: the vehicle states no motor curve.
        """
        if self.motor_curve is None:
            raise InputError(
                f"vehicle {self.name}: states no motor_curve; expected one, to turn motor "
                "commands into thrust"
            )
        thrust = np.polynomial.polynomial.polyval(command, self.motor_curve.thrust)
        if voltage is not None and self.voltage_ref > 0.0:
            exponent = self.motor_curve.voltage_exponent
            thrust = thrust * np.power(voltage / self.voltage_ref, exponent)[:, None]
        return np.maximum(thrust, 0.0) * (command > 0.0)

    def commanded_speeds(self, command: Array, voltage: Array | None = None) -> Array:
        """Return the rotor speeds (N, 4) in rad/s whose thrust is ``commanded_thrust``."""
        return np.sqrt(self.commanded_thrust(command, voltage) / self.k)

    def with_effects(self, *effects: EffectSetting) -> Vehicle:
        """Return this vehicle with exactly these effects in its model."""
        return replace(self, effects=tuple(effects))
