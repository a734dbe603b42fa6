"""The wrench filter of one vehicle for a flight controller: the core's own headers, one header of
numbers, and a C interface, in single or double precision.

Every number comes from the Python filter's record (``estimator.filter_record``), its one place.
``tests/live/test_export_c.py`` flies both.
"""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import resources
from posixpath import dirname, join, normpath
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from ... import __version__
from ...controllers.wind_observation import WIND_PERIOD
from ...dynamics.effects import get
from ...dynamics.effects.base import MEMORY, PARAMETERS, ROW_SIZE, Effect
from ...dynamics.mean_jet import jet_table
from ...dynamics.vehicle import Vehicle
from ...estimator import ConstantGainFilter, Recovery, UKFTuning, WrenchUKF
from ...estimator.filter_record import FILTER, fields_between
from ...estimator.ukf import default_covariance
from ...runtime.errors import InputError, unknown_name
from .flights import CONTROLLERS, flight_of
from .numbers import PRECISIONS, filters
from .policies import policy_numbers

_FILTERS: dict[str, tuple[type[WrenchUKF], str, str]] = {
    "constant-gain": (ConstantGainFilter, "The filter with a constant gain", "constant_gain"),
    "ukf": (WrenchUKF, "The unscented Kalman filter", "imu"),
}
ESTIMATORS = tuple(_FILTERS)
# files written from the template of the name
TEMPLATES = ("windwrench.h", "windwrench_numbers.hpp", "main.c", "CMakeLists.txt")
_MEMORY = "body", "centre_rotation"  # fields of a filter's memory, from one to another
_SHORT_MEMORY = {"motor_lag"}  # equations that remember no more than the model itself: 5 numbers
_FAN = 0.45, 0.10  # m, radii of the fan and its hub in the effect fan_jet
_INCLUDE = re.compile(r'^#include "([\w./]+)"', re.M)


@dataclass(frozen=True)
class Exported:
    """An export, not yet written: the texts of the files by their paths in the folder, and the
    equivalent Python filter.
    """

    files: Mapping[str, str]
    filter: WrenchUKF
    effects: tuple[str, ...]
    precision: str = "single"


