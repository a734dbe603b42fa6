"""Coefficients as practical quantities: newtons at 1 m/s, millimetres forward, per cent of thrust.

The quantity follows from a coefficient's unit and the words of its meaning, also for an effect of a
user's own.
"""

import math
import re
from dataclasses import dataclass

import numpy as np

from ...dynamics.vehicle import Vehicle
from ..findings import CHANNELS, Diagnosis, NamedEffect
from .words import SPACE, coefficient_meaning, effect_summary, in_words, scale_of, with_std

_ROTORS = 4
_SMALL = 0.5
# units below this size, in place of metres, seconds, kilograms and radians
_SMALL_UNITS = {
    "m": (1e3, "mm"),
    "s": (1e3, "ms"),
    "kg": (1e3, "g"),
    "rad": (180.0 / math.pi, "degrees"),
}
# a coefficient's unit: the unit of its effect, and the speed
_AT = {
    "N/(m/s)": ("N", "at 1 m/s"),
    "N/(m/s)^2": ("N", "at 1 m/s"),
    "Nm/(rad/s)": ("Nm", "at 1 rad/s"),
}
_RELATIVE = {"1": (100.0, "%"), "1/s": (6000.0, "% a minute")}
_PLACE = re.compile(r"(along|about) (body|world) ([xyz])|(rotor \d)$")
_SIDES = {"x": ("forward", "backward"), "y": ("left", "right"), "z": ("up", "down")}
_KNOWN = 2.0  # least standard deviations of a coefficient in the sentence
_BLOCK = 3.0  # s: longer than the correlation of a residual
_LEAST_BLOCKS = 4
_STEADY = 4.0  # least standard errors of a mean over blocks, beyond chance


@dataclass(frozen=True)
class Amount:
    """The practical quantity of a coefficient.

    Attributes:
        value: in ``unit``.
        std: standard deviation.
        unit: empty for a pure number.
        where: axis or rotor; empty for neither.
        when: speed; empty for always.
    """

    value: float
    std: float
    unit: str
    where: str
    when: str

    def __str__(self) -> str:
        """Return ``0.31 ± 0.01 N along x``."""
        number = with_std(self.value, self.std) + (f"{SPACE}{self.unit}" if self.unit else "")
        return f"{number} {self.where}".rstrip()


def title(name: str) -> str:
    """Return an effect's plain name: the words before the colon of its summary."""
    plain, colon, _ = effect_summary(name).partition(":")
    return plain[:1].lower() + plain[1:] if colon else name


def amount(effect: NamedEffect, coefficient: str, vehicle: Vehicle) -> Amount:
    """Return the quantity of a named effect's coefficient on the declared vehicle."""
    value, std = effect.coefficients[coefficient], effect.std.get(coefficient, 0.0)
    unit = effect.units.get(coefficient, "1")
    meaning = coefficient_meaning(effect.name, coefficient)
    factor, when = float(_ROTORS) if "per rotor" in meaning else 1.0, ""
    if unit.endswith("/(rad/s m/s)"):
        factor, unit, when = factor * vehicle.hover_rate, unit.split("/")[0], "at 1 m/s"
    elif unit in _AT:
        unit, when = _AT[unit]
    elif unit in _RELATIVE and "relative" in meaning:
        factor, unit = _RELATIVE[unit]
    value, std = factor * value, factor * std
    where = ""
    if place := _PLACE.search(meaning):
        how, frame, axis, rotor = place.groups()
        where = rotor or f"{how} {axis}"
        if unit == "m" and frame == "body":
            where, value = _SIDES[axis][value < 0.0], abs(value)
    if unit in ("N", "Nm"):
        factor, unit = scale_of([value], unit)
    else:
        factor, unit = _SMALL_UNITS.get(unit if abs(value) < _SMALL else "", (1.0, unit))
    value, std = factor * value, factor * std
    return Amount(value, std, "" if unit == "1" else unit, where, when)


def with_amounts(effect: NamedEffect, vehicle: Vehicle) -> str:
    """Return an effect's plain name, the known quantities of a sure effect, and its name in files
    and options.
    """
    plain = title(effect.name)
    told = [] if plain.replace(" ", "_") == effect.name else [effect.name]
    known = [
        amount(effect, name, vehicle)
        for name, value in effect.coefficients.items()
        if abs(value) > _KNOWN * effect.std.get(name, math.inf) > 0.0
    ]
    if known and not effect.tentative:
        when = known[0].when if len({one.when for one in known}) == 1 else ""
        parts = [f"{one} {one.when}" if one.when and not when else f"{one}" for one in known]
        told.insert(0, in_words(parts) + (f" {when}" if when else ""))
    return f"{plain} ({'; '.join(told)})" if told else plain


def steady_wrench(diagnosis: Diagnosis) -> str:
    """Return the mean force and torque of the residual, if beyond chance; else nothing.

    The mean of a block of 3 s is one number; all blocks together say how sure their mean is.
    """
    counts = (max(1, round(len(x.after) * x.period / _BLOCK)) for x in diagnosis.traces)
    pieces = map(np.array_split, (x.after for x in diagnosis.traces), counts)
    blocks = [part.mean(axis=0) for parts in pieces for part in parts]
    if len(blocks) < _LEAST_BLOCKS:
        return ""
    mean = np.mean(blocks, axis=0)
    error = np.std(blocks, axis=0, ddof=1) / math.sqrt(len(blocks))
    told = []
    for what, unit, way, first, floor in (
        ("force", "N", "along", 0, diagnosis.floor_force_rms),
        ("torque", "Nm", "about", 3, diagnosis.floor_torque_rms),
    ):
        i = first + int(np.argmax(np.abs(mean[first : first + 3])))
        if abs(mean[i]) > _STEADY * error[i] and not abs(mean[i]) < floor:
            factor, small = scale_of([mean[i]], unit)
            size = with_std(factor * float(mean[i]), factor * float(error[i]))
            told.append(f"a {what} of {size}{SPACE}{small} {way} {CHANNELS[i][-1]}")
    return in_words(told)
