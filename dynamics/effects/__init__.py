"""The library of physical effects: one file an effect, found by its file's name.

``get("rotor_drag")`` is the ``EFFECT`` of ``rotor_drag.py``. ``compile_effects`` prepares a
vehicle's effects for the core. Folders of a user's own join the library: the environment
variable ``WINDWRENCH_EFFECTS`` names some, for every command and its workers, and ``add_folder``
adds more.
"""

import os
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np

from ...runtime.errors import InputError, unknown_name
from ...runtime.python_file import import_file
from ..vehicle import EffectSetting, Vehicle
from .base import PARAMETERS, ROW_SIZE, VEHICLE_SIZE, Array, Coefficient, Effect
from .declaration import Family, Need, Role
from .own import addresses
from .vanishing import does_nothing_alone

__all__ = [
    "Bundle",
    "Coefficient",
    "Effect",
    "Family",
    "Need",
    "Role",
    "add_folder",
    "check_setting",
    "compile_effects",
    "get",
    "model_in_words",
    "names",
    "needing",
    "of_family",
    "parse_setting",
    "playing",
]


def __dir__() -> list[str]:
    return __all__


_FOLDERS = "WINDWRENCH_EFFECTS"
_NOT_EFFECTS = {"__init__", "__main__", "base", "declaration", "own", "vanishing"}


def add_folder(folder: str | Path) -> tuple[str, ...]:
    """Let the files of a folder be effects, here and in child processes; return their names.

    Raises:
        InputError: no such folder, or a file with the name of a known effect.
    """
    folders = tuple(dict.fromkeys((*_folders(), str(Path(folder).resolve()))))
    for known in (_files_in, names):
        known.cache_clear()
    _files_in(folders)
    os.environ[_FOLDERS] = os.pathsep.join(folders)
    return tuple(sorted(path.stem for path in _effects_in(Path(folder))))


def _effects_in(folder: Path) -> list[Path]:
    return [
        path
        for path in sorted(folder.glob("*.py"))
        if path.stem not in _NOT_EFFECTS and not path.stem.startswith("_")
    ]


def _folders() -> tuple[str, ...]:
    return tuple(filter(None, os.environ.get(_FOLDERS, "").split(os.pathsep)))


def _files() -> dict[str, Path]:
    """Return the file of each effect; those of the kit's own first."""
    return _files_in(_folders())


@cache
def _files_in(folders: tuple[str, ...]) -> dict[str, Path]:
    files = {path.stem: path for path in _effects_in(Path(__file__).parent)}
    for folder in map(Path, folders):
        if not folder.is_dir():
            raise InputError(
                f"{_FOLDERS}: {folder} is no folder; expected folders of effects, with "
                f"{os.pathsep} between them"
            )
        for path in _effects_in(folder.resolve()):
            if files.setdefault(path.stem, path) != path:
                raise InputError(
                    f"{path}: an effect {path.stem} is there already ({files[path.stem]}); "
                    f"expected another name"
                )
    return files


@cache
def names() -> tuple[str, ...]:
    """Return the names of all effects, sorted."""
    return tuple(sorted(_files()))


@cache
def get(name: str) -> Effect:
    """Return an effect by its name.

    Raises:
        InputError: no such effect, none in a user's own file, an error in its function, or a law
            without starting points whose coefficients do nothing alone.
    """
    if name not in names():
        raise unknown_name("effect", name, names())
    effect = getattr(_module(name), "EFFECT", None)
    if not isinstance(effect, Effect) or effect.name != name:
        raise InputError(
            f"{_files()[name]}: expected EFFECT = Effect(name={name!r}, ...), got "
            f"{getattr(effect, 'name', effect)!r}"
        )
    # tests ask the kit's own
    if not _is_own(name) and does_nothing_alone(effect) and effect.starting_points is None:
        raise InputError(
            f"{_files()[name]}: effect {name}: no coefficient does anything while the others are "
            "zero, so no diagnosis could ever find it; add starting_points=..., a function that "
            "returns sets of coefficients from which a fit may start"
        )
    return effect


def playing(*roles: Role, among: Iterable[str] | None = None) -> tuple[str, ...]:
    """Return the effects that play any of some roles, role by role; by default of the whole
    library, the kit's own before a user's.
    """
    if among is None:
        among = sorted(names(), key=lambda name: not _is_own(name))
    candidates = tuple(among)
    return tuple(name for role in roles for name in candidates if get(name).role == role)


def of_family(*families: Family, among: Iterable[str] | None = None) -> frozenset[str]:
    """Return the effects of any of some families; by default of the whole library."""
    return frozenset(
        name for name in (names() if among is None else among) if get(name).family in families
    )


