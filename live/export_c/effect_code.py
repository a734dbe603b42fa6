"""The equations of declared effects as C, translated from their Python, which stays the only place
where they are written.

An effect model is plain arithmetic on four arrays (``dynamics.effects.base``). What is translated
is that: assignments, ``for`` over a ``range``, ``if``, arithmetic, ``math.sqrt``, ``sin``, ``cos``
and ``exp``, ``min``, ``max``, and calls of functions of ``dynamics.effects.parts`` that are the
same. Everything else is refused, and with it the effect.
"""

import ast
import inspect
import textwrap
from collections.abc import Callable
from contextlib import suppress
from typing import Any, cast

from ...dynamics.effects import base, get, names, parts
from ...dynamics.effects.base import Effect
from .c_numbers import literal

_OPERATORS: dict[type[ast.AST], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
    ast.And: "&&",
    ast.Or: "||",
}
_MATHS = {
    "sqrt": "sqrtf",
    "sin": "sinf",
    "cos": "cosf",
    "exp": "ww_exp",
    "fabs": "fabsf",
    "atan2": "ww_atan2",
}
# words of C that may be names in Python
_KEYWORDS = {
    *("auto", "case", "char", "const", "default", "do", "double", "enum", "extern", "goto"),
    *("inline", "long", "register", "restrict", "short", "signed", "sizeof", "static", "struct"),
    *("switch", "typedef", "union", "unsigned", "void", "volatile"),
}


class UntranslatableError(Exception):
    """An effect does something that is not translated; the message goes on from its name."""


