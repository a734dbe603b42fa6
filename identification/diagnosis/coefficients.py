"""Coefficients of effects: their declarations, sizes and units, and settings of them."""

import math
from collections.abc import Mapping
from typing import TypeVar

import numpy as np

from ...dynamics.effects import Role, get
from ...dynamics.effects.base import Coefficient
from ...dynamics.vehicle import Vehicle
from ..logs.table import Array, NamedNumbers, Values
from .column import Column, Part
from .log_offsets import TIMINGS, Offset

V = TypeVar("V")

# coefficients by effect, beside the declared vehicle
Setting = Mapping[str, Values]
Effects = frozenset[str]
STEP = 0.1  # typical sizes, of a derivative by a coefficient
CENTRAL = "central"  # the coefficient of effects on single rotors
TORQUE_ARM = 0.25  # share of the arm: times the weight, the unit of a torque


def without(setting: Mapping[str, V], effect: str) -> dict[str, V]:
    """Return a setting with one effect less."""
    return {e: x for e, x in setting.items() if e != effect}


def is_delay(effect: str) -> bool:
    """Return whether an effect moves rotor speeds against the pose in time. Such an effect contains
    the rotors' time offset.
    """
    return get(effect).role == Role.DELAY


def moves_time(effect: str) -> bool:
    """Return whether rotors act late by an effect: a delay or a lag."""
    return get(effect).role in (Role.DELAY, Role.LAG)


def is_nonlinear(effect: str) -> bool:
    """Return whether an effect's force is not linear in its coefficients."""
    return get(effect).starting_points is not None


def coefficient(column: Column) -> Coefficient:
    """Return the declaration of a column's coefficient."""
    return next(c for c in get(column.effect).coefficients if c.name == column.coefficient)


def unit_of_change(column: Column, vehicle: Vehicle) -> float:
    """Return the change of a coefficient by 100 % of the declared quantity: the vehicle's mass in
    kg, 1 for a relative coefficient.
    """
    return vehicle.mass if coefficient(column).unit == "kg" else 1.0


def typical_size(column: Column, vehicle: Vehicle) -> float:
    """Return the typical size of a coefficient for a vehicle of this mass, interpolated between the
    library's two.
    """
    if not column.effect:
        return TIMINGS.get(column, Offset(1.0)).size
    if column.part == Part.START or column.coefficient == CENTRAL:
        return 1.0
    c = coefficient(column)
    if not all(c.typical):
        every = get(column.effect).coefficients
        return max(abs(o.typical[0]) for o in every if o.unit == c.unit) or 1.0
    large, small = np.abs(c.typical)
    share = min(max(math.log(vehicle.mass / 0.03) / math.log(0.45 / 0.03), 0.0), 1.3)
    return float(small * (large / small) ** share)


def typical_sizes(effect: str, vehicle: Vehicle) -> NamedNumbers:
    """Return the typical sizes of an effect's coefficients, by name."""
    columns = [Column(effect, c.name) for c in get(effect).coefficients]
    return {c.coefficient: typical_size(c, vehicle) for c in columns}


def weight_and_torque(vehicle: Vehicle, arm: float = TORQUE_ARM) -> Array:
    """Return the units (6,) of unknown forces, N, and torques, Nm: the weight, and the weight at a
    share of the arm.
    """
    return vehicle.weight * np.repeat([1.0, arm * vehicle.arm_l], 3)