def export_c(
    vehicle: Vehicle,
    estimator: str = "ukf",
    rate: float | None = None,
    rise_time: float = 1.0,
    gate: float | None = 0.9999,
    policy: Mapping[str, Any] | None = None,
    command: str = "windwrench export-c",
    precision: str = "single",
    controller: str | None = None,
) -> Exported:
    """Return the files of a vehicle's filter for a flight controller.

    Args:
        vehicle: the vehicle; its declared effects are part of the filter's model.
        estimator: one of ``ESTIMATORS``.
        rate: poses a second; default: the vehicle's motion capture's; with a flight loop the
            nearest whole number of steps a decision.
        rise_time: s, 10-90 %, of the estimated force and torque.
        gate: as of ``WrenchUKF``.
        policy: from ``exportable_policy``, or None.
        command: the command line, for the files' heads.
        precision: one of ``PRECISIONS`` for every number: single (float), or double, for
            processors as fast with double numbers.
        controller: one of ``CONTROLLERS``, designed for the vehicle, in the flight loop; or None.

    Raises:
        InputError: a setting is out of range, an effect is a user's own, or single precision does
            not hold a number.
    """
    if estimator not in _FILTERS:
        raise InputError(f"estimator: expected one of {', '.join(ESTIMATORS)}, got {estimator!r}")
    if precision not in PRECISIONS:
        raise InputError(f"precision: expected {' or '.join(PRECISIONS)}, got {precision!r}")
    learned = (policy or {}).get("policy")
    if rate is None:
        rate = vehicle.mocap.rate_hz
        if controller or learned:  # a measured rate, such as 101.3 Hz, holds no whole steps
            rate = max(1, round(WIND_PERIOD * rate)) / WIND_PERIOD
    for name, value in (("rate", rate), ("rise_time", rise_time)):
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(f"{name}: expected a positive number, got {value!r}")
    period = 1.0 / rate
    effects = _effects(vehicle)
    tuning = UKFTuning.for_vehicle(vehicle, period, rise_time)
    kind, title, header = _FILTERS[estimator]
    made = kind(vehicle, tuning, period, gate, Recovery())
    if controller not in (None, *CONTROLLERS):
        raise unknown_name("controller", str(controller), CONTROLLERS, "--controller")
    flown = policy_numbers(policy, vehicle, tuning, period) if policy and not learned else None
    flight = flight_of(vehicle, period, controller, learned) if controller or learned else None
    f = made.record[0]
    names = sorted({str(effect.model) for kind in effects.values() for effect in kind})
    headers = [f"core/{header}.hpp", *(f"core/effects/{name}.hpp" for name in names)]
    needed = {
        "effects/called": names,
        "tracker": flown and flown["kind"] == "tracker",
        "flight_loop": flight,
    }
    headers += [f"core/{name}.hpp" for name, whether in needed.items() if whether]
    room = _room(effects)
    context: dict[str, Any] = {
        "version": __version__,
        "command": _one_line(command),
        "title": f"{title}, for the vehicle {_one_line(vehicle.name)}.",
        "precision": precision,
        "number": PRECISIONS[precision],
        "imu": estimator != "constant-gain",
        "rate": rate,
        "f": f,
        "filter": made,
        "settings": f[list(fields_between("gated", "period"))],
        "first_variances": np.diag(default_covariance(vehicle, tuning)),
        "full_battery": vehicle.voltage_ref,
        "headers": headers,
        "effects": effects,
        "jet": [table.ravel() for table in jet_table(*_FAN)] if "fan_jet" in names else None,
        "room": room,
        "size": _size(room, PRECISIONS[precision], estimator),
        "steady": _STEADY,
        "policy": flown,
        "flight": flight,
    }
    environment = Environment(
        loader=PackageLoader("windwrench.live.export_c", "templates"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # C, no page
    )
    environment.filters |= filters(precision)
    files = {name: environment.get_template(f"{name}.j2").render(context) for name in TEMPLATES}
    files["windwrench.cpp"] = _source("live/export_c/source/windwrench.cpp")
    if flown is not None:
        files["policy.hpp"] = _source(f"live/export_c/source/{flown['kind']}.hpp")
    if flight is not None:
        files["flight.hpp"] = _source("live/export_c/source/flight.hpp")
    for path in headers:
        _add_header(path, files)
    return Exported(files, made, tuple(e.name for e in vehicle.effects), precision)


def _effects(vehicle: Vehicle) -> dict[str, list[Effect]]:
    """Return the effects with an equation by their kind, as a model's fields name them, in the
    filter's order.

    Raises:
        InputError: an effect is a user's own.
    """
    kinds = {"wrench": "wrench", "rotor input": "rotor", "sensing": "sensing"}
    by_kind: dict[str, list[Effect]] = {kind: [] for kind in kinds.values()}
    for setting in vehicle.effects:
        effect = get(setting.name)
        if effect.kind == "body":  # its numbers are the vehicle's
            continue
        if not isinstance(effect.model, str):
            raise InputError(
                f"{vehicle.name}: effects: {effect.name} is your own, in Python, and cannot be "
                "exported; expected effects of the kit, or --effects none"
            )
        by_kind[kinds[effect.kind]].append(effect)
    by_kind["wrench"].sort(key=lambda effect: not effect.sets_wind)
    return by_kind


def _room(effects: Mapping[str, list[Effect]]) -> tuple[int, int, int, int]:
    """Return the room of a model: effects on wrench, rotors and sensors, and numbers of memory of
    each. Without a delaying equation the memory is small.
    """
    wrench, rotor, sensing = (max(1, len(kind)) for kind in effects.values())
    long = any(
        "T *memory" in _source(f"core/effects/{effect.model}.hpp")
        for effect in effects["rotor"] + effects["sensing"]
        if effect.model not in _SHORT_MEMORY
    )
    return wrench, rotor, sensing, MEMORY if long else 5


def _source(path: str) -> str:
    """Return the text of a file of the package."""
    return resources.files("windwrench").joinpath(path).read_text(encoding="utf-8")


def _add_header(path: str, files: dict[str, str]) -> None:
    """Add a header of the core and its included headers, unchanged."""
    if path not in files:
        files[path] = _source(path)
        for included in _INCLUDE.findall(files[path]):
            _add_header(normpath(join(dirname(path), included)), files)


# fields of a model with a row for each effect: kind of the effect, and numbers in a row
_ROOMS = {
    "wrench_models": (0, 1),
    "wrench_hooks": (0, 1),
    "wrench_coefficients": (0, ROW_SIZE),
    "rotor_models": (1, 1),
    "rotor_coefficients": (1, PARAMETERS),
    "sensing_models": (2, 1),
    "sensing_coefficients": (2, PARAMETERS),
}
_STEADY = {
    "gain": "of a pose (rho, x)",
    "information": "inverse covariance of its innovation",
    "converged": "covariance after a correction",
    "settle": "s for which the covariance must have been near that one",
    "hover": "derivatives of angular and linear acceleration by the error state",
}
_ALIGNMENT = 48  # bytes, at most, between numbers of several sizes


def _size(room: tuple[int, int, int, int], number: str, estimator: str) -> str:
    """Return the bytes of a filter's memory with room for some effects, as an expression of C."""
    names = fields_between(*_MEMORY)
    counts = {number: 2, "long long": 0, "void *": 0}  # two: voltage and lost time
    if estimator == "constant-gain":
        names = tuple(name for name in names if name != "imu")
        counts = {number: 3, "long long": 1, "void *": 0}  # near and steady
    for name, field in _fields(np.dtype([(name, FILTER[name]) for name in names])):
        size = int(np.prod(field.shape))
        if name in _ROOMS:
            kind, row = _ROOMS[name]
            size = room[kind] * row
        elif name == "memory":
            size = (room[1] + room[2] + 1) * room[3]
        pointer = name.endswith(("_models", "_hooks"))
        counts["void *" if pointer else "long long" if field.base.kind == "i" else number] += size
    return " + ".join([*(f"{n} * sizeof({t})" for t, n in counts.items()), str(_ALIGNMENT)])


def _fields(dtype: np.dtype[Any]) -> Iterator[tuple[str, np.dtype[Any]]]:
    """Yield the fields of a record and of the records in it."""
    for name in dtype.names or ():
        if dtype[name].names:
            yield from _fields(dtype[name])
        else:
            yield name, dtype[name]


def _one_line(text: str) -> str:
    """Return a text for one line of a C comment, without the comment's end."""
    printable = "".join(c if c.isprintable() else " " for c in text)
    return printable.replace("*/", "* /").replace("\\", "/")