class _Function:
    """One Python function on its way to C."""

    def __init__(self, function: Callable[..., Any], name: str, needed: dict[str, str]) -> None:
        self.name, self.needed = name, needed
        self.globals = function.__globals__
        self.tree = _tree_of(function)
        self.integers: set[str] = set()
        self.places: dict[str, str] = {}  # short names of places in an array
        self.counter = 0
        parameters = self.tree.args.args
        self.floats = [a.arg for a in parameters if _is_float(a.annotation)]
        self.arrays = [a.arg for a in parameters if a.arg not in self.floats]
        self.returned = 0

    def code(self) -> str:
        """Return the C function."""
        body = [line for statement in self.tree.body for line in self.statement(statement)]
        stored = _stored(self.tree) | self._written_by_calls()
        parameters = [
            f"{'' if name in stored else 'const '}float *{name}"
            if name in self.arrays
            else f"float {name}"
            for name in (a.arg for a in self.tree.args.args)
        ]
        if self.returned:
            parameters.append("float *out")
        names = [node for node in ast.walk(self.tree) if isinstance(node, ast.Name)]
        used = {node.id for node in names}
        if taken := sorted(used & _KEYWORDS):
            raise UntranslatableError(f"has a variable {taken[0]}, which is a word of C")
        assigned = {node.id for node in names if isinstance(node.ctx, ast.Store)}
        local = sorted(assigned - self.integers - {*self.floats, "_"})
        head = [f"float {', '.join(f'{name} = 0.0f' for name in local)};"] if local else []
        head += [f"(void){name};" for name in self.arrays if name not in used]
        lines = [f"static void {self.name}({', '.join(parameters)})", "{"]
        lines += [f"    {line}" for line in (*head, *body)]
        return "\n".join([*lines, "}"]) + "\n"

    def _written_by_calls(self) -> set[str]:
        """Return the arrays that are given to a function of ``parts`` that writes into them."""
        written = set()
        for node in ast.walk(self.tree):
            match node:
                case ast.Call(func=ast.Name(id=name)) if hasattr(parts, name):
                    part = _tree_of(getattr(parts, name).py_func)
                    stores = _stored(part)
                    for parameter, argument in zip(part.args.args, node.args, strict=True):
                        if parameter.arg in stores and isinstance(argument, ast.Name):
                            written.add(argument.id)
        return written

    def statement(self, node: ast.stmt) -> list[str]:
        """Return the lines of C of a statement."""
        match node:
            case ast.Expr(value=ast.Constant()):  # a docstring
                return []
            case ast.Assign(targets=[target], value=value):
                return self.assignment(target, value)
            case ast.AugAssign(target=target, op=op, value=value):
                before, text = self.value(value)
                return [*before, f"{self.expression(target)} {_operator(op)}= {text};"]
            case ast.For(target=ast.Name(id=i), iter=over, body=body):
                first, end = self.bounds(over)
                self.integers.add(i)
                head = f"for (int {i} = {first}; {i} < {end}; {i}++) {{"
                return [head, *self.block(body), "}"]
            case ast.If(test=test, body=body, orelse=orelse):
                lines = [f"if ({self.expression(test)}) {{", *self.block(body)]
                return [*lines, *(["} else {", *self.block(orelse)] if orelse else []), "}"]
            case ast.Return(value=None):
                return ["return;"]
            case ast.Return(value=ast.Tuple(elts=values)):
                self.returned = len(values)
                return [f"out[{i}] = {self.expression(value)};" for i, value in enumerate(values)]
            case ast.Expr(value=ast.Call() as call):
                return [f"{self.part_call(call, None)};"]
        raise UntranslatableError(f"has a statement {type(node).__name__}")

    def block(self, body: list[ast.stmt]) -> list[str]:
        """Return the indented lines of several statements."""
        return [f"    {line}" for statement in body for line in self.statement(statement)]

    def assignment(self, target: ast.expr, value: ast.expr) -> list[str]:
        """Return the lines of an assignment to one target, or to several at once."""
        match target, value:
            case ast.Tuple(elts=targets), ast.Tuple(elts=values):
                pairs = [
                    pair
                    for pair in zip(targets, values, strict=True)
                    if not self.names_a_place(*pair)
                ]
                t = self.array_name()
                given = ", ".join(self.expression(one) for _, one in pairs)
                lines, targets = [f"const float {t}[] = {{{given}}};"], [one for one, _ in pairs]
            case ast.Tuple(elts=targets), _:
                t = self.array_name()
                lines = [f"float {t}[{len(targets)}];", f"{self.part_call(value, t)};"]
            case _ if self.names_a_place(target, value):
                return []
            case _:
                before, text = self.value(value)
                return [*before, f"{self.expression(target)} = {text};"]
        return lines + [
            f"{self.expression(one)} = {t}[{i}];"
            for i, one in enumerate(targets)
            if not (isinstance(one, ast.Name) and one.id == "_")
        ]

    def array_name(self) -> str:
        """Return the name of a new array."""
        self.counter += 1
        return f"t{self.counter}"

    def names_a_place(self, target: ast.expr, value: ast.expr) -> bool:
        """Return whether an assignment gives a place in an array a short name; keep it."""
        match target, value:
            case ast.Name(id=short), ast.Name(id=name) if self.is_place(name):
                self.integers.add(short)
                self.places[short] = f"WW_{name}"
                return True
        return False

    def is_place(self, name: str) -> bool:
        """Return whether a name is that of a place in an array, of ``dynamics.effects.base``."""
        place = self.globals.get(name)
        return isinstance(place, int) and getattr(base, name, None) == place

    def value(self, node: ast.expr) -> tuple[list[str], str]:
        """Return the lines that come before an expression, and the expression."""
        match node:
            case ast.Subscript(value=ast.Call() as call, slice=ast.Constant(value=element)):
                t = self.array_name()
                return [f"float {t}[3];", f"{self.part_call(call, t)};"], f"{t}[{element!r}]"
        return [], self.expression(node)

    def part_call(self, node: ast.expr, out: str | None) -> str:
        """Return the call of a function of ``parts``, which is translated too."""
        match node:
            case ast.Call(func=ast.Name(id=name), args=given):
                part = getattr(parts, name, None)
            case _:
                raise UntranslatableError(f"has an expression {type(node).__name__}")
        if part is parts.delay:
            raise UntranslatableError("looks back among earlier samples, which the C does not keep")
        if part is None or not hasattr(part, "py_func"):
            raise UntranslatableError(f"calls the function {name}, which the C has not")
        if name not in self.needed:
            self.needed[name] = ""  # its place; calls do not go round in a circle
            self.needed[name] = _Function(part.py_func, f"ww_{name}", self.needed).code()
        arguments = [self.expression(a) for a in given] + ([out] if out else [])
        return f"ww_{name}({', '.join(arguments)})"

    def bounds(self, node: ast.expr) -> tuple[str, str]:
        """Return first and last of a range."""
        match node:
            case ast.Call(func=ast.Name(id="range"), args=[end]):
                return "0", self.expression(end, integer=True)
            case ast.Call(func=ast.Name(id="range"), args=[first, end]):
                return self.expression(first, integer=True), self.expression(end, integer=True)
        raise UntranslatableError("loops over something else than a range")

    def expression(self, node: ast.expr, integer: bool = False) -> str:
        """Return an expression; ``integer`` where it is an index."""
        match node:
            case ast.Constant(value=int() | float() as value):
                return str(value) if integer else literal(value)
            case ast.Name(id=name):
                return self.name_of(name, integer)
            case ast.BinOp(left=left, op=ast.Pow(), right=exponent):
                return self.power(self.expression(left), exponent)
            case ast.BinOp(left=left, op=op, right=right):
                operands = self.expression(left, integer), self.expression(right, integer)
                return f"({operands[0]} {_operator(op)} {operands[1]})"
            case ast.UnaryOp(op=ast.USub() | ast.Not() as op, operand=operand):
                sign = "-" if isinstance(op, ast.USub) else "!"
                return f"({sign}{self.expression(operand, integer)})"
            case ast.Compare(left=left, ops=[op], comparators=[right]):
                return f"({self.expression(left)} {_operator(op)} {self.expression(right)})"
            case ast.BoolOp(op=op, values=values):
                return f"({f' {_operator(op)} '.join(self.expression(v) for v in values)})"
            case ast.IfExp(test=test, body=body, orelse=orelse):
                yes, no = self.expression(body), self.expression(orelse)
                return f"({self.expression(test)} ? {yes} : {no})"
            case ast.Subscript(value=ast.Name(id=name), slice=place):
                if name not in self.arrays:
                    raise _no_table(name)
                return f"{name}[{self.expression(place, integer=True)}]"
            case ast.Call(func=function, args=given):
                return f"{_c_function(function, given)}({', '.join(map(self.expression, given))})"
        raise UntranslatableError(f"has an expression {type(node).__name__}")

    def power(self, base: str, exponent: ast.expr) -> str:
        """Return a positive number raised to any power, or any number to a small whole one."""
        match exponent:
            case ast.Constant(value=int() as times) if 2 <= times <= 4:
                return f"({' * '.join([base] * times)})"
        return f"ww_power({base}, {self.expression(exponent)})"

    def name_of(self, name: str, integer: bool) -> str:
        """Return what a name is in C: an index, a constant of the effect's file, or a variable."""
        if name in self.integers:
            return self.places.get(name, name) if integer else f"(float){name}"
        if name not in self.globals or name in self.arrays:
            return name
        if self.is_place(name):
            return f"WW_{name}"
        value = self.globals[name]
        if isinstance(value, int | float):
            return str(value) if integer else literal(value)
        raise _no_table(name)


