"""YAML from strangers: plain values only, no objects, no more than a settings file needs."""

from pathlib import Path
from typing import Any

import yaml

from .errors import InputError
from .file_limits import LIMITS
from .regular_files import read_bytes, reading

LARGEST = LIMITS.yaml_text
_UNMADE = ("tag:yaml.org,2002:merge", "tag:yaml.org,2002:value")  # keys << and =, without a value


class _Loader(yaml.SafeLoader):
    """YAML's safe loader, without deep values and repeated keys: the second would overwrite the
    first.
    """

    _depth = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Return the next node; raise ValueError where values lie too deep in one another."""
        self._depth += 1
        if self._depth > LIMITS.yaml_depth:
            raise ValueError(f"values within values, more than {LIMITS.yaml_depth} deep")
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def compose_mapping_node(self, anchor: Any) -> Any:
        """Return a mapping's node; raise ValueError where a key comes twice."""
        node = super().compose_mapping_node(anchor)
        lines: dict[Any, int] = {}
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                continue
            name = key.value if key.tag in _UNMADE else self.construct_object(key)
            line = key.start_mark.line + 1
            if name in lines:
                raise ValueError(
                    f"key {name!r} comes twice, in lines {lines[name]} and {line}; expected once"
                )
            lines[name] = line
        return node


def read_yaml(path: Path, what: str) -> Any:
    """Return the value of a YAML file.

    Args:
        path: the file.
        what: it is, for errors: ``"a vehicle file"``.

    Raises:
        InputError: unreadable, no regular file, too large, or as ``parse_yaml``.
    """
    data = read_bytes(path, what, LARGEST)
    with reading(path, what):
        text = data.decode("utf-8-sig")
    return parse_yaml(text, str(path))


def parse_yaml(text: str, where: str) -> Any:
    """Return the plain value (mappings, lists, texts, numbers, dates) of a YAML text.

    Raises:
        InputError: not valid YAML, a key twice in one mapping, an object of another kind, or
            aliases for too many values.
    """
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        if node is None:
            return None
        if _size(node, {}, 0) > LIMITS.yaml_values:
            raise InputError(
                f"{where}: more than {LIMITS.yaml_values} values, its aliases written out; "
                f"expected a few"
            )
        return loader.construct_document(node)
    except InputError:
        raise
    # a constructor raises any error of Python's on a spoiled date or number
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


def _size(node: yaml.Node, known: dict[int, int], depth: int) -> int:
    """Return the number of values of a node; an alias counts as its target does."""
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
