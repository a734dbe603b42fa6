"""Vehicles as YAML files: the presets in ``vehicles/`` and a user's own."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ..runtime.errors import InputError, unknown_name
from ..runtime.forms import checked
from ..runtime.page_files import write_text
from ..runtime.plain_values import plain
from ..runtime.yaml_file import parse_yaml, read_yaml
from .effects import check_setting
from .vehicle import SPIN, Vehicle

Deviations = Mapping[str, Mapping[str, float]]  # a coefficient's, by effect


def preset_names() -> list[str]:
    """Return the names of the kit's vehicles."""
    return sorted(
        file.name[:-5]
        for file in resources.files(__package__).joinpath("vehicles").iterdir()
        if file.name.endswith(".yaml")
    )


def named_vehicle(name: str, log: object) -> Vehicle:
    """Return the preset named by a log.

    Raises:
        InputError: no such preset.
    """
    if name not in preset_names():
        unknown = f"names the vehicle {name}, which does not come with the kit"
        what = unknown if name else "the log does not name its vehicle"
        raise InputError(
            f"{log}: {what}; expected --vehicle {', '.join(preset_names())} or the path of a YAML "
            "file"
        )
    return load_vehicle(name)


def name_in_log(vehicle: Vehicle, given: str) -> str:
    """Return the vehicle's name for a log; empty where a file's vehicle has the name of a preset,
    another vehicle.

    Args:
        vehicle: the loaded one.
        given: its source: the preset's name, or the path.
    """
    presets = preset_names()
    return vehicle.name if given in presets or vehicle.name not in presets else ""


def load_vehicle(name_or_path: str | Path) -> Vehicle:
    """Return a preset by its name, or the vehicle of a YAML file.

    Raises:
        InputError: no such preset or file, or a missing, unknown, malformed or out-of-range field.
    """
    path = Path(name_or_path)
    if path.suffix in {".yaml", ".yml"}:
        return _vehicle(read_yaml(path, "a vehicle file"), str(path))
    presets = preset_names()
    if str(name_or_path) not in presets:
        raise unknown_name(
            "vehicle", str(name_or_path), presets, "vehicle (a preset's name or a .yaml file)"
        )
    source = resources.files(__package__).joinpath("vehicles", f"{name_or_path}.yaml")
    return parse_vehicle(source.read_text(encoding="utf-8"), f"{name_or_path}.yaml")


def parse_vehicle(text: str, where: str = "vehicle") -> Vehicle:
    """Return the vehicle of a YAML text; ``where`` names the text in errors."""
    return _vehicle(parse_yaml(text, where), where)


def _vehicle(data: object, where: str) -> Vehicle:
    if isinstance(data, dict):  # a field without a value is not stated
        data = {key: value for key, value in data.items() if value is not None}
    vehicle = checked(Vehicle, data, where, "mass and inertia")
    if not vehicle.floor_z < vehicle.ceiling_z:
        raise InputError(f"{where}: floor_z must lie below ceiling_z")
    # a row is zero where all rotors stand in one line
    length = np.linalg.norm(vehicle.mixing, axis=1, keepdims=True)
    if np.any(length == 0.0) or np.linalg.cond(vehicle.mixing / length) > 1e6:
        raise InputError(
            f"{where}: rotor_positions and spin: the four rotors cannot make thrust and three "
            "torques independently of one another"
        )
    return vehicle.with_effects(*(check_setting(effect, where) for effect in vehicle.effects))


def dump_vehicle(vehicle: Vehicle, std: Deviations | None = None) -> str:
    """Return the YAML text of a vehicle, without fields at their defaults: ``parse_vehicle`` of it
    gives the vehicle again.

    Args:
        vehicle: the vehicle.
        std: standard deviations of its effects' coefficients, for a measured vehicle. They stand
            beside the coefficients. Every number has two digits more than its accuracy, or six
            significant ones without a known accuracy. A coefficient of zero within its error is
            written, too: missing ones are fixed at zero.
    """
    data = plain(vehicle)
    if not np.any(vehicle.inertia - np.diag(np.diag(vehicle.inertia))):
        data["inertia"] = np.diag(vehicle.inertia).tolist()
    if std is not None:
        shares = vehicle.uncertainty
        accuracies = vars(shares) | {
            "k": math.hypot(shares.thrust, shares.rotor),
            "p": math.hypot(shares.thrust, shares.torque),
            "uncertainty": 0.5,
        }
        data = {key: _rounded(value, accuracies.get(key, 0.0)) for key, value in data.items()}
        for effect in data["effects"]:
            deviations = std.get(effect["name"], {})
            for name, value in effect["coefficients"].items():
                effect["coefficients"][name] = _rounded(value, 0.0, deviations.get(name, 0.0))
    usual = {f.name: plain(f.default) for f in fields(Vehicle)}
    usual |= {"com": [0.0] * 3, "spin": plain(SPIN)}
    stated = {k: x for k, x in data.items() if x is not None and (k not in usual or x != usual[k])}
    lines, effect = [], ""
    for line in yaml.safe_dump(stated, sort_keys=False, allow_unicode=True).splitlines():
        name, _, value = line.strip().partition(": ")
        effect = value if name == "- name" else effect
        deviation = (std or {}).get(effect, {}).get(name, 0.0) if line.startswith("    ") else 0.0
        lines.append(line + (f"  # ± {deviation:.2g}" if deviation > 0.0 else ""))
    return "\n".join(lines) + "\n"


def _rounded(value: Any, share: float, deviation: float = 0.0) -> Any:
    """Return numbers, in lists and mappings too, with two digits more than a standard deviation, or
    a share of each number. With neither, they have six significant digits.
    """
    if isinstance(value, dict):
        return {key: _rounded(item, share, deviation) for key, item in value.items()}
    if isinstance(value, list):
        return [_rounded(item, share, deviation) for item in value]
    if not isinstance(value, float):
        return value
    deviation = deviation or share * abs(value)
    if not 0.0 < deviation < math.inf:
        return float(f"{value:.6g}")
    return round(value, 2 - math.floor(math.log10(deviation)))


def save_vehicle(vehicle: Vehicle, path: str | Path, std: Deviations | None = None) -> None:
    """Write a vehicle to a YAML file, whole or not at all; ``std`` as ``dump_vehicle`` takes it.

    Raises:
        InputError: the file cannot be written.
    """
    write_text(dump_vehicle(vehicle, std), Path(path))
