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
        tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
        self.tree = cast(ast.FunctionDef, tree.body[0])
        self.integers: set[str] = set()
        self.places: dict[str, str] = {}  # short names of places in an array
        self.counter = 0
        annotated = [a for a in self.tree.args.args if a.annotation is not None]
        self.floats = [
            a.arg for a in annotated if isinstance(a.annotation, ast.Name) and _is_float(a)
        ]
        self.arrays = [a.arg for a in self.tree.args.args if a.arg not in self.floats]
        self.returned = 0

    def code(self) -> str:
        """Return the C function."""
        body = [
            line
            for statement in self.tree.body
            if not (isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant))
            for line in self.statement(statement)
        ]
        stored = _stored(self.tree) | self._written_by_calls()
        parameters = [
            f"{'' if name in stored else 'const '}float *{name}"
            if name in self.arrays
            else f"float {name}"
            for name in (a.arg for a in self.tree.args.args)
        ]
        if self.returned:
            parameters.append("float *out")
        local = sorted(
            {
                node.id
                for node in ast.walk(self.tree)
                if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
            }
            - self.integers
            - set(self.floats)
            - {"_"}
        )
        head = [f"float {', '.join(f'{name} = 0.0f' for name in local)};"] if local else []
        used = {node.id for node in ast.walk(self.tree) if isinstance(node, ast.Name)}
        if taken := sorted(used & _KEYWORDS):
            raise UntranslatableError(f"has a variable {taken[0]}, which is a word of C")
        head += [f"(void){name};" for name in self.arrays if name not in used]
        lines = [f"static void {self.name}({', '.join(parameters)})", "{"]
        lines += [f"    {line}" for line in (*head, *body)]
        return "\n".join([*lines, "}"]) + "\n"

    def _written_by_calls(self) -> set[str]:
        """Return the arrays that are given to a function of ``parts`` that writes into them."""
        written = set()
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                part = getattr(parts, node.func.id, None)
                if part is not None:
                    tree = ast.parse(inspect.getsource(part.py_func)).body[0]
                    stores = _stored(tree)
                    given = cast(ast.FunctionDef, tree).args.args
                    for parameter, argument in zip(given, node.args, strict=True):
                        if parameter.arg in stores and isinstance(argument, ast.Name):
                            written.add(argument.id)
        return written

    def statement(self, node: ast.stmt) -> list[str]:
        """Return the lines of C of a statement."""
        if isinstance(node, ast.Assign) and len(node.targets) == 1:
            return self.assignment(node.targets[0], node.value)
        if isinstance(node, ast.AugAssign):
            before, value = self.value(node.value)
            operator = self.operator(node.op)
            return [*before, f"{self.expression(node.target)} {operator}= {value};"]
        if isinstance(node, ast.For) and isinstance(node.target, ast.Name):
            bounds = self.bounds(node.iter)
            i = node.target.id
            self.integers.add(i)
            head = f"for (int {i} = {bounds[0]}; {i} < {bounds[1]}; {i}++) {{"
            return [head, *self.block(node.body), "}"]
        if isinstance(node, ast.If):
            lines = [f"if ({self.expression(node.test)}) {{", *self.block(node.body), "}"]
            if node.orelse:
                lines[-1] = "} else {"
                lines += [*self.block(node.orelse), "}"]
            return lines
        if isinstance(node, ast.Return):
            if node.value is None:
                return ["return;"]
            if isinstance(node.value, ast.Tuple):
                self.returned = len(node.value.elts)
                return [
                    f"out[{i}] = {self.expression(value)};"
                    for i, value in enumerate(node.value.elts)
                ]
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            return [f"{self.part_call(node.value, None)};"]
        raise UntranslatableError(f"has a statement {type(node).__name__}")

    def block(self, body: list[ast.stmt]) -> list[str]:
        """Return the indented lines of several statements."""
        return [f"    {line}" for statement in body for line in self.statement(statement)]

    def assignment(self, target: ast.expr, value: ast.expr) -> list[str]:
        """Return the lines of an assignment to one target, or to several at once."""
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            pairs = [
                (a, b)
                for a, b in zip(target.elts, value.elts, strict=True)
                if not self.names_a_place(a, b)
            ]
            target = ast.Tuple([a for a, _ in pairs], ast.Store())
            value = ast.Tuple([b for _, b in pairs], ast.Load())
        elif self.names_a_place(target, value):
            return []
        if isinstance(target, ast.Tuple):
            self.counter += 1
            t = f"t{self.counter}"
            if isinstance(value, ast.Tuple):
                values = [self.expression(v) for v in value.elts]
                lines = [f"const float {t}[] = {{{', '.join(values)}}};"]
            else:
                lines = [f"float {t}[{len(target.elts)}];", f"{self.part_call(value, t)};"]
            for i, one in enumerate(target.elts):
                if not (isinstance(one, ast.Name) and one.id == "_"):
                    lines.append(f"{self.expression(one)} = {t}[{i}];")
            return lines
        before, text = self.value(value)
        return [*before, f"{self.expression(target)} = {text};"]

    def names_a_place(self, target: ast.expr, value: ast.expr) -> bool:
        """Return whether an assignment gives a place in an array a short name; keep it."""
        if not (isinstance(target, ast.Name) and isinstance(value, ast.Name)):
            return False
        place = self.globals.get(value.id)
        if not isinstance(place, int) or getattr(base, value.id, None) != place:
            return False
        self.integers.add(target.id)
        self.places[target.id] = f"WW_{value.id}"
        return True

    def value(self, node: ast.expr) -> tuple[list[str], str]:
        """Return the lines that come before an expression, and the expression."""
        if (
            isinstance(node, ast.Subscript)
            and isinstance(node.value, ast.Call)
            and isinstance(node.slice, ast.Constant)
        ):
            self.counter += 1
            t = f"t{self.counter}"
            call = self.part_call(node.value, t)
            return [f"float {t}[3];", f"{call};"], f"{t}[{node.slice.value!r}]"
        return [], self.expression(node)

    def part_call(self, node: ast.expr, out: str | None) -> str:
        """Return the call of a function of ``parts``, which is translated too."""
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name)):
            raise UntranslatableError(f"has an expression {type(node).__name__}")
        name = node.func.id
        part = getattr(parts, name, None)
        if part is parts.delay:
            raise UntranslatableError("looks back among earlier samples, which the C does not keep")
        if part is None or not hasattr(part, "py_func"):
            raise UntranslatableError(f"calls the function {name}, which the C has not")
        if name not in self.needed:
            self.needed[name] = ""  # its place; calls do not go round in a circle
            self.needed[name] = _Function(part.py_func, f"ww_{name}", self.needed).code()
        arguments = [self.expression(a) for a in node.args] + ([out] if out else [])
        return f"ww_{name}({', '.join(arguments)})"

    def bounds(self, node: ast.expr) -> tuple[str, str]:
        """Return first and last of a range."""
        if (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Name)
            and node.func.id == "range"
            and len(node.args) in (1, 2)
        ):
            given = [self.expression(a, integer=True) for a in node.args]
            return (given[0], given[1]) if len(given) == 2 else ("0", given[0])
        raise UntranslatableError("loops over something else than a range")

    def operator(self, node: ast.AST) -> str:
        """Return an operator that is the same in C."""
        if type(node) not in _OPERATORS:
            raise UntranslatableError(f"has an operator {type(node).__name__}")
        return _OPERATORS[type(node)]

    def expression(self, node: ast.expr, integer: bool = False) -> str:
        """Return an expression; ``integer`` where it is an index."""
        if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
            return str(node.value) if integer else literal(node.value)
        if isinstance(node, ast.Name):
            return self.name_of(node.id, integer)
        if isinstance(node, ast.BinOp):
            left = self.expression(node.left, integer)
            if isinstance(node.op, ast.Pow):
                return self.power(left, node.right)
            operator = self.operator(node.op)
            return f"({left} {operator} {self.expression(node.right, integer)})"
        if isinstance(node, ast.UnaryOp):
            sign = {ast.USub: "-", ast.Not: "!"}.get(type(node.op))
            if sign is not None:
                return f"({sign}{self.expression(node.operand, integer)})"
        if isinstance(node, ast.Compare) and len(node.ops) == 1:
            left, right = self.expression(node.left), self.expression(node.comparators[0])
            return f"({left} {self.operator(node.ops[0])} {right})"
        if isinstance(node, ast.BoolOp):
            operator = f" {self.operator(node.op)} "
            return f"({operator.join(self.expression(v) for v in node.values)})"
        if isinstance(node, ast.IfExp):
            test, yes, no = (self.expression(n) for n in (node.test, node.body, node.orelse))
            return f"({test} ? {yes} : {no})"
        if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name):
            if node.value.id not in self.arrays:
                raise _no_table(node.value.id)
            return f"{node.value.id}[{self.expression(node.slice, integer=True)}]"
        if isinstance(node, ast.Call):
            return self.call(node)
        raise UntranslatableError(f"has an expression {type(node).__name__}")

    def power(self, base: str, exponent: ast.expr) -> str:
        """Return a positive number raised to any power, or any number to a small whole one."""
        given = exponent.value if isinstance(exponent, ast.Constant) else None
        if isinstance(given, int) and 2 <= given <= 4:
            return f"({' * '.join([base] * given)})"
        return f"ww_power({base}, {self.expression(exponent)})"

    def name_of(self, name: str, integer: bool) -> str:
        """Return what a name is in C: an index, a constant of the effect's file, or a variable."""
        if name in self.integers:
            return self.places.get(name, name) if integer else f"(float){name}"
        if name in self.globals and name not in self.arrays:
            value = self.globals[name]
            if isinstance(value, int) and getattr(base, name, None) == value:
                return f"WW_{name}"
            if isinstance(value, int | float):
                return str(value) if integer else literal(value)
            raise _no_table(name)
        return name

    def call(self, node: ast.Call) -> str:
        """Return a call of a function that C has too."""
        arguments = [self.expression(a) for a in node.args]
        function = node.func
        if (
            isinstance(function, ast.Attribute)
            and isinstance(function.value, ast.Name)
            and function.value.id == "math"
        ):
            if function.attr not in _MATHS:
                raise UntranslatableError(f"calls math.{function.attr}, which the C has not")
            return f"{_MATHS[function.attr]}({', '.join(arguments)})"
        name = function.id if isinstance(function, ast.Name) else "a method"
        if name in ("min", "max") and len(arguments) == 2:
            return f"{'smaller' if name == 'min' else 'larger'}({', '.join(arguments)})"
        raise UntranslatableError(f"calls {name}, which the C has not")


def _no_table(name: str) -> UntranslatableError:
    return UntranslatableError(
        f"looks up a table ({name}); the C has an effect's coefficients alone"
    )


def _is_float(argument: ast.arg) -> bool:
    return isinstance(argument.annotation, ast.Name) and argument.annotation.id == "float"


def _stored(tree: ast.AST) -> set[str]:
    """Return the arrays into which a function writes."""
    return {
        node.value.id
        for node in ast.walk(tree)
        if isinstance(node, ast.Subscript)
        and isinstance(node.ctx, ast.Store)
        and isinstance(node.value, ast.Name)
    }


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
    return [name for name in names() if refusal(name) is None]


def refusal(name: str) -> str | None:
    """Return why an effect cannot be exported, or None if it can."""
    effect = get(name)
    if effect.kind == "body":
        return None
    try:
        translate(effect, {})
    except UntranslatableError as error:
        return str(error)
    return None