def _c_function(function: ast.expr, given: list[ast.expr]) -> str:
    """Return the name of a function that C has too."""
    match function:
        case ast.Attribute(value=ast.Name(id="math"), attr=name):
            if name not in _MATHS:
                raise UntranslatableError(f"calls math.{name}, which the C has not")
            return _MATHS[name]
        case ast.Name(id="min" | "max" as name) if len(given) == 2:
            return "smaller" if name == "min" else "larger"
    name = function.id if isinstance(function, ast.Name) else "a method"
    raise UntranslatableError(f"calls {name}, which the C has not")


def _operator(node: ast.AST) -> str:
    """Return an operator that is the same in C."""
    if type(node) not in _OPERATORS:
        raise UntranslatableError(f"has an operator {type(node).__name__}")
    return _OPERATORS[type(node)]


def _no_table(name: str) -> UntranslatableError:
    return UntranslatableError(
        f"looks up a table ({name}); the C has an effect's coefficients alone"
    )


def _is_float(annotation: ast.expr | None) -> bool:
    return isinstance(annotation, ast.Name) and annotation.id == "float"


def _tree_of(function: Callable[..., Any]) -> ast.FunctionDef:
    return cast(ast.FunctionDef, ast.parse(textwrap.dedent(inspect.getsource(function))).body[0])


def _stored(tree: ast.AST) -> set[str]:
    """Return the arrays into which a function writes."""
    stored = set()
    for node in ast.walk(tree):
        match node:
            case ast.Subscript(value=ast.Name(id=name), ctx=ast.Store()):
                stored.add(name)
    return stored


def translate(effect: Effect, needed: dict[str, str]) -> str:
    """Return an effect's model as a C function ``effect_NAME``; add what it calls to ``needed``.

    Raises:
        UntranslatableError: it does something else than what is translated.
    """
    if effect.kind == "sensing" and effect.memory:
        raise UntranslatableError(
            "looks back among earlier measurements, which the C does not keep"
        )
    if effect.advance is not None:
        raise UntranslatableError("has a motion of its own, which the C does not carry on")
    if effect.model is None:
        raise UntranslatableError("has no model")
    return _Function(effect.model.__wrapped__, f"effect_{effect.name}", needed).code()


def definitions(code: str) -> str:
    """Return the definitions of the names of ``dynamics.effects.base`` that C code uses."""
    used = {
        name: value
        for name, value in vars(base).items()
        if name.isupper() and isinstance(value, int) and f"WW_{name}" in code
    }
    return "\n".join(f"#define WW_{name} {value}" for name, value in used.items())


def exportable_effects() -> list[str]:
    """Return the names of all effects that can be exported."""
    found = []
    for name in names():
        with suppress(UntranslatableError):
            if get(name).kind != "body":  # its numbers are the vehicle's
                translate(get(name), {})
            found.append(name)
    return found
