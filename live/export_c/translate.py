"""Compiled Python functions as C, translated from their source, the only place of each equation.

Plain arithmetic on numbers and arrays is translated: assignments, ``for`` over a ``range``, ``if``,
functions of ``math`` known in C, ``min`` and ``max``. So are the questions of ``vector_lanes`` for
one lane, and calls of other compiled functions. A record's fields are the fields of ``ww_filter``,
or constants known to an export. Conditions on constants alone are decided here, and the C has the
chosen branch only. Everything else is refused.
"""

import ast
import inspect
import math
import re
import textwrap
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import partial, reduce
from typing import Any, cast

from ...dynamics.effects import base
from .c_values import (
    Array,
    CRecord,
    Number,
    UntranslatableError,
    Value,
    c_name,
    combined,
    constant,
    operator_of,
)

TYPES = {"float": "float", "int": "int", "truth": "int"}
_MATHS = {
    "sqrt": "sqrtf",
    "sin": "sinf",
    "cos": "cosf",
    "exp": "expf",
    "fabs": "fabsf",
    "atan2": "atan2f",
    "isfinite": "finite_number",
}
_FUNCTIONS = {"abs": "fabsf", "min": "smaller", "max": "larger"}
_PASSED_ON = ("any_of", "all_of")  # for one lane
# an assignment to a variable, without a call with possible side effects
_PURE = "|".join((*_MATHS.values(), *_FUNCTIONS.values()))
_PUT = re.compile(
    r" *(?:const \w+ )?(?P<name>\w+)(?:\[\])? [-+*/]?= "
    rf"(?P<value>(?:(?:{_PURE})\(|(?!\w+\()).*);"
)
_OF_ANNOTATION = {"float": "float", "int": "int", "bool": "truth"}


def python_of(function: Any) -> Any:
    """Return the Python function of a compiled one."""
    return getattr(function, "py_func", None) or getattr(function, "__wrapped__", function)


def tree_of(function: Callable[..., Any]) -> ast.FunctionDef:
    """Return the syntax tree of a function."""
    return cast(ast.FunctionDef, ast.parse(textwrap.dedent(inspect.getsource(function))).body[0])


def results_of(tree: ast.FunctionDef) -> int:
    """Return how many numbers a function returns at once; 0: one, or none."""
    for node in ast.walk(tree):
        match node:
            case ast.Return(value=ast.Tuple(elts=elements)):
                return len(elements)
    return 0


def is_read(targets: list[ast.expr], values: list[ast.expr]) -> bool:
    """Return whether values may read a target assigned before them."""
    read = {node.id for value in values for node in ast.walk(value) if isinstance(node, ast.Name)}
    stored = {node.id for one in targets for node in ast.walk(one) if isinstance(node, ast.Name)}
    return bool(read & stored)


@dataclass
class Library:
    """Names known to translated functions, and the functions translated so far."""

    constants: Any = None  # the filter's record: constants, but for the fields in ``memory``
    # fields of ``ww_filter``: int or float, and their shapes
    memory: Mapping[str, tuple[str, tuple[str, ...]]] = field(default_factory=dict)
    numbers: Mapping[str, float] = field(default_factory=dict)  # constants with another value in C
    counter: int = 0  # of names
    by_hand: Collection[str] = ()  # functions in templates: they write no argument but the record
    refused: Mapping[Any, str] = field(default_factory=dict)  # not translated, and why
    prefix: str = ""  # of the names of functions
    done: dict[tuple[Any, ...], "Function"] = field(default_factory=dict)

    def get(self, function: Callable[..., Any], bound: tuple[Value | None, ...] = ()) -> "Function":
        """Return a compiled function, translated for known arguments (``bound``)."""
        if "len" not in python_of(function).__code__.co_names:  # any number of rows will do
            bound = tuple(
                replace(one, shape=("", *one.shape[1:]))
                if isinstance(one, Array) and one.root
                else one
                for one in bound
            )
        key = function, bound or (None,) * len(inspect.signature(function).parameters)
        if key not in self.done:
            made = Function(function, self, bound=key[1])
            made.translate()
            self.done[key] = made  # after the functions it calls
        return self.done[key]

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
            return CRecord(path)
        if value.shape:
            return Array(f"ww_{name}", tuple(map(str, value.shape)), values=value)
        return replace(constant(value.item()), text=f"WW_{name.upper()}")

    def code(self) -> str:
        """Return all translations, each function before its callers."""
        return "\n".join(made.code() for made in self.done.values())


