"""The words in which an effect declares what it is: its family, the role that it plays, what a
flight must hold to show it, and what its coefficients must satisfy together.

They are physics, and say nothing of how a diagnosis uses them. A diagnosis knows no effect by its
name: it looks the library up by these words, so an effect of a user's own that declares the same
takes the same part.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...runtime.errors import InputError, unknown_name

if TYPE_CHECKING:
    from ..vehicle import Vehicle

Array = NDArray[np.float64]
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
    coefficients that are stated here. *Relative* ones are of unit 1.
    """

    MASS = "mass"  # added mass, kg or relative
    INERTIA = "inertia"  # relative change of the moments of inertia about x, y and z
    CENTRE_OF_MASS = "centre of mass"  # its place along x, y and z, m
    MARKER = "marker"  # the place of the point whose position is logged, along x, y and z, m
    SUSPENDED_LOAD = "suspended load"  # its mass, kg
    THRUST = "thrust"  # relative change of what all rotors deliver
    ROTOR_THRUSTS = "thrust of each rotor"  # relative change of each rotor's, 1 to 4
    THRUST_CURVE = "thrust curve"  # how much it differs from the square of the rotor speed
    THRUST_OVER_TIME = "thrust over time"  # its relative loss, 1/s
    THRUST_OVER_VOLTAGE = "thrust over voltage"  # how it goes with the battery's voltage
    THRUST_AXIS = "thrust axis"  # its turn against the body's, rad about x and y
    STEADY_FORCE = "steady force"  # along world x, y and z, N
    LAG = "lag"  # the time constant (s) behind which rotors follow
    # the time (s) by which rotors act later than the log has their rotor speeds, or seem to. It
    # contains the offset of the two clocks that any log may have, in whose place it is fitted. Of
    # kind rotor input it delays the rotors, of kind sensing one of the log's two parts
    DELAY = "delay"
    ROTOR_DRAG = "rotor drag"  # of each rotor along x and y, N/(rad/s m/s)
    BODY_DRAG = "body drag"  # linear along x, y and z, N/(m/s), then quadratic, N/(m/s)^2
    INFLOW_THRUST = "inflow thrust"  # lost by each rotor that climbs, N/(rad/s m/s)
    TRANSLATIONAL_LIFT = "translational lift"  # of each rotor, N/(m/s)^2
    RATE_DAMPING = "rate damping"  # about x, y and z, Nm/(rad/s)
    FLAPPING_MOMENT = "flapping moment"  # of each rotor, Nm/(rad/s m/s)


_RELATIVE = ("1",)
# units of the coefficients that a role has, one after the other
_UNITS: dict[Role, tuple[tuple[str, ...], ...]] = {
    Role.MASS: (("kg", "1"),),
    Role.INERTIA: (_RELATIVE,) * 3,
    Role.CENTRE_OF_MASS: (("m",),) * 3,
    Role.MARKER: (("m",),) * 3,
    Role.SUSPENDED_LOAD: (("kg",),),
    Role.THRUST: (_RELATIVE,),
    Role.ROTOR_THRUSTS: (_RELATIVE,) * 4,
    Role.THRUST_CURVE: (_RELATIVE,),
    Role.THRUST_OVER_TIME: (("1/s",),),
    Role.THRUST_OVER_VOLTAGE: (),
    Role.THRUST_AXIS: (("rad",),) * 2,
    Role.STEADY_FORCE: (("N",),) * 3,
    Role.LAG: (("s",),),
    Role.DELAY: (("s",),),
    Role.ROTOR_DRAG: (("N/(rad/s m/s)",),) * 2,
    Role.BODY_DRAG: (("N/(m/s)",),) * 3 + (("N/(m/s)^2",),) * 3,
    Role.INFLOW_THRUST: (("N/(rad/s m/s)",),),
    Role.TRANSLATIONAL_LIFT: (("N/(m/s)^2",),),
    Role.RATE_DAMPING: (("Nm/(rad/s)",),) * 3,
    Role.FLAPPING_MOMENT: (("Nm/(rad/s m/s)",),),
}


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

    vehicle: "Vehicle"  # as it is declared
    typical: Coefficients  # typical sizes of the effect's coefficients for this vehicle
    fixed: Coefficients  # coefficients of the effect that the vehicle's file states already
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
    for i, allowed in enumerate(_UNITS[role]):
        if i >= len(units) or units[i] not in allowed:
            raise InputError(
                f"effect {effect}: role {role!s}: expected coefficient {i + 1} in "
                f"{' or '.join(allowed)}, got {units[i] if i < len(units) else 'none'}"
            )
