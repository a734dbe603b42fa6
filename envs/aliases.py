"""The tasks' ids ``-v0``: ``-v1`` with ``normalize=False``, until 3.0."""

import warnings
from typing import Any

import gymnasium


def make_single(task: str, **given: Any) -> Any:
    """Return an environment of ``windwrench/TASK-v0``."""
    return gymnasium.make(_current(task), **{"normalize": False, **given}).unwrapped


def make_many(task: str, **given: Any) -> Any:
    """Return environments of ``windwrench/TASK-v0`` side by side."""
    settings = {"vectorization_mode": "vector_entry_point", "normalize": False, **given}
    return gymnasium.make_vec(_current(task), **settings)


def _current(task: str) -> str:
    """Return the id in place of an old one, with a warning."""
    name = f"windwrench/{task}-v1"
    text = f"windwrench/{task}-v0 is kept until 3.0; take {name} with normalize=False"
    warnings.warn(text, DeprecationWarning, stacklevel=3)  # Gymnasium shows its own callers'
    return name
