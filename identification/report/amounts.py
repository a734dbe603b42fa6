"""Coefficients as practical quantities: newtons at 1 m/s, millimetres forward, per cent of thrust.

The quantity follows from a coefficient's unit and the words of its meaning, also for an effect of a
user's own.
"""

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...dynamics import effects as library
from ...dynamics.vehicle import Vehicle
from ..findings import CHANNELS, NamedEffect
from ..logs.table import Array
from .words import coefficient_meaning, effect_summary, in_unit, in_words, scale_of, with_std

_ROTORS = 4.0
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
_BESIDE = 0.38  # share of a wind's speed, sin(22.5 degrees): least part along a named axis
_BLOCK = 3.0  # s: longer than the correlation of a residual
_LEAST_BLOCKS = 4
_STEADY = 4.0  # least standard errors of a mean over blocks, beyond chance


class _Amount(NamedTuple):
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
        number = f"{with_std(self.value, self.std)}\N{NO-BREAK SPACE}{self.unit}".removesuffix(
            "\N{NO-BREAK SPACE}"
        )
        return f"{number} {self.where}".rstrip()


def title(name: str) -> str:
    """Return an effect's plain name: the words before the colon of its summary."""
    plain, colon, _ = effect_summary(name).partition(":")
    return plain[:1].lower() + plain[1:] if colon else name


def amount(effect: NamedEffect, coefficient: str, vehicle: Vehicle) -> _Amount:
    """Return the quantity of a named effect's coefficient on the declared vehicle."""
    value, std = effect.coefficients[coefficient], effect.std.get(coefficient, 0.0)
    unit = effect.units.get(coefficient, "1")
    meaning = coefficient_meaning(effect.name, coefficient)
    factor, when = _ROTORS if "per rotor" in meaning else 1.0, ""
    if unit.endswith("/(rad/s m/s)"):
        factor, unit, when = factor * vehicle.hover_rate, unit.split("/")[0], "at 1 m/s"
    elif unit in _AT:
        unit, when = _AT[unit]
    elif unit in _RELATIVE and "relative" in meaning:
        factor, unit = _RELATIVE[unit]
    value, std, where = factor * value, factor * std, ""
    if place := _PLACE.search(meaning):
        how, frame, axis, rotor = place.groups()
        where = rotor or f"{how} {axis}"
        if unit == "m" and frame == "body":
            where, value = _SIDES[axis][value < 0.0], abs(value)
    if unit in ("N", "Nm"):
        factor, unit = scale_of([value], unit)
    else:
        factor, unit = _SMALL_UNITS.get(unit if abs(value) < _SMALL else "", (1.0, unit))
    return _Amount(factor * value, factor * std, "" if unit == "1" else unit, where, when)


def known(effect: NamedEffect) -> list[str]:
    """Return the coefficients of at least two standard deviations."""
    return [
        name
        for name, value in effect.coefficients.items()
        if math.isfinite(value) and abs(value) > _KNOWN * effect.std.get(name, 0.0)
    ]


def with_amounts(effect: NamedEffect, vehicle: Vehicle) -> str:
    """Return an effect's plain name with its amount: the speed and direction of a wind; else the
    largest known coefficient of the first one's unit.
    """
    if effect.name in library.names() and library.get(effect.name).sets_wind:
        return f"{title(effect.name)} {_wind(effect)}"
    names = known(effect) or list(effect.coefficients)[:1]
    if not (told := amount(effect, names[0], vehicle)).unit:
        meaning = coefficient_meaning(effect.name, names[0]).partition(";")[0] or names[0]
        return f"{title(effect.name)}, {meaning} {told}"
    names = [name for name in names if effect.units.get(name) == effect.units.get(names[0])]
    largest = max(names, key=lambda name: abs(effect.coefficients[name]))
    told, most = amount(effect, largest, vehicle), "up to " if len(names) > 1 else ""
    return f"{title(effect.name)} {most}{told} {told.when}".rstrip()


def _wind(effect: NamedEffect) -> _Amount:
    """Return the speed of a wind, and its side."""
    names = [name for name in effect.coefficients if effect.units.get(name) == "m/s"]
    wind = np.nan_to_num([effect.coefficients[name] for name in names])
    std = np.array([effect.std.get(name, 0.0) for name in names])
    speed = math.hypot(*wind)
    sides = (
        f"{'−' if x > 0.0 else '+'}{coefficient_meaning(effect.name, name)[-1]}"
        for name, x in zip(names, wind, strict=True)
        if abs(x) > _BESIDE * speed
    )
    spread = math.hypot(*(wind * std)) / (speed or 1.0)
    return _Amount(speed, spread, "m/s", f"from {' '.join(sides)}", "")


def steady_wrench(pieces: Sequence[tuple[Array, float]], force: float, torque: float) -> str:
    """Return the mean force and torque, each if beyond chance and its floor; else nothing.

    The mean of a block of 3 s is one number; all blocks together say how sure their mean is.

    Args:
        pieces: (n, 6) N and Nm, NaN where not known, and the period, s, of each.
        force: least mean, N.
        torque: least mean, Nm.
    """
    blocks = [
        part.mean(axis=0)
        for x, period in pieces
        for part in np.array_split(x, max(1, round(len(x) * period / _BLOCK)))
    ]
    if len(blocks) < _LEAST_BLOCKS:
        return ""
    mean = np.mean(blocks, axis=0)
    error = np.std(blocks, axis=0, ddof=1) / math.sqrt(len(blocks))
    sure = np.abs(mean) > np.maximum(_STEADY * error, np.nan_to_num(np.repeat([force, torque], 3)))
    told = []
    for kind, unit, first in (("force", "N", 0), ("torque", "Nm", 3)):
        i = first + int(np.argmax(np.abs(mean[first : first + 3])))
        if sure[i]:
            way = "about" if first else "along"
            told.append(f"{kind} {in_unit(float(mean[i]), unit, 3)} {way} {CHANNELS[i][-1]}")
    return in_words(told)
