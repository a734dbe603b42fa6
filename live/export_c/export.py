"""The wrench filter of one vehicle as a C header and a C99 source, in single or double precision.

Templates hold the equations, written after the Python filter; every number comes from the Python
filter's own record (``estimator.filter_record``), so there is one place for each. Effects are
translated from their Python. ``tests/live/test_export_c.py`` holds C and Python together, flight by
flight.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from ... import __version__
from ...dynamics.effects import get
from ...dynamics.effects.base import PARAMETERS, ROTORS_SIZE, STATE_SIZE, Effect
from ...dynamics.motion import LONG_TURN
from ...dynamics.vehicle import Vehicle
from ...estimator import ConstantGainFilter, Recovery, UKFTuning, WrenchEKF, WrenchUKF
from ...estimator.constant_gain import _LONGEST_GAP, _NEAR
from ...estimator.error_state import LARGEST_MRP_VARIANCE
from ...estimator.filter_record import AGREEING, N
from ...estimator.hover_covariance import CATCH_UP
from ...estimator.imu import _PATIENCE as IMU_PATIENCE
from ...estimator.recovery import AGREEING as AGREEING_POSES
from ...estimator.recovery import NOISE
from ...estimator.ukf import default_covariance
from ...runtime.errors import InputError
from . import hover
from .c_numbers import literal, table
from .effect_code import (
    UntranslatableError,
    definitions,
    exportable_effects,
    translate,
)
from .precision import FUNCTIONS, PRECISIONS, in_precision
from .tracker import tracker_policy

FILTERS: dict[str, type[WrenchUKF]] = {
    "constant-gain": ConstantGainFilter,
    "ekf": WrenchEKF,
    "ukf": WrenchUKF,
}
ESTIMATORS = tuple(FILTERS)
_TITLES = {
    "constant-gain": "The filter with a constant gain",
    "ekf": "The extended Kalman filter",
    "ukf": "The unscented Kalman filter",
}
# templates of what libm has too, and how each is called; those that call others first
_FUNCTIONS = (
    ("power", "ww_power("),
    ("logarithm", "ww_log("),
    ("exponential", "ww_exp("),
    ("arctangent", "ww_atan2("),
)
# the file that is written, and its template
FILES = {
    "windwrench_filter.h": "windwrench_filter.h.j2",
    "windwrench_filter.c": "windwrench_filter.c.j2",
    "main.c": "main.c.j2",
    "CMakeLists.txt": "CMakeLists.txt.j2",
}


@dataclass(frozen=True)
class Exported:
    """What an export wrote, before it is written: the texts of the files by their names, and the
    Python filter that the C does the same as.
    """

    files: Mapping[str, str]
    filter: WrenchUKF
    effects: tuple[str, ...]
    precision: str = "single"


def export_c(
    vehicle: Vehicle,
    estimator: str = "ekf",
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
        rate: poses a second; default that of the vehicle's motion capture.
        rise_time: s, 10-90 %, of the estimated force and torque.
        gate: as of ``WrenchUKF``.
        policy: of ``exportable_policy``, or None.
        command: the command line that asked for it, for the files' heads.
        precision: one of ``PRECISIONS``, of every number in it: single (float), or double, for
            processors that calculate with double numbers as fast.

    Raises:
        InputError: a setting is out of range, an effect cannot be exported, or single precision
            does not hold a number.
    """
    if estimator not in FILTERS:
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
    made = FILTERS[estimator](vehicle, tuning, period, gate, Recovery())
    if policy is not None and policy["kind"] == "tracker":
        policy = tracker_policy(vehicle, tuning, period)
    imu = estimator != "constant-gain"
    offset = bool(np.any(made.record[0]["body"]["com"] != 0.0))
    context: dict[str, Any] = {
        "version": __version__,
        "command": _one_line(command),
        "title": f"{_TITLES[estimator]}, for the vehicle {_one_line(vehicle.name)}.",
        "estimator": estimator,
        "precision": precision,
        "functions": ", ".join(f if precision == "double" else f"{f}f" for f in FUNCTIONS),
        "imu": imu,
        "gated": gate is not None,
        "gate": 0.0 if gate is None else gate,
        "patience": f"{made.recovery.patience:g}",
        "rate": rate,
        "period": literal(period),
        "mass": literal(float(made.record[0]["body"]["mass"])),
        "kept": len(hover.kept(made.record[0])),
        "hover_speed": literal(float(made.record[0]["last_speeds"][0])),
        "agreeing": AGREEING,
        "agreeing_poses": AGREEING_POSES,
        "offset": offset,
        "pairs": 12 if wrench else 6,
        "bent": 12 if wrench else 6 if offset else 3,
        "wrench": wrench,
        "rotor_effects": rotor_effects,
        "sensing": sensing,
        "rotor_memory": max((e.memory for e in rotor_effects), default=1) or 1,
        "rotors_size": ROTORS_SIZE,
        "parameters": PARAMETERS,
        "state_size": STATE_SIZE,
        "effect_code": effect_code,
        "policy": policy,
        "uses_exp": "ww_exp(" in effect_code,
        "uses_log": "ww_log(" in effect_code,
        "voltage": "WW_ROTOR_VOLTAGE]" in effect_code,
    }
    context["uses_smaller"] = "smaller(" in effect_code or policy is not None
    context["constants"] = _constants(made, estimator, context)
    environment = Environment(
        loader=PackageLoader("windwrench.live.export_c", "templates"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # C, no page
    )
    files = {
        name: in_precision(environment.get_template(source).render(context), precision)
        for name, source in FILES.items()
    }
    return Exported(files, made, tuple(e.name for e in vehicle.effects), precision)


def _one_line(text: str) -> str:
    """Return a text that stands in a C comment on one line and does not end it."""
    kept = "".join(c if c.isprintable() else " " for c in text)
    return kept.replace("*/", "* /").replace("\\", "/")


def _effects(vehicle: Vehicle) -> tuple[list[Effect], list[Effect], list[Effect], str]:
    """Return the effects that have a model, wrench, rotor input and sensing, in the filter's order,
    and their code.

    Raises:
        InputError: one cannot be exported.
    """
    needed: dict[str, str] = {}
    models: dict[str, str] = {}
    found: dict[str, list[Effect]] = {"wrench": [], "rotor input": [], "sensing": []}
    for setting in vehicle.effects:
        effect = get(setting.name)
        if effect.kind == "body":  # its numbers are the vehicle's
            continue
        try:
            code = translate(effect, needed)
        except (UntranslatableError, OSError) as error:
            raise InputError(
                f"{vehicle.name}: effects: {effect.name} cannot be exported: it {error}; declare "
                "the vehicle without it (--effects none: without any), or estimate in Python, where"
                " ekf, ukf and constant-gain take every effect. C has "
                f"{', '.join(exportable_effects())}"
            ) from None
        models[effect.name] = code
        found[effect.kind].append(effect)
    found["wrench"].sort(key=lambda effect: not effect.sets_wind)
    code = "\n".join([*needed.values(), *models.values()])
    if not code:
        return [], [], [], ""
    functions: list[str] = []
    for name, called in _FUNCTIONS:  # a function stands before what calls it
        if any(called in other for other in (code, *functions)):
            file = Path(__file__).parent / "templates" / f"{name}.c.j2"
            functions.insert(0, file.read_text(encoding="utf-8"))
    # what the template of the effects names
    always = "WW_STEP WW_ROTOR_TIME "
    if found["wrench"]:
        always += (
            "WW_POSITION WW_VELOCITY WW_RATE WW_WIND WW_ROTATION WW_ROTOR_SPEED WW_ROTOR_THRUST "
            "WW_TIME WW_ROTOR_ACCELERATION"
        )
    if found["sensing"]:
        always += (
            " WW_SAMPLE_SIZE WW_SAMPLE_POSITION WW_SAMPLE_QUATERNION WW_DIRECTION WW_HAS_POSITION "
            "WW_HAS_QUATERNION"
        )
    return (
        found["wrench"],
        found["rotor input"],
        found["sensing"],
        "\n".join([definitions(always + code) + "\n", *functions, code]),
    )


def _constants(made: WrenchUKF, estimator: str, context: Mapping[str, Any]) -> list[str]:
    """Return the lines of C that define all numbers of a filter."""
    f = made.record[0]
    body = f["body"]
    lines: list[str] = []

    def define(name: str, value: float, meaning: str) -> None:
        lines.append(f"#define WW_{name} {literal(value, name)} /* {meaning} */")

    def array(name: str, values: Any, meaning: str) -> None:
        shape = "".join(f"[{n}]" for n in np.shape(values))
        lines.append(
            f"static const float ww_{name}{shape} = {table(values, name)}; /* {meaning} */"
        )

    def entries(name: str, values: list[hover.Entry], meaning: str) -> None:
        lines.append(f"#define WW_{name.upper()} {len(values)}")
        rows = ", ".join(f"{{{e[0]}, {e[1]}, {e[2]}, {literal(e[3], name)}}}" for e in values)
        lines.append(f"static const ww_entry ww_{name}[] = {{{rows}}}; /* {meaning} */")

    define("PERIOD", made.period, "s, that the noise is stated for")
    define("MASS", body["mass"], "kg")
    define("GRAVITY", body["gravity"], "m/s2")
    define("HOVER_SPEED", f["last_speeds"][0], "rad/s")
    array("inertia", body["inertia"], "kg m2, about the centre of mass")
    array("inverse_inertia", body["inverse_inertia"], "1/(kg m2)")
    array("mixing", body["mixing"], "squared rotor speeds to thrust (N) and torques (Nm)")
    if context["offset"]:
        array("com", body["com"], "m, centre of mass from the geometric centre")
    if context["wrench"] or context["rotor_effects"] or context["sensing"]:
        array("effect_vehicle", f["constants"], "what effects may know of the vehicle")
    if context["wrench"]:
        array("thrust_k", body["k"], "N/(rad/s)^2")
        rows = f["wrench_coefficients"][: len(context["wrench"]), :PARAMETERS]
        array("wrench_coefficients", rows, "of the effects, one a row")
    if context["rotor_effects"]:
        rows = f["rotor_coefficients"][: len(context["rotor_effects"])]
        array("rotor_coefficients", rows, "of the effects on the rotors, one a row")
    if context["sensing"]:
        rows = f["sensing_coefficients"][: len(context["sensing"])]
        array("sensing_coefficients", rows, "of the effects on what is measured, one a row")
    define("LONG_TURN", LONG_TURN, "rad a step, beyond which the body turns exactly")
    define("PI", math.pi, "")
    lines[-1] = lines[-1].replace(" /*  */", "")
    if estimator != "constant-gain":
        array("motor_torque_std", np.sqrt(f["motor_torque"]), "Nm, body, new each period")
        array("thrust_std", np.sqrt(f["thrust"]), "N, body, new each period")
        array("torque_walk", f["torque_walk"], "variance a period, world")
        array("force_walk", f["force_walk"], "variance a period, world")
    array("noise", f["noise"], "variance of a measured pose: MRP, position")
    define("LARGEST_MRP_VARIANCE", LARGEST_MRP_VARIANCE, "an attitude cannot be less known")
    array("prior", f["prior"][::3], "variances of what nothing is known of, three rows each")
    array("lost", f["lost"][::3], "variances beyond which what is not measured is given up")
    array("reason", f["reason"][::3], "squares of torque and force beyond which none is believed")
    array("push", f["push"], "rad/s2 and m/s2 of the hardest push")
    define("RESPONSE", f["response"], "s in which the filter follows a push")
    define("PATIENCE", f["patience"], "s")
    define("ALARM_THREE", f["alarm"][0], "largest NIS that is taken in unseen, of three numbers")
    define("ALARM_SIX", f["alarm"][1], "and of six")
    define("RESTART_AT", f["restart_at"], "NIS beyond which no linear correction is made")
    kappa = float(f["kappa"])
    if estimator == "ukf":
        define("SPREAD", math.sqrt(N + NOISE + kappa), "how far out sigma points lie")
        define("WEIGHT", 0.5 / (N + NOISE + kappa), "of a sigma point")
    if estimator == "constant-gain":
        define("LONGEST_GAP", _LONGEST_GAP, "s that the constant gain coasts over")
        define("NEAR", _NEAR, "of the converged variances: nearly converged again")
        define("SETTLE", f["settle"], "s for which they must have been")
        define("CATCH_UP", CATCH_UP, "predictions, at most, that make up for a gap")
        entries("couplings", hover.couplings(f), "derivatives of the accelerations at hover")
        entries("noises", hover.noises(f), "variances that time adds; lower half")
        kept = hover.kept(f)
        rows = ", ".join(f"{{{i}, {j}}}" for i, j in kept)
        lines.append(
            f"static const unsigned char ww_kept[WW_KEPT][2] = {{{rows}}};"
            " /* rows and columns of covariances that are not always zero, the diagonal first */"
        )
        array(
            "converged",
            [f["converged"][i, j] for i, j in kept],
            "those after a correction, facing along x",
        )
    else:
        first = np.diag(default_covariance(made.vehicle, made.tuning))
        array("first_variance", first, "after ww_init")
        define("IMU_SPREAD", math.sqrt(N + kappa), "of sigma points of an inertial measurement")
        define("IMU_WEIGHT", 0.5 / (N + kappa), "of one of them")
        imu = f["imu"]
        array("imu_noise", f["imu_noise"], "variances of gyro and accelerometer")
        array("bias_prior", imu["prior"], "variances of their biases at first")
        array("bias_walk", imu["walk"], "and what is added to them in a period")
        define("IMU_GATE_THREE", imu["gate"][0], "largest NIS of one sensor")
        define("IMU_GATE_SIX", imu["gate"][1], "of both")
        define("IMU_GATE_AGREE", imu["gate"][2], "of samples that agree")
        define("IMU_PATIENCE", IMU_PATIENCE, "s of refusals that a bias is believed")
    return lines
