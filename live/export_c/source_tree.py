"""The syntax tree of a Python function, before it is translated: what an export's constants decide
is decided, and what nobody reads is left out.
"""

import ast
import inspect
import textwrap
from collections.abc import Callable
from typing import Any, cast


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
    """Return whether values may read what is assigned to the targets before them."""
    read = {node.id for value in values for node in ast.walk(value) if isinstance(node, ast.Name)}
    stored = {node.id for one in targets for node in ast.walk(one) if isinstance(node, ast.Name)}
    return bool(read & stored)


class _Chosen(ast.NodeTransformer):
    """Decides what depends on an export's constants, and takes tuples of assignments apart."""

    def __init__(self, known: Callable[[ast.expr], float | None]) -> None:
        self.known = known

    def visit_If(self, node: ast.If) -> Any:
        known = self.known(node.test)
        if known is None:
            return self.generic_visit(node)
        return [self.visit(one) for one in (node.body if known else node.orelse)]

    def visit_IfExp(self, node: ast.IfExp) -> Any:
        known = self.known(node.test)
        if known is None:
            return self.generic_visit(node)
        return self.visit(node.body if known else node.orelse)

    def visit_Assign(self, node: ast.Assign) -> Any:
        match node:
            case ast.Assign(targets=[ast.Tuple(elts=targets)], value=ast.Tuple(elts=values)):
                if not is_read(targets, values):
                    pairs = zip(targets, values, strict=True)
                    return [self.visit(ast.Assign([one], value)) for one, value in pairs]
        return self.generic_visit(node)


def decided(tree: ast.FunctionDef, known: Callable[[ast.expr], float | None]) -> ast.FunctionDef:
    """Return a tree with the branches alone that can be taken, and without what is not read;
    ``known`` tells a condition's value, or None where only a flight does.
    """
    chosen = cast(ast.FunctionDef, _Chosen(known).visit(tree))
    while _drop_unread(chosen):
        pass
    return chosen


def _drop_unread(tree: ast.AST) -> bool:
    """Take assignments to variables out that nobody reads; return whether there were any."""
    read = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)}
    dropped = False
    for node in ast.walk(tree):
        for name in ("body", "orelse"):
            body = getattr(node, name, None)
            if not isinstance(body, list):
                continue
            kept: list[ast.stmt] = []
            for one in body:
                match one:
                    case (
                        ast.Assign(targets=[ast.Name(id=target)], value=value)
                        | ast.AnnAssign(target=ast.Name(id=target), value=ast.expr() as value)
                        | ast.AugAssign(target=ast.Name(id=target), value=value)
                    ) if target not in read:
                        dropped = True
                        if isinstance(value, ast.Call):  # it may write elsewhere
                            kept.append(ast.Expr(value))
                    case _:
                        kept.append(one)
            setattr(node, name, kept)
    return dropped
