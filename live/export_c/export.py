"""The wrench filter of one vehicle as a C header and a C99 source, in single or double precision.

Gaps, outliers and restarts are translated from the Python filter (``filter_code``), and effects
from their Python (``effect_code``). Templates hold the other equations, written after the Python.
Every number comes from the Python filter's own record (``estimator.filter_record``), its one place.
``tests/live/test_export_c.py`` holds C and Python together, flight by flight.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from ... import __version__
from ...dynamics.effects import get
from ...dynamics.effects.base import PARAMETERS, ROTORS_SIZE, STATE_SIZE, Effect
from ...dynamics.vehicle import Vehicle
from ...estimator import ConstantGainFilter, Recovery, UKFTuning, WrenchUKF
from ...estimator.error_state import LARGEST_MRP_VARIANCE
from ...estimator.filter_record import AGREEING, N
from ...estimator.hover_covariance import CATCH_UP
from ...estimator.imu import _PATIENCE as IMU_PATIENCE
from ...estimator.recovery import NOISE
from ...estimator.ukf import _STRAINED, default_covariance
from ...runtime.errors import InputError
from . import hover
from .c_numbers import FUNCTIONS, PRECISIONS, in_precision, literal, shape, table
from .c_values import UntranslatableError
from .effect_code import definitions, exportable_effects, library, translate
from .filter_code import constants, fields, filter_code
from .policies import tracker_policy

_FILTERS: dict[str, tuple[type[WrenchUKF], str]] = {
    "constant-gain": (ConstantGainFilter, "The filter with a constant gain"),
    "ukf": (WrenchUKF, "The unscented Kalman filter"),
}
ESTIMATORS = tuple(_FILTERS)
# constants of the Python filters
_KNOWN = {
    "N": N,
    "NOISE": NOISE,
    "AGREEING": AGREEING,
    "PI": math.pi,
    "STRAINED": _STRAINED,
    "LARGEST_MRP_VARIANCE": LARGEST_MRP_VARIANCE,
    "LONGEST_GAP": 0.1,
    "NEAR": 1.1,
    "CATCH_UP": CATCH_UP,
    "IMU_PATIENCE": IMU_PATIENCE,
}
# written files, each from the template of its name
FILES = ("windwrench_filter.h", "windwrench_filter.c", "main.c", "CMakeLists.txt")


@dataclass(frozen=True)
class Exported:
    """An export, not yet written: the texts of the files by their names, and the equivalent Python
    filter.
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
) -> Exported:
    """Return the files of a vehicle's filter in C.

    Args:
        vehicle: the vehicle; its declared effects are part of the filter's model.
        estimator: one of ``ESTIMATORS``.
        rate: poses a second; default: the vehicle's motion capture's.
        rise_time: s, 10-90 %, of the estimated force and torque.
        gate: as of ``WrenchUKF``.
        policy: from ``exportable_policy``, or None.
        command: the command line, for the files' heads.
        precision: one of ``PRECISIONS`` for every number: single (float), or double, for
            processors as fast with double numbers.

    Raises:
        InputError: a setting is out of range, an effect cannot be exported, or single precision
            does not hold a number.
    """
    if estimator not in _FILTERS:
        raise InputError(f"estimator: expected one of {', '.join(ESTIMATORS)}, got {estimator!r}")
    if precision not in PRECISIONS:
        raise InputError(f"precision: expected {' or '.join(PRECISIONS)}, got {precision!r}")
    rate = vehicle.mocap.rate_hz if rate is None else rate
    for name, value in (("rate", rate), ("rise_time", rise_time)):
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(f"{name}: expected a positive number, got {value!r}")
    period = 1.0 / rate
    wrench, rotor_effects, sensing, effect_code = _effects(vehicle)
    tuning = UKFTuning.for_vehicle(vehicle, period, rise_time)
    kind, title = _FILTERS[estimator]
    made = kind(vehicle, tuning, period, gate, Recovery())
    if policy is not None and policy["kind"] == "tracker":
        policy = tracker_policy(vehicle, tuning, period)
    f = made.record[0]
    kept = hover.kept(f)
    context: dict[str, Any] = {
        "version": __version__,
        "command": _one_line(command),
        "title": f"{title}, for the vehicle {_one_line(vehicle.name)}.",
        "estimator": estimator,
        "precision": precision,
        "imu": estimator != "constant-gain",
        "rate": rate,
        "f": f,
        "filter": made,
        "known": _KNOWN,
        "hover": hover,
        "kept": kept,
        "wrench_coefficients": f["wrench_coefficients"][: len(wrench), :PARAMETERS],
        "converged": [f["converged"][i, j] for i, j in kept],
        "first_variance": np.diag(default_covariance(vehicle, tuning)),
        "offset": bool(np.any(f["body"]["com"] != 0.0)),
        "wrench": wrench,
        "rotor_effects": rotor_effects,
        "sensing": sensing,
        "rotor_memory": max((e.memory for e in rotor_effects), default=1) or 1,
        "rotors_size": ROTORS_SIZE,
        "parameters": PARAMETERS,
        "state_size": STATE_SIZE,
        "effect_code": effect_code,
        "policy": policy,
        "voltage": "WW_ROTOR_VOLTAGE]" in effect_code,
    }
    environment = Environment(
        loader=PackageLoader("windwrench.live.export_c", "templates"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # C, no page
    )
    environment.filters |= {"literal": literal, "table": table, "shape": shape}
    # places in arrays named by the template of the motion, beside the effects'
    places = "WW_STEP WW_ROTOR_TIME" + (" WW_ROTOR_ACCELERATION" if wrench else "")
    effects_c = environment.get_template("effects.c.j2").render(context | {"places": places})
    context["places"] = definitions(effects_c)
    context |= {"filter_code": "", "constants": "", "fields": ""}
    source = environment.get_template("windwrench_filter.c.j2").render(context)
    context["filter_code"] = filter_code(f, source)
    source += context["filter_code"]
    called = [name for name in FUNCTIONS if re.search(rf"\b{name}f\(", source)]
    context |= {"constants": constants(f, source), "fields": fields(source)}
    context["functions"] = ", ".join(n if precision == "double" else f"{n}f" for n in called)
    files = {
        name: in_precision(environment.get_template(f"{name}.j2").render(context), precision)
        for name in FILES
    }
    return Exported(files, made, tuple(e.name for e in vehicle.effects), precision)


def _one_line(text: str) -> str:
    """Return a text for one line of a C comment, without the comment's end."""
    kept = "".join(c if c.isprintable() else " " for c in text)
    return kept.replace("*/", "* /").replace("\\", "/")


def _effects(vehicle: Vehicle) -> tuple[list[Effect], list[Effect], list[Effect], str]:
    """Return the effects with a model, wrench, rotor input and sensing, in the filter's order, and
    their code.

    Raises:
        InputError: an effect cannot be exported.
    """
    parts = library()
    models: dict[str, str] = {}
    declared: dict[str, list[Effect]] = {"wrench": [], "rotor input": [], "sensing": []}
    for setting in vehicle.effects:
        effect = get(setting.name)
        if effect.kind == "body":  # its numbers are the vehicle's
            continue
        try:
            code = translate(effect, parts)
        except (UntranslatableError, OSError) as error:
            raise InputError(
                f"{vehicle.name}: effects: {effect.name} cannot be exported: it {error}; declare "
                "the vehicle without it (--effects none: without any), or estimate in Python, where"
                " ukf and constant-gain take every effect. C has "
                f"{', '.join(exportable_effects())}"
            ) from None
        models[effect.name] = code
        declared[effect.kind].append(effect)
    declared["wrench"].sort(key=lambda effect: not effect.sets_wind)
    code = "\n".join([*([parts.code()] if parts.done else []), *models.values()])
    return declared["wrench"], declared["rotor input"], declared["sensing"], code
