"""YAML from strangers: plain values only, no objects, no more than a settings file needs."""

from pathlib import Path
from typing import Any

import yaml

from .errors import InputError
from .file_limits import LIMITS
from .regular_files import read_bytes

LARGEST = LIMITS.yaml_text


def read_yaml(path: Path, what: str) -> Any:
    """Return the value of a YAML file.

    Args:
        path: the file.
        what: it is, for errors: ``"a vehicle file"``.

    Raises:
        InputError: unreadable, no regular file, too large, or as ``parse_yaml``.
    """
    data = read_bytes(path, what, LARGEST)
    try:
        text = data.decode("utf-8-sig")
    except ValueError as error:
        raise InputError(f"{path}: cannot be read as {what}: {error}") from error
    return parse_yaml(text, str(path))


def parse_yaml(text: str, where: str) -> Any:
    """Return the plain value (mappings, lists, texts, numbers, dates) that a YAML text stands for.

    Raises:
        InputError: not valid YAML, an object of another kind, or aliases that write out to too many
            values.
    """
    try:
        _check_depth(text)
        node = yaml.compose(text, Loader=yaml.SafeLoader)
        if node is not None and _size(node, {}, 0) > LIMITS.yaml_values:
            raise InputError(
                f"{where}: more than {LIMITS.yaml_values} values, its aliases written out; "
                f"expected a few"
            )
        return yaml.safe_load(text)
    except InputError:
        raise
    # what a constructor makes of a spoiled date or number is any error of Python's
    except (
        yaml.YAMLError,
        ValueError,
        TypeError,
        AttributeError,
        KeyError,
        IndexError,
        OverflowError,
        RecursionError,
    ) as error:
        raise InputError(f"{where}: not valid YAML: {error or type(error).__name__}") from error


def _check_depth(text: str) -> None:
    """Raise ValueError where values lie too deep in one another: what builds them would go as deep,
    and slowly.
    """
    depth = 0
    for event in yaml.parse(text, Loader=yaml.SafeLoader):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(
            event, yaml.CollectionEndEvent
        )
        if depth > LIMITS.yaml_depth:
            raise ValueError(f"values within values, more than {LIMITS.yaml_depth} deep")


def _size(node: yaml.Node, known: dict[int, int], depth: int) -> int:
    """Return how many values a node writes out to; an alias costs what it stands for."""
    if depth > LIMITS.yaml_depth:
        raise ValueError("an alias within what it stands for")
    if id(node) not in known:
        parts: list[yaml.Node] = []
        if isinstance(node, yaml.MappingNode):
            parts = [part for pair in node.value for part in pair]
        elif isinstance(node, yaml.SequenceNode):
            parts = node.value
        known[id(node)] = 1 + sum(_size(part, known, depth + 1) for part in parts)
    return known[id(node)]