class Function:
    """One compiled function on its way to C."""

    def __init__(
        self,
        function: Callable[..., Any],
        library: Library,
        name: str = "",
        bound: tuple[Value | None, ...] = (),
        suffix: str = "",
    ) -> None:
        python = python_of(function)
        self.library = library
        self.globals: Mapping[str, Any] = python.__globals__  # of the function's file
        self.names: dict[str, Value] = {}
        self.lines: list[str] = []  # so far; expressions may add to them
        self.tree = tree_of(python)
        self.name = name or library.prefix + self.tree.name.lstrip("_")
        self.file = python.__module__
        self.arguments = self.tree.args.args
        self.bound = bound or (None,) * len(self.arguments)
        self.locals: dict[str, str] = {}  # of C, and their types
        self.written: set[str] = set()  # arrays; "f": a field
        self.used: set[str] = set()  # words of the C
        self.suffix = suffix
        self.returned: Value | None = None
        self.results = results_of(self.tree)
        self.out = "float"
        self.result = _OF_ANNOTATION.get(getattr(self.tree.returns, "id", ""), "")

    def translate(self) -> None:
        """Work out the lines of the body."""
        for argument, bound in zip(self.arguments, self.bound, strict=True):
            name = argument.arg
            if isinstance(bound, Array) and bound.root:  # a matrix of this size
                bound = replace(bound, text=c_name(name), root=name)
            self.names[name] = bound or self.parameter(argument)
        self.lines = _without_unread(self.block(self.tree.body))
        self.used = _words(*self.lines)

    def parameter(self, argument: ast.arg) -> Value:
        """Return a parameter's value, by its annotation."""
        kind = getattr(argument.annotation, "id", "")
        if kind in _OF_ANNOTATION:
            return Number(c_name(argument.arg), _OF_ANNOTATION[kind])
        if kind == "Record":
            return CRecord()
        return Array(c_name(argument.arg), root=argument.arg)

    def code(self) -> str:
        """Return the C function."""
        parameters = []
        unused = []
        for argument, bound in zip(self.arguments, self.bound, strict=True):
            value = self.names[argument.arg]
            name = argument.arg
            if bound is not None and not (isinstance(bound, Array) and bound.root):
                continue  # a constant
            if isinstance(value, CRecord):
                const = "" if "f" in self.written else "const "
                parameters.append(f"{const}ww_filter *f")
                name = "f"
                if "P" in self.used:
                    parameters.append("float P[WW_STATES][WW_STATES]")
            elif isinstance(value, Array) and len(value.shape) == 2:
                parameters.append(f"float {value.text}[{value.shape[0]}][{value.shape[1]}]")
            elif isinstance(value, Array):
                const = "" if name in self.written else "const "
                parameters.append(f"{const}float *{value.text}")
            elif isinstance(value, Number):
                parameters.append(f"{TYPES[value.kind]} {value.text}")
            if c_name(name) not in self.used:
                unused.append(f"    (void){c_name(name)};")
        if self.results:
            parameters.append(f"{self.out} *out")
        result = TYPES.get(self.result, "void")
        head = [
            f"    {kind} {', '.join(f'{name} = {zero}' for name in names)};"
            for kind, zero in (("float", "0.0f"), ("int", "0"))
            if (names := [n for n, its in self.locals.items() if its == kind and n in self.used])
        ]
        about = (ast.get_docstring(self.tree) or self.name).split("\n\n")[0].replace("``", "`")
        comment = textwrap.fill(f"/* {self.file.split('.', 1)[-1]}: {about} */", 100)
        signature = f"static {result} {self.name}({', '.join(parameters)})"
        body = [f"    {line}" for line in self.lines]
        return "\n".join([comment, signature, "{", *head, *unused, *body, "}"]) + "\n"

    # ---- statements ------------------------------------------------------------------------------

    def block(self, body: list[ast.stmt]) -> list[str]:
        """Return the lines of several statements."""
        outer = self.lines
        self.lines = []
        for statement in body:
            self.statement(statement)
        lines = self.lines
        self.lines = outer
        return lines

    def indented(self, head: str, body: list[ast.stmt]) -> None:
        """Add the lines of a block behind its head."""
        self.lines += [head, *(f"    {line}" for line in self.block(body))]

    def statement(self, node: ast.stmt) -> None:
        """Add the lines of a statement."""
        match node:
            case ast.Expr(value=ast.Constant()):  # a docstring
                pass
            case (
                ast.Assign(targets=[target], value=value)
                | ast.AnnAssign(target=target, value=ast.expr() as value)
            ):
                self.assignment(target, value)
            case ast.AugAssign(target=target, op=op, value=value):
                amount = self.converted(self.number(value), self.number(target).kind)
                self.lines.append(f"{self.target(target)} {operator_of(op)}= {amount};")
            case ast.For(
                target=ast.Name(id=i),
                iter=ast.Call(func=ast.Name(id="range"), args=[_] | [_, _] as given),
                body=body,
            ):
                first, end = ["0", *(self.number(one).text for one in given)][-2:]
                self.names[i] = Number(c_name(i), "int")
                i = c_name(i)
                self.indented(f"for (int {i} = {first}; {i} < {end}; {i}++) {{", body)
                self.lines.append("}")
            case ast.If(test=test, body=body, orelse=orelse):
                condition = self.number(test)
                if condition.known is not None:
                    for one in body if condition.known else orelse:
                        self.statement(one)
                    return
                text = condition.text  # its own parentheses do
                self.indented(f"if {text if text[0] == '(' else f'({text})'} {{", body)
                if orelse:
                    self.indented("} else {", orelse)
                self.lines.append("}")
            case ast.Return(value=ast.expr() as value) if self.suffix:
                self.returned = self.evaluated(value)
            case ast.Return(value=None):
                self.lines.append("return;")
            case ast.Return(value=ast.Tuple(elts=values)):
                numbers = list(map(self.number, values))
                self.out = "int" if all(one.kind == "int" for one in numbers) else "float"
                self.lines += [
                    f"out[{i}] = {self.converted(one, self.out)};" for i, one in enumerate(numbers)
                ]
                self.lines += [] if node is self.tree.body[-1] else ["return;"]
            case ast.Return(value=ast.expr() as value):
                self.lines.append(f"return {self.converted(self.number(value), self.result)};")
            case ast.Expr(value=ast.Call() as call):
                self.lines.append(f"{self.call(call, '')};")
            case ast.For():
                raise UntranslatableError("loops over something else than a range")
            case _:
                raise UntranslatableError(f"has a statement {type(node).__name__}")

    def assignment(self, target: ast.expr, value: ast.expr) -> None:
        """Add the lines of an assignment to one target, or to several at once."""
        several: Value
        match target, value:
            case ast.Tuple(elts=targets), ast.Tuple(elts=values):
                if not is_read(targets, values):
                    for one, its in zip(targets, values, strict=True):
                        self.assignment(one, its)
                    return
                several = tuple(map(self.evaluated, values))
            case ast.Tuple(elts=targets), _:
                several = self.evaluated(value)
                if isinstance(several, Array):
                    several = tuple(several.at(constant(i)) for i in range(len(targets)))
                if not isinstance(several, tuple):
                    raise UntranslatableError("takes one number for several")
                if self.suffix and all(isinstance(one, ast.Name) for one in targets):
                    for one, of in zip(targets, map(self.kept, several), strict=True):
                        name = cast(ast.Name, one).id
                        if self.is_put_once(name):
                            self.names[name] = of
                        else:
                            self.put(one, of)
                    return
            case _:
                self.put(target, self.evaluated(value))
                return
        texts = [cast(Number, one).as_float() for one in several]
        t = self.temporary()
        self.lines.append(f"const float {t}[] = {{{', '.join(texts)}}};")
        for i, one in enumerate(targets):
            if not (isinstance(one, ast.Name) and one.id == "_"):
                self.put(one, Number(f"{t}[{i}]"))

    def put(self, target: ast.expr, value: Value) -> None:
        """Add the assignment of a value to a target; an array or a record gets a further name."""
        if isinstance(target, ast.Name) and target.id not in self.names:
            if isinstance(value, tuple):
                value = tuple(map(self.kept, value))
            constant_here = isinstance(value, Number) and value.known is not None and self.suffix
            if not isinstance(value, Number) or (constant_here and self.is_put_once(target.id)):
                self.names[target.id] = value
                return
        if not isinstance(value, Number):
            raise UntranslatableError("copies an array as a whole")
        if isinstance(target, ast.Name) and target.id not in self.names:
            name = f"{c_name(target.id)}{self.suffix}"
            self.locals[name] = TYPES[value.kind]
            self.names[target.id] = Number(name, value.kind)
        text = self.converted(value, self.number(target).kind)
        self.lines.append(f"{self.target(target)} = {text};")

    def is_put_once(self, name: str) -> bool:
        """Return whether a variable has one value for good."""
        stored = [n for n in ast.walk(self.tree) if isinstance(n, ast.Name) and n.id == name]
        return sum(isinstance(n.ctx, ast.Store) for n in stored) == 1

    def target(self, node: ast.expr) -> str:
        """Return the target of an assignment."""
        match node:
            case ast.Subscript(value=array):
                self.written.add(cast(Array, self.evaluated(array)).root)
            case ast.Attribute():
                self.written.add("f")
        return self.number(node).text

    # ---- expressions -----------------------------------------------------------------------------

    def number(self, node: ast.expr) -> Number:
        """Return the number of an expression."""
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
                if not isinstance(record, CRecord):
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
            case (
                ast.BinOp(left=left, op=op, right=right)
                | ast.Compare(left=left, ops=[op], comparators=[right])
            ):
                return combined(op, self.number(left), self.number(right))
            case ast.UnaryOp(op=ast.USub() | ast.Not() as op, operand=operand):
                value = self.number(operand)
                negative = isinstance(op, ast.USub)
                known = value.known
                if known is not None:
                    known = -known if negative else not known
                kind = value.kind if negative else "truth"
                return Number(f"({'-' if negative else '!'}{value.text})", kind, known)
            case ast.BoolOp(op=op, values=values):
                return reduce(partial(combined, op), map(self.number, values))
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
        yes = self.number(body)
        no = self.number(orelse)
        kind = yes.kind if yes.kind == no.kind else "float"
        texts = (self.converted(yes, kind), self.converted(no, kind))
        return Number(f"({condition.text} ? {texts[0]} : {texts[1]})", kind)

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
        """Return a name's value: a parameter, a variable, or a constant of the file."""
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
        """Return a number in a variable, worked out only once."""
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
        """Return arguments as floats."""
        return ", ".join(self.number(one).as_float() for one in given)

    # ---- calls -----------------------------------------------------------------------------------

    def called(self, node: ast.Call) -> Value:
        """Return the result of a call."""
        match node:
            case ast.Call(func=ast.Attribute(value=ast.Name(id="math"), attr=name), args=given):
                if name not in _MATHS:
                    raise UntranslatableError(f"calls math.{name}, which the C has not")
                kind = "truth" if name == "isfinite" else "float"
                return Number(f"{_MATHS[name]}({self.floats(given)})", kind)
            case ast.Call(func=ast.Name(id="choose"), args=[test, body, orelse]):
                return self.choice(test, body, orelse)
            case ast.Call(func=ast.Name(id=name), args=[one]) if name in _PASSED_ON:
                return self.number(one)
            case ast.Call(func=ast.Name(id="opposite"), args=[one]):
                return Number(f"(!{self.number(one).text})", "truth")
            case ast.Call(func=ast.Name(id="len"), args=[of]):
                size = cast(Array, self.evaluated(of)).shape[0]
                return Number(size, "int", int(size) if size.isdigit() else None)
            case ast.Call(func=ast.Name(id=name), args=given) if name in _FUNCTIONS:
                if len(given) == 2 or name == "abs":
                    return Number(f"{_FUNCTIONS[name]}({self.floats(given)})")
            case ast.Call(func=ast.Name(id=name)):
                function: Any = self.globals.get(name)
                if getattr(function, "targetoptions", {}).get("inline") == "always":
                    return self.inlined(function, [self.evaluated(one) for one in node.args])
                count = (
                    results_of(tree_of(python_of(function))) if hasattr(function, "py_func") else 0
                )
                if not count:
                    text = self.call(node, "")
                    returned = getattr(tree_of(python_of(function)).returns, "id", "")
                    return Number(text, _OF_ANNOTATION.get(returned, "float"))
                t = self.temporary()
                self.lines.append(f"float {t}[{count}];")
                self.lines.append(f"{self.call(node, t)};")
                return Array(t, (str(count),), root=t)
        name = node.func.id if isinstance(node.func, ast.Name) else "a method"
        raise UntranslatableError(f"calls {name}, which the C has not")

    def inlined(self, function: Any, given: list[Value]) -> Value:
        """Return a function's result, with its lines put before the current one."""
        self.library.counter += 1
        part = Function(function, self.library, suffix=f"_{self.library.counter}")
        part.lines = self.lines
        part.locals = self.locals
        part.written = self.written
        stored = {
            n.id
            for n in ast.walk(part.tree)
            if isinstance(getattr(n, "ctx", 0), ast.Store) and isinstance(n, ast.Name)
        }
        for argument, value in zip(part.arguments, given, strict=True):
            value = self.kept(value)
            if argument.arg in stored:
                part.put(ast.Name(argument.arg, ast.Store()), value)
            else:
                part.names[argument.arg] = value
        for statement in part.tree.body:
            part.statement(statement)
        if part.returned is None:
            raise UntranslatableError(f"calls the function {part.name}, which the C has not")
        return part.returned

    def callee(self, node: ast.Call) -> "Function | None":
        """Return the called function, translated; None: written by hand."""
        name = cast(ast.Name, node.func).id
        function: Any = self.globals.get(name)
        if function in self.library.refused:
            raise UntranslatableError(self.library.refused[function])
        if name in self.library.by_hand:
            return None
        if not hasattr(function, "py_func"):
            raise UntranslatableError(f"calls the function {name}, which the C has not")
        values = [self.evaluated(one) for one in node.args]
        return self.library.get(function, tuple(map(_bound, values)))

    def call(self, node: ast.expr, out: str) -> str:
        """Return the call of a compiled function, translated too."""
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name)):
            raise UntranslatableError(f"has an expression {type(node).__name__}")
        made = self.callee(node)
        texts = []
        for i, argument in enumerate(node.args):
            value = self.evaluated(argument)
            if isinstance(value, Array):
                if made and made.arguments[i].arg in made.written:
                    self.written.add(value.root)
                if value.root:
                    texts.append(value.pointer())
            elif isinstance(value, Number):
                wanted = made.names[made.arguments[i].arg] if made else value
                texts.append(self.converted(value, cast(Number, wanted).kind))
            elif isinstance(value, CRecord) and not value.path:
                self.written |= {"f"} & (made.written if made else {"f"})
                texts += ["f", "P"] if made and "P" in made.used else ["f"]
        name = made.name if made else node.func.id.lstrip("_")
        return f"{name}({', '.join([*texts, *([out] if out else [])])})"


def _words(*lines: str) -> set[str]:
    return set(re.findall(r"\w+", " ".join(lines)))


def _without_unread(lines: list[str]) -> list[str]:
    """Return lines of C without assignments to unread variables; calls stay, since they may write
    elsewhere.
    """
    put = [(_PUT.fullmatch(line), line) for line in lines]
    read = _words(*(one["value"] if one else line for one, line in put))
    kept = [line for one, line in put if one is None or one["name"] in read]
    return lines if kept == lines else _without_unread(kept)


def _bound(value: Value) -> Value | None:
    """Return the known part of a call's argument: a constant's table, a matrix' size."""
    match value:
        case Array(root="") | CRecord(path=(_, *_)):
            return value
        case Array(shape=(rows, columns)):
            return Array("", (rows, columns), root="matrix")
    return None
