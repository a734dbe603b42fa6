"""Expressions of Python in C: numbers, arrays and records."""

import ast
import operator
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, cast

from .c_numbers import literal

# operators in C, and their functions of known numbers
_OPERATORS: dict[type[ast.AST], tuple[str, Callable[[Any, Any], Any]]] = {
    ast.Add: ("+", operator.add),
    ast.Sub: ("-", operator.sub),
    ast.Mult: ("*", operator.mul),
    ast.Div: ("/", operator.truediv),
    ast.FloorDiv: ("/", operator.truediv),
    ast.Mod: ("%", operator.mod),
    ast.Lt: ("<", operator.lt),
    ast.LtE: ("<=", operator.le),
    ast.Gt: (">", operator.gt),
    ast.GtE: (">=", operator.ge),
    ast.Eq: ("==", operator.eq),
    ast.NotEq: ("!=", operator.ne),
    **dict.fromkeys((ast.And, ast.BitAnd), ("&&", operator.and_)),
    **dict.fromkeys((ast.Or, ast.BitOr), ("||", operator.or_)),
}
# words of C, possible names in Python
_KEYWORDS = {
    *("auto", "case", "char", "const", "default", "do", "double", "enum", "extern", "goto"),
    *("inline", "long", "register", "restrict", "short", "signed", "sizeof", "static", "struct"),
    *("switch", "typedef", "union", "unsigned", "void", "volatile"),
}


class UntranslatableError(Exception):
    """A function has no translation; the message goes on from its name."""


@dataclass(frozen=True)
class Number:
    """A number in C; ``known`` where an export knows its value."""

    text: str
    kind: str = "float"  # or int, truth
    known: float | None = None

    def as_float(self) -> str:
        """Return the number as a float of C."""
        if self.kind == "float":
            return self.text
        return literal(self.known) if self.known is not None else f"(float){self.text}"


@dataclass(frozen=True)
class Array:
    """An array in C, or a part of it: from ``first`` on."""

    text: str
    shape: tuple[str, ...] = ("",)
    first: str = ""
    root: str = ""  # its parameter or local array; none: a constant
    values: Any = field(default=None, compare=False)  # where an export knows them
    kind: str = "float"

    def at(self, *places: Number) -> "Number | Array":
        """Return an element, or a row."""
        text = self.text
        for place in places:
            here = (
                f"{self.first} + {place.text}" if self.first and text == self.text else place.text
            )
            text += f"[{here}]"
        known = None
        if self.values is not None and all(place.known is not None for place in places):
            known = self.values[tuple(int(cast(float, place.known)) for place in places)]
        rest = self.shape[len(places) :]
        if rest:
            return replace(self, text=text, shape=rest, first="", values=known)
        return Number(text, self.kind, None if known is None else float(known))

    def pointer(self) -> str:
        """Return the array as an argument."""
        return f"{self.text} + {self.first}" if self.first else self.text


@dataclass(frozen=True)
class CRecord:
    """A record: the filter's, or one of its parts."""

    path: tuple[str, ...] = ()


Value = Number | Array | CRecord | tuple["Value", ...]


def constant(value: float) -> Number:
    """Return a number of Python as one of C."""
    kind = "truth" if isinstance(value, bool) else type(value).__name__
    return Number(literal(value) if kind == "float" else str(int(value)), kind, value)


def combined(op: ast.AST, a: Number, b: Number) -> Number:
    """Return an operator's result of two numbers; a known zero removes its term."""
    sign = operator_of(op)
    if sign in ("&&", "||"):
        for one, other in ((a, b), (b, a)):
            if one.known is not None:
                return other if bool(one.known) == (sign == "&&") else one
        if "float" in (a.kind, b.kind):
            raise UntranslatableError(f"takes {a.text} {sign} {b.text} of numbers")
        return Number(f"({a.text} {sign} {b.text})", "truth")
    whole = a.kind == b.kind == "int" and not isinstance(op, ast.Div)
    texts = (a.text, b.text) if whole else (a.as_float(), b.as_float())
    kind = "truth" if isinstance(op, ast.cmpop) else "int" if whole else "float"
    known = None
    if a.known is not None and b.known is not None and not (sign == "/" and b.known == 0):
        known = _OPERATORS[type(op)][1](a.known, b.known)
        known = int(known) if whole and kind == "int" else known
    elif sign == "*" and 0 in (a.known, b.known):
        return constant(0) if whole else constant(0.0)
    elif sign == "+" and a.known == 0:
        return Number(texts[1], kind)
    elif sign in ("+", "-") and b.known == 0:
        return Number(texts[0], kind)
    return Number(f"({texts[0]} {sign} {texts[1]})", kind, known)


def operator_of(node: ast.AST) -> str:
    """Return the same operator in C."""
    if type(node) not in _OPERATORS:
        raise UntranslatableError(f"has an operator {type(node).__name__}")
    return _OPERATORS[type(node)][0]


def c_name(name: str) -> str:
    """Return a name unlike the words of C."""
    return f"{name}_" if name in _KEYWORDS else name
