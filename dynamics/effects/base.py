"""The form of a physical effect, written once and used by the plant, the estimator and the residual
of a log.

An effect is one file in this folder with an ``EFFECT``. Its equation, the effect model, is a
function of the core, ``core/effects/NAME.hpp``. A tick of the plant, a sigma point of the filter
and a sample of a log call the function through its address. The model of a user's own effect may be
a Python function in the effect's file. There are four kinds:

``rotor input``
    changes the delivered rotor speeds. Model ``(c, vehicle, rotors, memory)``: rewrites
    ``rotors.speed``, once a step, in the order in which the vehicle lists the effects.
``wrench``
    adds force (world frame) and torque (body frame, about the centre of mass). Model
    ``(c, vehicle, state, wrench)``: adds to ``wrench.force`` and ``wrench.torque``, many times a
    step. ``c[HIDDEN:]`` holds the effect's state, all zero at the start.
    ``advance(c, vehicle, state, rotors)`` integrates the state, once a step before the first call
    of the model; ``rotors.step`` is the step's length.
``body``
    changes the rigid body itself. ``amend(vehicle, coefficients)`` returns the changed vehicle.
``sensing``
    changes the logged values. Model ``(c, vehicle, sample, memory)``: rewrites the given parts of
    ``sample``. ``sample.direction`` +1 (the plant) turns truth into report, -1 (an estimator with
    the effect in its model) report into truth.

``c`` holds the coefficients in their declared order, ``memory`` (MEMORY,) a model's numbers from
step to step, all zero at first. The records below lay out ``vehicle``, ``state``, ``rotors``,
``sample`` and ``wrench``. A Python function gets their fields as attributes: arrays, and arrays of
shape () of single numbers, all of them views of the core's memory.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..vehicle import Vehicle
from .declaration import Family, Implausible, Need, Role, StartingPoints, check_role, check_words

Array = NDArray[np.float64]

VEHICLE = np.dtype(
    [
        ("mass", "f8"),  # kg
        ("gravity", "f8"),  # m/s2
        ("rotor_radius", "f8"),  # m
        ("floor", "f8"),  # m
        ("ceiling", "f8"),  # m
        ("voltage_ref", "f8"),  # V
        ("hover_rate", "f8"),  # rad/s
        ("com", "f8", (3,)),  # m, from the geometric centre
        ("rotor", "f8", (4, 3)),  # m, from the geometric centre
        ("spin", "f8", (4,)),  # turning sense about body +z
        ("reaction", "f8", (4,)),  # Nm/(rad/s)^2
    ]
)
STATE = np.dtype(
    [
        ("position", "f8", (3,)),  # m, world, of the geometric centre
        ("rotation", "f8", (3, 3)),  # body to world
        ("velocity", "f8", (3,)),  # m/s, world
        ("rate", "f8", (3,)),  # rad/s, body
        ("rotor_speed", "f8", (4,)),  # rad/s, delivered
        ("thrust", "f8", (4,)),  # N, delivered
        ("wind", "f8", (3,)),  # m/s, world
        ("voltage", "f8"),  # V; 0: not known
        ("time", "f8"),  # s
        ("rotor_acceleration", "f8", (4,)),  # rad/s2, delivered, mean over the step
    ]
)
ROTORS = np.dtype(
    [
        ("speed", "f8", (4,)),  # rad/s
        ("step", "f8"),  # s, since the function was last called
        ("voltage", "f8"),  # V; 0: not known
        ("time", "f8"),  # s, since the start
    ]
)
SAMPLE = np.dtype(
    [
        ("speed", "f8", (4,)),  # rad/s
        ("position", "f8", (3,)),  # m, world
        ("quaternion", "f8", (4,)),  # body to world; always readable
        ("step", "f8"),  # s, since the function was last called
        ("has_speed", "f8"),  # 1 where the part is given
        ("has_position", "f8"),
        ("has_quaternion", "f8"),
        ("direction", "f8"),  # +1: from truth to report, -1: back
    ]
)
# N, world; Nm, body, about the centre of mass
WRENCH = np.dtype([("force", "f8", (3,)), ("torque", "f8", (3,))])

VEHICLE_SIZE, STATE_SIZE, ROTORS_SIZE, SAMPLE_SIZE = (
    layout.itemsize // 8 for layout in (VEHICLE, STATE, ROTORS, SAMPLE)
)
PARAMETERS = 8  # most coefficients of an effect
HIDDEN = 8  # first place of a wrench effect's own state in ``c``
ROW_SIZE = 16  # size of ``c`` of a wrench effect
MEMORY = 112  # numbers of a rotor-input or sensing effect


@dataclass(frozen=True)
class Coefficient:
    """One coefficient of an effect, with its typical size for a 0.45 kg and for a
    0.03 kg vehicle.

    Before any flight a coefficient is as likely positive as negative within its range, and zero on
    average. Its order is the typical size: the scale of a diagnosis.

    Attributes:
        name: as vehicle files write it.
        unit: SI, "1" for a pure number.
        typical: in ``unit``, for a vehicle of 0.45 kg and one of 0.03 kg.
        meaning: in words.
        minimum: in ``unit``, least value in a vehicle's file.
        maximum: in ``unit``, largest value in a vehicle's file.
        plausible: in ``unit``, largest size of this effect's physics; more is the trace of another.
    """

    name: str
    unit: str
    typical: tuple[float, float]
    meaning: str
    minimum: float = -np.inf
    maximum: float = np.inf
    plausible: float = np.inf


# draws the rotors towards the centre, for effects rotor by rotor
CENTRAL = Coefficient(
    "central",
    "1",
    (0.0, 0.0),
    "0: it acts at the rotors, and so with a moment; 1: as a whole at the geometric centre",
    minimum=0.0,
    maximum=1.0,
)


def along(
    name: str,
    unit: str,
    typical: tuple[float, float],
    meaning: str,
    axes: str = "xyz",
    **bounds: float,
) -> tuple[Coefficient, ...]:
    """Return one coefficient for each axis, put for ``{}`` in name and meaning."""
    return tuple(
        Coefficient(name.format(axis), unit, typical, meaning.format(axis), **bounds)
        for axis in axes
    )


@dataclass(frozen=True)
class Effect:
    """A physical effect: its model, coefficients, source, and declared kind of physics. The
    docstring of its file states the equation.

    Attributes:
        name: as vehicle files and reports write it.
        kind: changed part: rotor input, wrench, rigid body or sensing.
        coefficients: each with its unit.
        source: publication of equation and sizes.
        excitation: flight to tell the effect from others with much the same traces in a log.
        model: name of an equation of the core, or a Python function; for rotor input, wrench and
            sensing.
        advance: Python function, for a wrench with a state of its own.
        sets_wind: a wrench effect changes the wind in ``state``: called before all others.
        amend: function from a vehicle and coefficients to the changed vehicle, for an effect on
            the rigid body.
        family: kind of physics; ``declaration`` explains the words.
        role: part in a fit, for code without knowledge of names.
        needs: properties of logs without which the effect cannot be told.
        any_size: the change may be of any size: a load, a fault of assembly. Others are of the
            order of their typical sizes.
        scales_noise: a sensing effect multiplies the measurement, and its noise.
        starting_points: for a law without effect of any coefficient alone: sets of coefficients,
            one of them near enough to any flight's.
        possible: joint bounds: whether a vehicle can have these coefficients together.
        implausible: why fitted coefficients are no physics of this effect, as the rest of a
            sentence after its name; empty where they are.

    Raises:
        InputError: an unknown word, or coefficients of another role.
    """

    name: str
    kind: str
    coefficients: tuple[Coefficient, ...]
    source: str
    excitation: str
    model: str | Callable[..., None] | None = None
    advance: Callable[..., None] | None = None
    sets_wind: bool = False
    amend: Callable[[Vehicle, Mapping[str, float]], Vehicle] | None = None
    family: Family = Family.OTHER
    role: Role | None = None
    needs: tuple[Need, ...] = ()
    any_size: bool = False
    scales_noise: bool = False
    starting_points: StartingPoints | None = None
    possible: Callable[[Mapping[str, float], Vehicle], bool] | None = None
    implausible: Implausible | None = None

    def __post_init__(self) -> None:
        """Check the words."""
        check_words(self.name, self.family, self.role, self.needs)
        if self.role is not None:
            check_role(self.name, self.role, [c.unit for c in self.coefficients])

    def vector(self, coefficients: Mapping[str, float]) -> Array:
        """Return the coefficients in the model's order; those not given are zero."""
        return np.array([float(coefficients.get(c.name, 0.0)) for c in self.coefficients])
