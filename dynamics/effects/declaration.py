"""The words of an effect's declaration: its family, its role, its needs of a flight, and joint
bounds of its coefficients.

The words are physics, independent of a diagnosis. A diagnosis searches the library by these words,
not by names of effects. So a user's effect with the same words takes the same part.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

from ...runtime.errors import InputError, unknown_name
from ..vehicle import Array, Vehicle

Coefficients = Mapping[str, float]


class Family(StrEnum):
    """Effects of one kind of cause."""

    DRAG = "drag"  # the air's force against the motion, a power of the airspeed
    # further effects of the air of ordinary flight on rotors and body. A vehicle declared without
    # aerodynamics lacks these and its drag together: one cause
    AERODYNAMICS = "aerodynamics"
    FAST_FLIGHT = "fast flight"  # the air's forces at 5 m/s and more alone
    SURROUNDINGS = "surroundings"  # wind, jets, floor and ceiling
    THRUST = "thrust"  # share of the declared thrust that rotors deliver
    ROTOR_DYNAMICS = "rotor dynamics"  # changes of the rotors' speed, and their times
    # parts bolted to the body, moving along at any frequency. A soft mount allows slow motion alone
    RIGID_BODY = "rigid body"
    LOAD = "load"  # hanging from the body
    STEADY = "steady"  # a constant force or torque
    ALIGNMENT = "alignment"  # between axes, frames or clocks
    OTHER = "other"


class Role(StrEnum):
    """The part of a vehicle, its motion or its log changed by an effect, where other effects depend
    on the part.

    A role is a contract: the effect has, first of all and in this order, coefficients with the
    units behind the role's word. *Relative* ones are of unit 1.
    """

    units: tuple[str, ...]

    def __new__(cls, word: str, *units: str) -> "Role":
        """Make a role of its word and of its coefficients' units."""
        role = str.__new__(cls, word)
        role._value_, role.units = word, units
        return role

    MASS = "mass", "kg or 1"  # added mass, or relative
    INERTIA = "inertia", "1", "1", "1"  # relative change of the moments about x, y and z
    CENTRE_OF_MASS = "centre of mass", "m", "m", "m"  # place along x, y and z
    MARKER = "marker", "m", "m", "m"  # place of the point with the logged position
    SUSPENDED_LOAD = "suspended load", "kg"  # mass of the load
    THRUST = "thrust", "1"  # relative change of all rotors' thrust
    ROTOR_THRUSTS = "thrust of each rotor", "1", "1", "1", "1"  # relative changes, rotors 1 to 4
    THRUST_CURVE = "thrust curve", "1"  # difference from the square of the rotor speed
    THRUST_OVER_TIME = "thrust over time", "1/s"  # relative loss
    THRUST_OVER_VOLTAGE = ("thrust over voltage",)  # as a function of the battery's voltage
    THRUST_AXIS = "thrust axis", "rad", "rad"  # turn against the body's axis, about x and y
    STEADY_FORCE = "steady force", "N", "N", "N"  # along world x, y and z
    LAG = "lag", "s"  # time constant of the rotors
    # true or apparent delay of the rotors against the log's rotor speeds. The offset of a log's two
    # clocks is contained, and not fitted beside. Kind rotor input delays the rotors, kind sensing
    # one of the log's two parts
    DELAY = "delay", "s"
    ROTOR_DRAG = "rotor drag", *("N/(rad/s m/s)",) * 2  # each rotor's, along x and y
    # linear along x, y and z, then quadratic
    BODY_DRAG = "body drag", *("N/(m/s)",) * 3, *("N/(m/s)^2",) * 3
    INFLOW_THRUST = "inflow thrust", "N/(rad/s m/s)"  # loss of each climbing rotor
    TRANSLATIONAL_LIFT = "translational lift", "N/(m/s)^2"  # of each rotor
    RATE_DAMPING = "rate damping", *("Nm/(rad/s)",) * 3  # about x, y and z
    FLAPPING_MOMENT = "flapping moment", "Nm/(rad/s m/s)"  # of each rotor


class Need(StrEnum):
    """Properties of logs without which an effect cannot be told from others."""

    # unfiltered motion up to the highest frequencies: the effect's trace grows with frequency, and
    # a filter of the pose makes such a trace, or hides one
    FAST_MOTION = "fast motion"
    # rotor speeds with changes above their rounding steps: else the effect explains the rounding
    FINE_ROTOR_SPEEDS = "finely resolved rotor speeds"
    # the rotors' moments, from measured rotor speeds alone: the effect's trace is a torque
    MOMENTS = "moments"
    # differences between single rotors, unknown from commands
    SINGLE_ROTORS = "single rotors"


@dataclass(frozen=True, eq=False)
class Unexplained:
    """The unexplained rest of flights, for the choice of starting points."""

    vehicle: Vehicle  # as it is declared
    typical: Coefficients  # typical sizes of the effect's coefficients for this vehicle
    fixed: Coefficients  # coefficients of the effect stated in the vehicle's file
    beside: frozenset[Family]  # families of the vehicle's other effects, declared and found
    centre: Array  # (3,) m, world, centre of the flight
    position: Array  # (n, 3) m, world
    velocity: Array  # (n, 3) m/s, world
    force: Array  # (n, 3) N, world, unexplained
    torque: Array  # (n, 3) Nm, body


StartingPoints = Callable[[Unexplained], Sequence[Coefficients]]


@dataclass(frozen=True, eq=False)
class Found:
    """A fitted effect, and further numbers for the question whether it can be."""

    coefficients: Coefficients
    std: Coefficients  # standard deviations; 0 where none is known
    typical: Coefficients  # typical sizes for this vehicle
    speed: float  # m/s, RMS of the flights
    beside: frozenset[Family]  # families of the vehicle's other effects, declared and found


Implausible = Callable[[Found], str]


def check_words(effect: str, family: str, role: str | None, needs: Sequence[str]) -> None:
    """Check the words of an effect.

    Raises:
        InputError: there is no such word.
    """
    words = (
        ("family", Family, [family]),
        ("role", Role, [] if role is None else [role]),
        ("need", Need, needs),
    )
    for what, choices, stated in words:
        for word in stated:
            if word not in list(choices):
                raise unknown_name(what, word, choices, f"effect {effect}")


def check_role(effect: str, role: Role, units: Sequence[str]) -> None:
    """Check for the coefficients of an effect's declared role.

    Raises:
        InputError: a missing coefficient, or one with another unit.
    """
    for i, allowed in enumerate(Role(role).units):
        unit = units[i] if i < len(units) else "none"
        if unit not in allowed.split(" or "):
            raise InputError(
                f"effect {effect}: role {role!s}: expected coefficient {i + 1} in {allowed}, "
                f"got {unit}"
            )
