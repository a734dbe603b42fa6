"""The wrench filter's own functions as C, with their constants and fields."""

import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from ...dynamics.motion import rotor_wrench
from ...dynamics.rotation import attitude_error, normalise
from ...estimator.bias_states import bound_biases
from ...estimator.error_state import bound_variance, displace, error_from, fold
from ...estimator.filter_record import FILTER, IMU, N, fields_between, propagate
from ...estimator.hover_covariance import heading, turn_vectors, turn_world
from ...estimator.imu import _believed, expected_imu
from ...estimator.linear_model import model_jacobian
from ...estimator.model_uncertainty import follow_loads
from ...estimator.recovery import (
    MEMORY,
    after_prediction,
    believable,
    doubted_variance,
    grow_older,
    learn_noise,
    likeliest_scale,
    pose_noise,
    remember,
)
from ...estimator.ukf import innovate
from .c_numbers import literal, shape, table
from .c_values import Array, CRecord, Value
from .translate import Library

# functions for templates, and their known arguments; each brings along the functions it calls
_CALLED: dict[Any, tuple[Value | None, ...]] = {
    rotor_wrench: (CRecord(("body",)), None, None),
    **dict.fromkeys((attitude_error, normalise, propagate, expected_imu), ()),
    **dict.fromkeys((displace, error_from, fold), ()),
    **dict.fromkeys((after_prediction, believable, remember, grow_older, doubted_variance), ()),
    **dict.fromkeys((learn_noise, likeliest_scale, pose_noise), ()),
    **dict.fromkeys((innovate, bound_biases, heading, turn_vectors, turn_world), ()),
    bound_variance: (Array("", ("WW_STATES", "WW_STATES"), root="matrix"), None, None),
    model_jacobian: (None, None, Array("", ("12", str(N)), root="matrix"), None),
    follow_loads: (None, Array("", ("3", "3"), root="matrix"), None),
    _believed: (None, Array("", ("6", "6"), root="matrix"), None, None, None),
}
# steps of difference quotients, large enough for single precision
_STEPS = {"EFFECT_TURN": 4e-3, "EFFECT_STEP": 1e-2}
_BY_HAND = {"_nis", "_is_push", "restore_bias_prior"}  # functions in templates, called from here
# fields of the filter's record with changes in flight: types by names in C
_KEPT = {
    **{f"poses_{name}": MEMORY[name] for name in MEMORY.names or ()},
    **{name: FILTER[name] for name in ("rotors", "rotor_wrench", "effect_wrench")},
    **{name: FILTER[name] for name in fields_between("x", "last_speeds")},
    **{name: FILTER[name] for name in fields_between("z", "innovation")},
    **{name: FILTER[name] for name in fields_between("acceleration", "rows")},
}
# fields declared in templates
_OF_IMU = {
    f"imu_{name}": IMU[name] for name in ("used", "known", "refused", "in_row", "doubt", "mean")
}


def filter_code(record: np.void, source: str) -> str:
    """Return a filter's functions called in C code, with branches decided by its record."""
    memory = {
        name: ("int" if kind.base.kind == "i" else "float", tuple(map(str, kind.shape)))
        for name, kind in (_KEPT | _OF_IMU).items()
    }
    by_hand = set(_BY_HAND)
    if record["steady"]:  # without a covariance at hand
        by_hand.add("wrench_variance")
    if record["wrench_count"]:
        by_hand.add("apply_effects")
    else:
        del memory["effect_wrench"]  # zeros
    library = Library(constants=record, memory=memory, by_hand=by_hand, numbers=_STEPS)
    for function, known in _CALLED.items():
        if re.search(rf"\b{function.__name__.lstrip('_')}\(", source):
            library.get(function, known)
    return library.code()


def fields(code: str) -> str:
    """Return declarations for the fields of ``ww_filter`` in C code."""
    return "\n".join(
        f"    float {name}{''.join(f'[{n}]' for n in kind.shape)};"
        for name, kind in _KEPT.items()
        if name != "P" and re.search(rf"\bf->{name}\b", code)
    )


def constants(record: Any, code: str) -> str:
    """Return definitions for the fields of a filter's record in C code."""
    lines = []
    for name, value in _numbers(record, ""):
        word = f"ww_{name}" if value.shape else f"WW_{name.upper()}"
        if f"#define {word} " in code or f"const float {word}[" in code:
            continue  # defined in a template, in another shape
        if re.search(rf"\b{word}\b", code):
            lines.append(
                f"static const float {word}{shape(value)} = {table(value, name)};"
                if value.shape
                else f"#define {word} {literal(float(value), name)}"
            )
    return "\n".join(lines)


def _numbers(record: Any, before: str) -> Iterator[tuple[str, Any]]:
    for name in record.dtype.names:
        if record[name].dtype.names:
            yield from _numbers(record[name], f"{before}{name}_")
        else:
            yield f"{before}{name}", record[name]
