"""Forms of mappings from files. The fields of a data class state the form, and pydantic checks it.
An error is one line with the file, the field and the expected value.
"""

from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Annotated, Any, TypeVar, cast, get_args, get_type_hints

import numpy as np
from pydantic import (
    BeforeValidator,
    ConfigDict,
    Field,
    PlainValidator,
    TypeAdapter,
    ValidationError,
    WrapValidator,
)

from .arrays import Array
from .errors import InputError, unknown_name

T = TypeVar("T")

LARGEST = 1e12  # in SI units; products of a few larger numbers overflow
# a form's `__pydantic_config__`: unknown keys are refused
STRICT = ConfigDict(extra="forbid", arbitrary_types_allowed=True)

# expected values by pydantic's kinds of errors
_KINDS = {
    "string": "a text",
    "dict": "a mapping",
    "mapping": "a mapping",
    "list": "a list",
    "tuple": "a list",
    "bool": "true or false",
    "int": "a whole number",
    "float": "a number",
}


@cache
def _adapter(form: Any) -> TypeAdapter[Any]:
    return TypeAdapter(form)


def checked(form: type[T], data: object, where: str, sample: str = "") -> T:
    """Return a form filled from a mapping.

    Args:
        form: a data class. A field's annotation may hold ``expected`` and pydantic's constraints;
            with ``STRICT`` as its ``__pydantic_config__`` unknown keys are refused.
        data: as read from a file.
        where: the file, and the section in it, for errors.
        sample: some of the fields, for the error of another value than a mapping.

    Raises:
        InputError: no mapping; an unknown or missing key, or a value of another kind.
    """
    if not isinstance(data, Mapping):
        examples = sample or ", ".join(_names(form))
        raise InputError(
            f"{where}: expected a mapping of fields such as {examples}, got {type(data).__name__}"
        )
    try:
        filled: T = _adapter(cast(Any, form)).validate_python(data)
        return filled
    except ValidationError as error:
        raise _one_line(error, form, data, where) from None


def expected(text: str) -> WrapValidator:
    """Return a validator with the error line for a value refused by the validators before."""

    def check(value: Any, inner: Callable[[Any], Any]) -> Any:
        try:
            return inner(value)
        except (ValidationError, TypeError, ValueError, OverflowError):
            raise ValueError(f"must be {text}, got {value!r}") from None

    return WrapValidator(check)


def _without_bool(value: object) -> object:
    """Return a number, or its text; ``nominal 0.1`` stands for 0.1."""
    if isinstance(value, bool):
        raise ValueError("a truth value")
    return value.removeprefix("nominal").strip() if isinstance(value, str) else value


Number = Annotated[
    float,
    BeforeValidator(_without_bool),
    Field(ge=-LARGEST, le=LARGEST, allow_inf_nan=False),
    expected("a finite number"),
]
Positive = Annotated[Number, Field(gt=0.0), expected("a positive number")]


def numbers(*shape: int) -> PlainValidator:
    """Return a validator of an array of finite numbers of this shape."""

    def check(value: object) -> Array:
        try:
            array = np.array(value, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            array = np.empty(0)
        if array.shape != shape or not np.all(np.abs(array) <= LARGEST):
            size = " x ".join(map(str, shape))
            raise ValueError(f"must be {size} finite numbers, got {value!r}")
        return array

    return PlainValidator(check)


def _one_line(error: ValidationError, form: type, data: Any, where: str) -> InputError:
    """Return the one line for an error: unknown keys come first, then missing ones."""
    problems = error.errors(include_url=False)
    for one in problems:
        if one["type"] in ("unexpected_keyword_argument", "extra_forbidden"):
            *above, key = one["loc"]
            place = ": ".join([where, *_words(above, data)])
            return unknown_name("key", str(key), _names(_form_at(form, above)), place)
    missing = [one for one in problems if one["type"] in ("missing", "missing_argument")]
    if missing:
        section = missing[0]["loc"][:-1]
        names = [str(one["loc"][-1]) for one in missing if one["loc"][:-1] == section]
        place = ": ".join([where, *_words(section, data)])
        return InputError(f"{place}: missing field(s) {', '.join(names)}")
    one = problems[0]
    key = ".".join(_words(one["loc"], data))
    if one["type"] == "dataclass_type":
        known = ", ".join(sorted(_names(_form_at(form, one["loc"]))))
        return InputError(f"{where}: {key} must be a mapping of {known}, got {one['input']!r}")
    if one["type"] == "value_error":
        error_of_field = one["ctx"]["error"]
        if isinstance(error_of_field, InputError):
            return InputError(": ".join([where, *_words(one["loc"], data), str(error_of_field)]))
        words = str(error_of_field)
    elif one["type"] == "literal_error":
        known = one["ctx"]["expected"].replace("'", "")
        words = f"must be {known}, got {one['input']!r}"
    else:
        kind = one["type"].partition("_")[0]
        wanted = (
            f"be {_KINDS[kind]}" if kind in _KINDS else one["msg"].removeprefix("Input should ")
        )
        words = f"must {wanted}, got {one['input']!r}"
    return InputError(": ".join([where, f"{key} {words}".strip()]))


def _words(location: Any, data: Any) -> list[str]:
    """Return the names on the way to a value. An entry of a list has its own name, or else its
    number from 1.
    """
    names = []
    for part in location:
        try:
            data = data[part]
        except (KeyError, IndexError, TypeError):
            data = None
        if isinstance(part, int):
            named = data.get("name") if isinstance(data, Mapping) else None
            names.append(str(named or f"entry {part + 1}"))
        else:
            names.append(str(part))
    return names


def _form_at(form: Any, location: Any) -> Any:
    """Return the form of the section at a location within another."""
    for part in location:
        if isinstance(part, str):
            kind = get_type_hints(form, include_extras=True).get(part)
            form = next((one for one in _parts(kind) if is_dataclass(one)), form)
    return form


def _parts(kind: Any) -> list[Any]:
    return [kind, *(inner for part in get_args(kind) for inner in _parts(part))]


def _names(form: Any) -> list[str]:
    return [field.name for field in fields(form)]
