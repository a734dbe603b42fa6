"""Designed laws in YAML files, as ``windwrench profile --write law.yaml`` writes them: the law's
name, its gains, and the task.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..runtime.errors import InputError, unknown_name
from ..runtime.forms import STRICT, Number, checked
from ..runtime.yaml_file import read_yaml

WHAT = "a law file"


@dataclass(frozen=True)
class _LawFile:
    """The fields of such a file."""

    __pydantic_config__ = STRICT

    law: str
    gains: dict[str, Number] = field(default_factory=dict)
    task: str = ""  # any
    designed: dict[str, Any] = field(default_factory=dict)  # how, for a reader


def is_law_file(name: str) -> bool:
    """Return whether a controller's name is a YAML file."""
    return name.endswith((".yaml", ".yml"))


def read_law(name: str, task: str, laws: Mapping[str, Callable[..., Any]]) -> _LawFile:
    """Return a file's law and gains.

    Args:
        name: the file.
        task: to be flown.
        laws: the task's laws by name.

    Raises:
        InputError: no such file, another task's law, an unknown law, or an unknown gain.
    """
    stated = checked(_LawFile, read_yaml(Path(name), WHAT), name)
    if stated.task not in ("", task):
        raise InputError(f"{name}: task: a law of {stated.task}; expected one of {task}")
    if stated.law not in laws:
        raise unknown_name("law", stated.law, laws, name)
    gains = inspect.signature(laws[stated.law]).parameters
    for gain in stated.gains:
        if gain not in gains:
            raise unknown_name("gain", gain, gains, f"{name}: {stated.law}")
    return stated
