"""Kept numbers and those of now, to what solvers of other processors order otherwise; and files of
JSON whose numbers are JSON's.
"""

import json

import pytest


def strict_json(path):
    """Return what a file of JSON holds, which knows neither NaN nor Infinity."""

    def refuse(word):
        raise AssertionError(f"{word} is no JSON")

    return json.loads(path.read_bytes(), parse_constant=refuse)


def assert_alike(now, kept, where="", rel=1e-4, least=1e-9):
    """Assert that plain data is what was kept, its numbers to ``rel`` of them or to ``least``."""
    if isinstance(kept, dict):
        assert now.keys() == kept.keys(), where
        for key in kept:
            assert_alike(now[key], kept[key], f"{where}/{key}", rel, least)
    elif isinstance(kept, list):
        assert len(now) == len(kept), where
        for i, (a, b) in enumerate(zip(now, kept, strict=True)):
            assert_alike(a, b, f"{where}/{i}", rel, least)
    elif isinstance(kept, float):
        assert now == pytest.approx(kept, rel=rel, abs=least, nan_ok=True), where
    else:
        assert now == kept, where
