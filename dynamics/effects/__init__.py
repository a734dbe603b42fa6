"""The library of physical effects: one file an effect, found by its file's name.

``get("rotor_drag")`` is the ``EFFECT`` of ``rotor_drag.py``. ``compile_effects`` prepares a vehicle's effects for
compiled code.
"""

from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path

import numpy as np

from ..errors import InputError, unknown_name
from ..vehicle import EffectSetting, Vehicle
from .base import VEHICLE_SIZE, Array, Coefficient, Effect

__all__ = ["Bundle", "Coefficient", "Effect", "check_setting", "compile_effects", "get", "names", "parse_setting"]

_NOT_EFFECTS = {"__init__", "base", "call"}


@cache
def names() -> tuple[str, ...]:
    """Return the names of all effects, sorted."""
    return tuple(sorted(p.stem for p in Path(__file__).parent.glob("*.py") if p.stem not in _NOT_EFFECTS))


@cache
def get(name: str) -> Effect:
    """Return an effect by its name.

    Raises:
        InputError: no effect has this name.
    """
    if name not in names():
        raise unknown_name("effect", name, names())
    effect: Effect = import_module(f".{name}", __name__).EFFECT
    return effect


def check_setting(setting: EffectSetting, where: str = "effect") -> EffectSetting:
    """Return the setting if its effect and coefficients exist and lie in range.

    Raises:
        InputError: naming ``where``, the effect and the coefficient.
    """
    if setting.name not in names():
        raise unknown_name("effect", setting.name, names(), where)
    known = {c.name: c for c in get(setting.name).coefficients}
    for name, value in setting.coefficients.items():
        if name not in known:
            raise unknown_name("coefficient", name, known, f"{where}: effect {setting.name}")
        if not known[name].minimum <= value <= known[name].maximum:
            raise InputError(f"{where}: effect {setting.name}: {name} must lie between {known[name].minimum:g} and "
                             f"{known[name].maximum:g} {known[name].unit}, got {value:g}")
    return setting


def parse_setting(text: str, vehicle: Vehicle | None = None) -> EffectSetting:
    """Return the effect setting of a command line's ``NAME:coef=value,coef=value``.

    A bare NAME takes typical sizes, those of a 0.03 kg vehicle if ``vehicle`` weighs less than 0.1 kg.

    Raises:
        InputError: the text is not of that form, or names no known effect or coefficient.
    """
    name, _, rest = text.partition(":")
    if name not in names():
        raise unknown_name("effect", name, names(), "--effect")
    if not rest:
        size = 1 if vehicle is not None and vehicle.mass < 0.1 else 0
        return EffectSetting(name, {c.name: c.typical[size] for c in get(name).coefficients})
    coefficients = {}
    for part in rest.split(","):
        key, equals, value = part.partition("=")
        try:
            coefficients[key.strip()] = float(value)
        except ValueError:
            equals = ""
        if not equals or not np.isfinite(coefficients[key.strip()]):
            raise InputError(f"--effect {text}: expected NAME:coef=value with finite values, got {part!r}")
    return check_setting(EffectSetting(name, coefficients), "--effect")


@dataclass(frozen=True, eq=False)
class Bundle:
    """A vehicle's effects, ready for compiled code: the addresses of laws and their coefficients, kind by kind."""

    vehicle: Vehicle  # with the body effects applied
    constants: Array  # (VEHICLE_SIZE,) what laws may know of it
    wrench_laws: np.ndarray  # (n,) int64 addresses
    wrench_coefficients: Array  # (n, 8)
    rotor_laws: np.ndarray  # (m,) int64 addresses
    rotor_coefficients: Array  # (m, 8)
    rotor_memory: int  # columns of the memory (m, rotor_memory) that the rotor laws need


def compile_effects(vehicle: Vehicle) -> Bundle:
    """Return the effects of a vehicle, ready for compiled code."""
    amended = vehicle
    wrench: list[tuple[int, Array]] = []
    rotor: list[tuple[int, Array]] = []
    memory = 1
    for setting in vehicle.effects:
        effect = get(setting.name)
        if effect.amend is not None:
            amended = effect.amend(amended, setting.coefficients)
        if effect.law is not None:
            column = np.zeros(8)
            column[: len(effect.coefficients)] = effect.vector(setting.coefficients)
            (wrench if effect.kind == "wrench" else rotor).append((effect.law.address, column))
            memory = max(memory, effect.memory)
    constants = np.concatenate([
        [amended.mass, amended.gravity, amended.rotor_radius, amended.floor_z, amended.ceiling_z, amended.voltage_ref,
         amended.hover_rate], amended.com, amended.positions.ravel()])
    assert constants.size == VEHICLE_SIZE

    def stack(laws: list[tuple[int, Array]]) -> tuple[np.ndarray, Array]:
        return (np.array([address for address, _ in laws], dtype=np.int64),
                np.array([c for _, c in laws]).reshape(len(laws), 8))

    return Bundle(amended, constants, *stack(wrench), *stack(rotor), memory)
