"""Expressions of a compiled Python function as C: numbers, parts of arrays, fields of records."""

import ast
import math
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, cast

from ...dynamics.effects import base
from .c_values import Array, Fields, Number, UntranslatableError, Value, combined, constant

TYPES = {"float": "float", "int": "int", "truth": "int"}


@dataclass
class Known:
    """What is known of the names and fields in an expression."""

    constants: Any = None  # the filter's record, whose fields are constants but for those below
    # fields that ``ww_filter`` has: int or float, and their shapes
    memory: Mapping[str, tuple[str, tuple[str, ...]]] = field(default_factory=dict)
    numbers: Mapping[str, float] = field(default_factory=dict)  # constants that are others in C
    counter: int = 0  # of names

    def field_of(self, path: tuple[str, ...]) -> Value:
        """Return a field of the filter's record."""
        name = "_".join(path)
        if name == "P":
            return Array("P", ("WW_STATES", "WW_STATES"), root="P")
        if name in self.memory:
            kind, shape = self.memory[name]
            if shape:
                return Array(f"f->{name}", shape, root="f", kind=kind)
            return Number(f"f->{name}", kind)
        value = self.constants
        for part in path:
            value = value[part]
        if getattr(value, "dtype", None) is not None and value.dtype.names:
            return Fields(path)
        if value.shape:
            return Array(f"ww_{name}", tuple(map(str, value.shape)), values=value)
        return replace(constant(value.item()), text=f"WW_{name.upper()}")


class Expressions(ABC):
    """Expressions in one function, whose lines so far they may add to."""

    library: Known
    globals: Mapping[str, Any]  # of the function's file

    def __init__(self) -> None:
        self.names: dict[str, Value] = {}
        self.lines: list[str] = []

    @abstractmethod
    def called(self, node: ast.Call) -> Value:
        """Return the result of a call."""

    def number(self, node: ast.expr) -> Number:
        """Return an expression that is a number."""
        value = self.evaluated(node)
        if not isinstance(value, Number):
            raise UntranslatableError(f"has an expression {type(node).__name__}")
        return value

    def evaluated(self, node: ast.expr) -> Value:
        """Return an expression: a number, or the name of an array or record."""
        match node:
            case ast.Constant(value=bool() | int() | float() as plain):
                return constant(plain)
            case ast.Name(id=name):
                return self.name_of(name)
            case ast.Attribute(value=ast.Name(id="math"), attr=name):
                return Number("NAN") if name == "nan" else constant(getattr(math, name))
            case ast.Attribute(value=of, attr=name):
                record = self.evaluated(of)
                if not isinstance(record, Fields):
                    raise UntranslatableError(f"has an attribute {name}")
                return self.library.field_of((*record.path, name))
            case ast.Subscript(value=of, slice=place):
                return self.element(of, place)
            case ast.Tuple(elts=elements):
                found_all: list[Value] = []
                for one in elements:
                    starred = isinstance(one, ast.Starred)
                    part = self.evaluated(one.value if isinstance(one, ast.Starred) else one)
                    found_all += cast(tuple[Value, ...], part) if starred else (part,)
                return tuple(found_all)
            case ast.BinOp(left=left, op=ast.Pow(), right=exponent):
                return self.power(self.number(left).as_float(), exponent)
            case ast.BinOp(left=left, op=op, right=right):
                return combined(op, self.number(left), self.number(right))
            case ast.UnaryOp(op=ast.USub() | ast.Not() as op, operand=operand):
                value = self.number(operand)
                negative = isinstance(op, ast.USub)
                known = value.known
                if known is not None:
                    known = -known if negative else not known
                kind = value.kind if negative else "truth"
                return Number(f"({'-' if negative else '!'}{value.text})", kind, known)
            case ast.Compare(left=left, ops=[op], comparators=[right]):
                return combined(op, self.number(left), self.number(right))
            case ast.BoolOp(op=op, values=values):
                result = self.number(values[0])
                for one in values[1:]:
                    result = combined(op, result, self.number(one))
                return result
            case ast.IfExp(test=test, body=body, orelse=orelse):
                return self.choice(test, body, orelse)
            case ast.Call():
                return self.called(node)
        raise UntranslatableError(f"has an expression {type(node).__name__}")

    def choice(self, test: ast.expr, body: ast.expr, orelse: ast.expr) -> Value:
        """Return one of two expressions."""
        condition = self.number(test)
        if condition.known is not None:
            return self.evaluated(body if condition.known else orelse)
        yes, no = self.number(body), self.number(orelse)
        if yes.kind == no.kind:
            return Number(f"({condition.text} ? {yes.text} : {no.text})", yes.kind)
        return Number(f"({condition.text} ? {yes.as_float()} : {no.as_float()})")

    def element(self, of: ast.expr, place: ast.expr) -> Value:
        """Return a part of an array or of several numbers."""
        array = self.evaluated(of)
        if isinstance(array, tuple):
            return array[int(cast(float, self.number(place).known))]
        if not isinstance(array, Array):
            raise UntranslatableError("takes a part of a number")
        match place:
            case ast.Slice(lower=lower, step=None):
                first = self.number(lower).text if lower is not None else "0"
                return replace(array, first=f"{array.first} + {first}" if array.first else first)
            case ast.Tuple(elts=places):
                return array.at(*(self.number(one) for one in places))
        return array.at(self.number(place))

    def power(self, base: str, exponent: ast.expr) -> Number:
        """Return a number raised to any power; a small whole one is written out."""
        match exponent:
            case ast.Constant(value=int() as times) if 2 <= times <= 4:
                return Number(f"({' * '.join([base] * times)})")
        return Number(f"powf({base}, {self.number(exponent).as_float()})")

    def name_of(self, name: str) -> Value:
        """Return what a name is: a parameter, a variable, or a constant of the file."""
        if name in self.names:
            return self.names[name]
        value = self.library.numbers.get(name, self.globals.get(name))
        if isinstance(value, int) and getattr(base, name, None) == value:
            return Number(f"WW_{name}", "int", value)
        if isinstance(value, bool | int | float):
            return constant(value)
        raise UntranslatableError(
            f"looks up a table ({name}); the C has an effect's coefficients alone"
        )

    def kept(self, value: Value) -> Value:
        """Return a number as one that is worked out only once."""
        if not isinstance(value, Number) or re.fullmatch(r"[\w.>\[\]-]+", value.text):
            return value
        t = self.temporary()
        self.lines.append(f"const {TYPES[value.kind]} {t} = {value.text};")
        return replace(value, text=t)

    def converted(self, value: Number, kind: str) -> str:
        """Return a number as one of a kind."""
        if kind == "float":
            return value.as_float()
        if value.kind == "float":
            raise UntranslatableError(f"makes a whole number of {value.text}")
        return value.text

    def temporary(self) -> str:
        """Return the name of a new array."""
        self.library.counter += 1
        return f"t{self.library.counter}"

    def floats(self, given: list[ast.expr]) -> str:
        """Return arguments that are numbers."""
        return ", ".join(self.number(one).as_float() for one in given)
