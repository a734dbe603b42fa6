"""The equations of declared effects as C, translated from Python, the only place of each equation.

An effect model is plain arithmetic on four arrays (``dynamics.effects.base``), with functions of
``dynamics.effects.parts``. An effect refused by ``translate`` is in no export.
"""

from contextlib import suppress

from ...dynamics.effects import base, get, names, parts
from ...dynamics.effects.base import Effect
from .c_values import UntranslatableError
from .translate import Function, Library


def library() -> Library:
    """Return the library of effect models."""
    why = "looks back among earlier samples, which the C does not keep"
    return Library(refused={parts.delay: why}, prefix="ww_")


def translate(effect: Effect, parts: Library) -> str:
    """Return an effect's model as a C function ``effect_NAME``; add its callees to ``parts``.

    Raises:
        UntranslatableError: the model has no translation.
    """
    if effect.kind == "sensing" and effect.memory:
        raise UntranslatableError(
            "looks back among earlier measurements, which the C does not keep"
        )
    if effect.advance is not None:
        raise UntranslatableError("has a motion of its own, which the C does not carry on")
    if effect.model is None:
        raise UntranslatableError("has no model")
    made = Function(effect.model, parts, f"effect_{effect.name}")
    made.translate()
    return made.code()


def definitions(code: str) -> str:
    """Return definitions for the names of ``dynamics.effects.base`` in C code."""
    used = {
        name: value
        for name, value in vars(base).items()
        if name.isupper() and isinstance(value, int) and f"WW_{name}" in code
    }
    return "\n".join(f"#define WW_{name} {value}" for name, value in used.items())


def exportable_effects() -> list[str]:
    """Return the names of all exportable effects."""
    exportable = []
    for name in names():
        with suppress(UntranslatableError):
            if get(name).kind != "body":  # its numbers are the vehicle's
                translate(get(name), library())
            exportable.append(name)
    return exportable
