"""How a test says that a file is refused, and that a log has a note."""

import pytest

from windwrench.runtime.errors import InputError


def refused(words):
    """Return a context in which an InputError must be raised whose line matches ``words``."""
    return pytest.raises(InputError, match=words)


def noted(log, *words):
    """Return whether one note of a log holds all of some words."""
    return any(all(word in note for word in words) for note in log.notes)
