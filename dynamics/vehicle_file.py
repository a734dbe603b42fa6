"""Vehicles as YAML files: the presets in ``vehicles/`` and a user's own."""

import math
from dataclasses import fields
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ..runtime.errors import InputError, unknown_name
from ..runtime.whole_files import replaced
from ..runtime.yaml_file import parse_yaml, read_yaml
from .effects import check_setting
from .vehicle import Array, EffectSetting, Mocap, MotorCurve, Vehicle

_ROTOR_STEPS = 255  # an 8-bit rotor speed
_MOST_POWERS = 6  # coefficients of a motor curve
_LARGEST = 1e12  # in SI units; products of a few numbers beyond it overflow


def preset_names() -> list[str]:
    """Return the names of the vehicles that come with the kit."""
    return sorted(
        file.name[:-5]
        for file in resources.files(__package__).joinpath("vehicles").iterdir()
        if file.name.endswith(".yaml")
    )


def load_vehicle(name_or_path: str | Path) -> Vehicle:
    """Return a preset by its name, or the vehicle of a YAML file.

    Raises:
        InputError: no such preset or file, or a field that is missing, unknown, malformed or out of
            range.
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
    """Return the vehicle that a YAML text describes; ``where`` names it in errors."""
    return _vehicle(parse_yaml(text, where), where)


def _vehicle(data: object, where: str) -> Vehicle:
    if not isinstance(data, dict):
        raise InputError(
            f"{where}: expected a mapping of fields such as mass and inertia, got "
            f"{type(data).__name__}"
        )
    known = {f.name for f in fields(Vehicle)}
    for key in data:
        if key not in known:
            raise unknown_name("key", str(key), known, where)
    missing = [key for key in ("name", "mass", "inertia", "arm_l", "k", "p") if key not in data]
    if missing:
        raise InputError(f"{where}: missing field(s) {', '.join(missing)}")
    given: dict[str, Any] = {"name": str(data["name"])}
    for key in ("mass", "arm_l", "rotor_radius", "gravity", "omega_max"):
        if key in data:
            given[key] = _number(data[key], where, key, positive=True)
    for key in ("omega_lsb", "voltage_ref", "floor_z", "ceiling_z"):
        if key in data:
            given[key] = _number(data[key], where, key)
    for key in ("omega_lsb", "voltage_ref"):
        if given.get(key, 0.0) < 0:
            raise InputError(f"{where}: {key} must not be negative, got {given[key]}")
    if not given.get("floor_z", -math.inf) < given.get("ceiling_z", math.inf):
        raise InputError(f"{where}: floor_z must lie below ceiling_z")
    for key in ("k", "p"):
        given[key] = _numbers(data[key], where, key, (4,))
        if np.any(given[key] <= 0):
            raise InputError(f"{where}: {key} must be four positive numbers, got {data[key]}")
    given["inertia"] = _inertia(data["inertia"], where)
    if "omega_max" not in given and given.get("omega_lsb", 0.0) > 0:
        given["omega_max"] = _ROTOR_STEPS * given["omega_lsb"]
    if "spin" in data:
        given["spin"] = _numbers(data["spin"], where, "spin", (4,))
        if not np.all(np.isin(given["spin"], (-1.0, 1.0))):
            raise InputError(
                f"{where}: spin must be four times 1 or -1 (turning sense about body +z), got "
                f"{data['spin']}"
            )
    if data.get("rotor_positions") is not None:
        given["rotor_positions"] = _numbers(
            data["rotor_positions"], where, "rotor_positions", (4, 3)
        )
    if "com" in data:
        given["com"] = _numbers(data["com"], where, "com", (3,))
    if "omega_source" in data:
        if data["omega_source"] not in ("measured", "commanded"):
            raise InputError(
                f"{where}: omega_source must be measured or commanded, got {data['omega_source']!r}"
            )
        given["omega_source"] = data["omega_source"]
    if "mocap" in data:
        given["mocap"] = _mocap(data["mocap"], where)
    if data.get("motor_curve") is not None:
        given["motor_curve"] = _motor_curve(data["motor_curve"], where)
    given["effects"] = _effects(data.get("effects") or [], where)
    vehicle = Vehicle(**given)
    length = np.linalg.norm(
        vehicle.mixing, axis=1, keepdims=True
    )  # zero where all rotors stand in one line
    if np.any(length == 0.0) or np.linalg.cond(vehicle.mixing / length) > 1e6:
        raise InputError(
            f"{where}: rotor_positions and spin: the four rotors cannot make thrust and three "
            f"torques "
            "independently of one another"
        )
    return vehicle


def dump_vehicle(vehicle: Vehicle) -> str:
    """Return the YAML text of a vehicle: ``parse_vehicle`` of it gives the vehicle again."""
    data: dict[str, Any] = {}
    for f in fields(Vehicle):
        value = getattr(vehicle, f.name)
        if value is None or (isinstance(value, float) and math.isinf(value)):
            continue
        if f.name == "mocap":
            value = {m.name: getattr(value, m.name) for m in fields(Mocap)}
        elif isinstance(value, MotorCurve):
            value = {
                "thrust": [float(x) for x in value.thrust],
                "voltage_exponent": float(value.voltage_exponent),
                "command": [float(x) for x in value.command],
            }
        elif f.name == "effects":
            value = [
                {"name": e.name, "coefficients": {c: float(v) for c, v in e.coefficients.items()}}
                for e in value
            ]
        elif isinstance(value, np.ndarray):
            value = value.tolist()
        elif isinstance(value, np.generic):
            value = value.item()
        data[f.name] = value
    return yaml.safe_dump(data, sort_keys=False, allow_unicode=True)


def save_vehicle(vehicle: Vehicle, path: str | Path) -> None:
    """Write a vehicle to a YAML file, whole or not at all: ``load_vehicle`` of it gives the vehicle
    again.

    Raises:
        InputError: the file cannot be written.
    """
    with replaced(Path(path)) as partial:
        partial.write_text(dump_vehicle(vehicle), encoding="utf-8")


def _number(value: object, where: str, key: str, positive: bool = False) -> float:
    text = value.removeprefix("nominal").strip() if isinstance(value, str) else value
    try:
        number = math.nan if isinstance(text, bool) else float(text)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not abs(number) <= _LARGEST or (positive and number <= 0):
        expected = "a positive number" if positive else "a finite number"
        raise InputError(f"{where}: {key} must be {expected}, got {value!r}")
    return number


def _numbers(value: object, where: str, key: str, shape: tuple[int, ...]) -> Array:
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.empty(0)
    if array.shape != shape or not np.all(np.abs(array) <= _LARGEST):
        expected = " x ".join(map(str, shape))
        raise InputError(f"{where}: {key} must be {expected} finite numbers, got {value!r}")
    return array


def _inertia(value: object, where: str) -> Array:
    if isinstance(value, list) and len(value) == 3 and not isinstance(value[0], list):
        matrix = np.diag(_numbers(value, where, "inertia", (3,)))
    else:
        matrix = _numbers(value, where, "inertia", (3, 3))
    if not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0.0) or np.any(
        np.linalg.eigvalsh(matrix) <= 0
    ):
        raise InputError(
            f"{where}: inertia must be symmetric and positive definite (3 principal values or 3 x "
            f"3), "
            f"got {value!r}"
        )
    return matrix


def _mocap(value: object, where: str) -> Mocap:
    known = {f.name for f in fields(Mocap)}
    if not isinstance(value, dict):
        raise InputError(f"{where}: mocap must be a mapping of {', '.join(sorted(known))}")
    for key in value:
        if key not in known:
            raise unknown_name("key", str(key), known, f"{where}: mocap")
    return Mocap(
        **{key: _number(v, where, f"mocap.{key}", positive=True) for key, v in value.items()}
    )


def _motor_curve(value: object, where: str) -> MotorCurve:
    known = {f.name for f in fields(MotorCurve)}
    where = f"{where}: motor_curve"
    if not isinstance(value, dict) or "thrust" not in value:
        raise InputError(
            f"{where} must be a mapping of thrust (N, coefficients of u^0, u^1, ...), "
            f"voltage_exponent and command (raw command at u = 0 and 1), got {value!r}"
        )
    for key in value:
        if key not in known:
            raise unknown_name("key", str(key), known, where)
    thrust = value["thrust"]
    if not isinstance(thrust, list) or not 2 <= len(thrust) <= _MOST_POWERS:
        raise InputError(
            f"{where}: thrust must be 2 to {_MOST_POWERS} numbers, the coefficients in N of "
            f"u^0, u^1, ... with the command u from 0 to 1, got {thrust!r}"
        )
    coefficients = _numbers(thrust, where, "thrust", (len(thrust),))
    if not np.sum(coefficients) > 0.0:
        raise InputError(
            f"{where}: thrust at the full command, the sum of its coefficients, is "
            f"{np.sum(coefficients):g} N; expected a positive one"
        )
    given: dict[str, Any] = {"thrust": tuple(float(x) for x in coefficients)}
    if "voltage_exponent" in value:
        given["voltage_exponent"] = _number(value["voltage_exponent"], where, "voltage_exponent")
    if "command" in value:
        low, high = _numbers(value["command"], where, "command", (2,))
        if not low < high:
            raise InputError(
                f"{where}: command must be the raw command at u = 0 and a larger one at u = 1, "
                f"got {value['command']!r}"
            )
        given["command"] = (float(low), float(high))
    return MotorCurve(**given)


def _effects(value: object, where: str) -> tuple[EffectSetting, ...]:
    if not isinstance(value, list):
        raise InputError(
            f"{where}: effects must be a list of {{name, coefficients}}, got {value!r}"
        )
    settings = []
    for item in value:
        if not isinstance(item, dict) or set(item) - {"name", "coefficients"} or "name" not in item:
            raise InputError(
                f"{where}: effects: each must be a mapping of name and coefficients, got {item!r}"
            )
        given = item.get("coefficients") or {}
        if not isinstance(given, dict):
            raise InputError(
                f"{where}: effects: {item['name']}: coefficients must be a mapping, got {given!r}"
            )
        numbers = {
            str(c): _number(v, where, f"effects: {item['name']}.{c}") for c, v in given.items()
        }
        settings.append(check_setting(EffectSetting(str(item["name"]), numbers), where))
    return tuple(settings)