def needing(*needs: Need) -> frozenset[str]:
    """Return the effects of the library that need any of these from logs."""
    return frozenset(name for name in names() if set(needs) & set(get(name).needs))


def model_in_words(name: str) -> str:
    """Return an effect's equation in words: the docstring of its file."""
    return (_module(name).__doc__ or "").strip()


def _module(name: str) -> ModuleType:
    if _is_own(name):
        return import_module(f".{name}", __name__)
    return import_file(_files()[name], "an effect")


def _is_own(name: str) -> bool:
    """Return whether an effect is the kit's own, and none of a user's."""
    return _files()[name].parent == Path(__file__).parent


def check_setting(setting: EffectSetting, where: str = "effect") -> EffectSetting:
    """Return the setting if its effect and coefficients exist and lie in range.

    Raises:
        InputError: naming ``where``, the effect and the coefficient.
    """
    if setting.name not in names():
        raise unknown_name("effect", setting.name, names(), where)
    coefficients = {c.name: c for c in get(setting.name).coefficients}
    for name, value in setting.coefficients.items():
        if name not in coefficients:
            raise unknown_name("coefficient", name, coefficients, f"{where}: effect {setting.name}")
        if not coefficients[name].minimum <= value <= coefficients[name].maximum:
            raise InputError(
                f"{where}: effect {setting.name}: {name} must lie between "
                f"{coefficients[name].minimum:g} and "
                f"{coefficients[name].maximum:g} {coefficients[name].unit}, got {value:g}"
            )
    return setting


def parse_setting(text: str, vehicle: Vehicle | None = None) -> EffectSetting:
    """Return the effect setting of a command line's ``NAME:coef=value,coef=value``.

    A bare NAME takes typical sizes, those of a 0.03 kg vehicle if ``vehicle`` weighs less than 0.1
    kg.

    Raises:
        InputError: another form, or an unknown effect or coefficient.
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
            raise InputError(
                f"--effect {text}: expected NAME:coef=value with finite values, got {part!r}"
            )
    return check_setting(EffectSetting(name, coefficients), "--effect")


@dataclass(frozen=True, eq=False)
class Bundle:
    """A vehicle's effects, ready for the core: the addresses of effect models and their
    coefficients, kind by kind.
    """

    vehicle: Vehicle  # with the body effects applied
    constants: Array  # (VEHICLE_SIZE,) of the vehicle, for effect models
    wrench_models: np.ndarray  # (n,) int64 addresses
    wrench_coefficients: Array  # (n, ROW_SIZE)
    wrench_hooks: np.ndarray  # (n,) int64 addresses of ``advance``; 0: no state of its own
    rotor_models: np.ndarray  # (m,) int64 addresses
    rotor_coefficients: Array  # (m, 8)
    sensing_models: np.ndarray  # (k,) int64 addresses
    sensing_coefficients: Array  # (k, 8)


def compile_effects(vehicle: Vehicle) -> Bundle:
    """Return the effects of a vehicle, ready for the core."""
    amended = vehicle
    rows: dict[str, list[tuple[Effect, Array]]] = {"wrench": [], "rotor input": [], "sensing": []}
    for setting in vehicle.effects:
        effect = get(setting.name)
        if effect.amend is not None:
            amended = effect.amend(amended, setting.coefficients)
        if effect.model is not None:
            rows[effect.kind].append((effect, effect.vector(setting.coefficients)))
    rows["wrench"].sort(key=lambda row: not row[0].sets_wind)
    v = amended
    constants = np.hstack(
        [
            *(v.mass, v.gravity, v.rotor_radius, v.floor_z, v.ceiling_z, v.voltage_ref),
            *(v.hover_rate, v.com, v.positions.ravel(), v.spin, v.p),
        ]
    )
    assert constants.size == VEHICLE_SIZE

    def stack(kind: str, width: int) -> tuple[np.ndarray, Array]:
        """Return addresses and coefficients (n, width) of a kind's models."""
        coefficients = np.zeros((len(rows[kind]), width))
        for i, (_, vector) in enumerate(rows[kind]):
            coefficients[i, : len(vector)] = vector
        models = np.array([addresses(effect)[0] for effect, _ in rows[kind]], dtype=np.int64)
        return models, coefficients

    models, coefficients = stack("wrench", ROW_SIZE)
    hooks = np.array([addresses(effect)[1] for effect, _ in rows["wrench"]], dtype=np.int64)
    return Bundle(
        amended,
        constants,
        models,
        coefficients,
        hooks,
        *stack("rotor input", PARAMETERS),
        *stack("sensing", PARAMETERS),
    )
