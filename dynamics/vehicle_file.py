"""Vehicles as YAML files: the presets in ``vehicles/`` and a user's own."""

from importlib import resources
from pathlib import Path

import numpy as np
import yaml

from ..runtime.errors import InputError, unknown_name
from ..runtime.forms import checked
from ..runtime.plain_values import plain
from ..runtime.whole_files import replaced
from ..runtime.yaml_file import parse_yaml, read_yaml
from .effects import check_setting
from .vehicle import Vehicle


def preset_names() -> list[str]:
    """Return the names of the vehicles that come with the kit."""
    return sorted(
        file.name[:-5]
        for file in resources.files(__package__).joinpath("vehicles").iterdir()
        if file.name.endswith(".yaml")
    )


def name_in_log(vehicle: Vehicle, given: str) -> str:
    """Return the name by which a log states its vehicle; empty where a file's vehicle has the name
    of a preset, which is another vehicle.

    Args:
        vehicle: that was loaded.
        given: the preset's name, or the path, by which it was loaded.
    """
    presets = preset_names()
    return vehicle.name if given in presets or vehicle.name not in presets else ""


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


def dump_vehicle(vehicle: Vehicle) -> str:
    """Return the YAML text of a vehicle: ``parse_vehicle`` of it gives the vehicle again."""
    data = {key: value for key, value in plain(vehicle).items() if value is not None}
    return yaml.safe_dump(data, sort_keys=False, allow_unicode=True)


def save_vehicle(vehicle: Vehicle, path: str | Path) -> None:
    """Write a vehicle to a YAML file, whole or not at all: ``load_vehicle`` of it gives the vehicle
    again.

    Raises:
        InputError: the file cannot be written.
    """
    with replaced(Path(path)) as partial:
        partial.write_text(dump_vehicle(vehicle), encoding="utf-8")
