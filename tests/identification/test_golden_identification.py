"""What identification says of made flights is what it said before."""

import json

import pytest

from tests.support.golden_identification import GOLDEN, made


def alike(now, kept, where=""):
    if isinstance(kept, dict):
        assert now.keys() == kept.keys(), where
        for key in kept:
            alike(now[key], kept[key], f"{where}/{key}")
    elif isinstance(kept, list):
        assert len(now) == len(kept), where
        for i, (a, b) in enumerate(zip(now, kept, strict=True)):
            alike(a, b, f"{where}/{i}")
    elif isinstance(kept, float):
        # solvers of other processors order sums otherwise
        assert now == pytest.approx(kept, rel=1e-4, abs=1e-9), where
    else:
        assert now == kept, where


def test_results_are_those_kept():
    alike(json.loads(json.dumps(made())), json.loads(GOLDEN.read_text(encoding="utf-8")))
