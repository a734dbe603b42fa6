"""The syntax tree of a Python function that is translated."""

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
