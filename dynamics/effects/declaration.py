"""The words in which an effect declares what it is: its family, the role that it plays, what a
flight must hold to show it, and what its coefficients must satisfy together.

They are physics, and say nothing of how a diagnosis uses them. A diagnosis knows no effect by its
name: it looks the library up by these words, so an effect of a user's own that declares the same
takes the same part.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

from ...runtime.errors import InputError, unknown_name
from ..vehicle import Array, Vehicle

Coefficients = Mapping[str, float]


class Family(StrEnum):
    """Effects of one kind of cause."""

    DRAG = "drag"  # the air's force against the motion: a power of the speed, and it feels a wind
    # what else the air of ordinary flight does to rotors and body. A vehicle that is declared
    # without aerodynamics lacks these and its drag together, and they count as one cause
    AERODYNAMICS = "aerodynamics"
    FAST_FLIGHT = "fast flight"  # the air's forces that show at 5 m/s and more alone
    SURROUNDINGS = "surroundings"  # wind, jets, floor and ceiling
    THRUST = "thrust"  # how much of the declared thrust rotors deliver
    ROTOR_DYNAMICS = "rotor dynamics"  # how rotors change their speed, and when
    # what is bolted to the body, and so moves with it however fast. A part on a soft mount does so
    # in slow motion alone
    RIGID_BODY = "rigid body"
    LOAD = "load"  # what hangs from the body
    STEADY = "steady"  # a force or a torque that does not change
    ALIGNMENT = "alignment"  # of axes, frames and clocks
    OTHER = "other"


class Role(StrEnum):
    """What of a vehicle, its motion or its log an effect changes, where other effects are
    understood by it.

    A role is a contract: an effect that declares it has, first of all and in this order, the
    coefficients whose units stand behind its word. *Relative* ones are of unit 1.
    """

    units: tuple[str, ...]

    def __new__(cls, word: str, *units: str) -> "Role":
        """Make a role of its word and of its coefficients' units."""
        role = str.__new__(cls, word)
        role._value_, role.units = word, units
        return role

    MASS = "mass", "kg or 1"  # added mass, or relative
    INERTIA = "inertia", "1", "1", "1"  # relative change of the moments about x, y and z
    CENTRE_OF_MASS = "centre of mass", "m", "m", "m"  # its place along x, y and z
    MARKER = "marker", "m", "m", "m"  # the place of the point whose position is logged
    SUSPENDED_LOAD = "suspended load", "kg"  # its mass
    THRUST = "thrust", "1"  # relative change of what all rotors deliver
    ROTOR_THRUSTS = "thrust of each rotor", "1", "1", "1", "1"  # relative change of 1 to 4
    THRUST_CURVE = "thrust curve", "1"  # how much it differs from the square of the rotor speed
    THRUST_OVER_TIME = "thrust over time", "1/s"  # its relative loss
    THRUST_OVER_VOLTAGE = ("thrust over voltage",)  # how it goes with the battery's voltage
    THRUST_AXIS = "thrust axis", "rad", "rad"  # its turn against the body's, about x and y
    STEADY_FORCE = "steady force", "N", "N", "N"  # along world x, y and z
    LAG = "lag", "s"  # the time constant behind which rotors follow
    # the time by which rotors act later than the log has their rotor speeds, or seem to. It
    # contains the offset of the two clocks that any log may have, in whose place it is fitted. Of
    # kind rotor input it delays the rotors, of kind sensing one of the log's two parts
    DELAY = "delay", "s"
    ROTOR_DRAG = "rotor drag", *("N/(rad/s m/s)",) * 2  # of each rotor along x and y
    # linear along x, y and z, then quadratic
    BODY_DRAG = "body drag", *("N/(m/s)",) * 3, *("N/(m/s)^2",) * 3
    INFLOW_THRUST = "inflow thrust", "N/(rad/s m/s)"  # lost by each rotor that climbs
    TRANSLATIONAL_LIFT = "translational lift", "N/(m/s)^2"  # of each rotor
    RATE_DAMPING = "rate damping", *("Nm/(rad/s)",) * 3  # about x, y and z
    FLAPPING_MOMENT = "flapping moment", "Nm/(rad/s m/s)"  # of each rotor


class Need(StrEnum):
    """What logs must hold for an effect to be told from something else."""

    # motion up to the highest frequencies, as it was: the effect's trace grows with frequency, and
    # a filter of the pose makes such a trace, or hides it
    FAST_MOTION = "fast motion"
    # rotor speeds that vary by more than their rounding steps: it would explain the rounding
    FINE_ROTOR_SPEEDS = "finely resolved rotor speeds"
    # the rotors' moments, which only measured rotor speeds tell: its trace is a torque
    MOMENTS = "moments"
    # differences between single rotors, which commands do not tell
    SINGLE_ROTORS = "single rotors"


@dataclass(frozen=True, eq=False)
class Unexplained:
    """What a model leaves unexplained of flights, as starting points are chosen from it."""

    vehicle: Vehicle  # as it is declared
    typical: Coefficients  # typical sizes of the effect's coefficients for this vehicle
    fixed: Coefficients  # coefficients of the effect that the vehicle's file states already
    beside: frozenset[Family]  # families of the vehicle's other effects, declared and found
    centre: Array  # (3,) m, world, about which the vehicle flew
    position: Array  # (n, 3) m, world
    velocity: Array  # (n, 3) m/s, world
    force: Array  # (n, 3) N, world, that no model explains
    torque: Array  # (n, 3) Nm, body


StartingPoints = Callable[[Unexplained], Sequence[Coefficients]]


@dataclass(frozen=True, eq=False)
class Found:
    """An effect as a fit found it, and what else is known when it is asked whether it can be."""

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
    for what, known, given in words:
        for word in given:
            if word not in list(known):
                raise unknown_name(what, word, known, f"effect {effect}")


def check_role(effect: str, role: Role, units: Sequence[str]) -> None:
    """Check that an effect has the coefficients of the role that it declares.

    Raises:
        InputError: it lacks one, or one has another unit.
    """
    for i, allowed in enumerate(Role(role).units):
        unit = units[i] if i < len(units) else "none"
        if unit not in allowed.split(" or "):
            raise InputError(
                f"effect {effect}: role {role!s}: expected coefficient {i + 1} in {allowed}, "
                f"got {unit}"
            )
