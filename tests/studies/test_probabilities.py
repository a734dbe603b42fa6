"""What is said of probabilities follows from flights that are kept, and no flight knows its own
weights.
"""

import json
from dataclasses import asdict

import numpy as np
import pytest

from windwrench.identification.findings import Probabilities
from windwrench.identification.posterior.pooling import POOLING, SEARCH_ALONE
from windwrench.studies.pages import kept
from windwrench.studies.probabilities.__main__ import plan, plan_of_other_logs
from windwrench.studies.probabilities.calibration import (
    RESULTS,
    Scored,
    cross_fitted,
    error_of_perfect_calibration,
    expected_calibration_error,
    half_of,
    weights_without_posterior,
)
from windwrench.studies.probabilities.fitting import (
    acts_unknown,
    fit,
    is_right,
    signs_of,
)
from windwrench.studies.probabilities.flights import KINDS, WAYS_TO_LOG


def flight(named, truth, outsider="", left_out=(), sets=None, remainder="none", structure=-1.0):
    return {
        "truth": {e: {} for e in truth},
        "outsider": outsider,
        "left_out": list(left_out),
        "named": [
            {"name": e.strip("?"), "tentative": "?" in e, "indistinguishable_from": []}
            for e in named
        ],
        "remainder": remainder,
        "sets": sets or [[[e.strip("?") for e in named], 1.0]],
        "structure": structure,
        "gusts": [],
        "weight": [4.56, 0.126],
        "signs": [],
        "doubts": {},
    }


@pytest.fixture(scope="module")
def records():
    return kept(RESULTS["first"])


def test_the_weights_in_use_are_those_of_the_kept_flights(records):
    found = weights_without_posterior(kept(RESULTS["other logs"]), records)
    found["with a posterior"] = fit([r["result"] for r in records])
    for kind, weights in {**SEARCH_ALONE, "with a posterior": POOLING}.items():
        for name, value in asdict(weights).items():
            assert getattr(found[kind], name) == pytest.approx(value, abs=0.02), (kind, name)


def test_what_is_right():
    assert is_right(flight(["mass"], ["mass"]), "mass")
    assert is_right(flight(["clock_offset"], ["latency"]), "clock_offset")  # exact equivalents
    assert not is_right(flight(["mass"], ["inertia"]), "mass")
    assert not is_right(flight(["mass"], ["inertia"], left_out=["inertia"]), "mass")
    assert not is_right(flight(["mass"], [], outsider="tether"), "mass")


def test_weights_follow_who_was_right():
    agree = [flight(["mass"], ["mass"], sets=[[["mass"], 0.9], [[], 0.1]]) for _ in range(20)]
    strange = [
        flight(["wind?"], [], "tether", remainder="structured", structure=12.0) for _ in range(20)
    ]
    for x in strange:
        x["doubts"] = {"composite": 1, "small beside the residual": 1}
    found = fit([*agree, *strange])
    assert found.sure > 2.0
    assert found.unknown < -1.0 < 1.0 < found.doubts
    assert signs_of(strange[0]).doubts == 1


def test_calibration_of_made_up_claims():
    right = [(0.9, True)] * 9 + [(0.9, False)]
    assert expected_calibration_error(right) == pytest.approx(0.0)
    assert expected_calibration_error([(0.9, False)] * 10) == pytest.approx(0.9)
    assert 0.01 < error_of_perfect_calibration(right) < 0.15


def test_a_log_score_counts_what_nobody_named():
    missed = Scored(True, flight([], ["mass"]), Probabilities({}, (), 0.1))
    named = Scored(True, flight(["mass"], ["mass"]), Probabilities({"mass": 0.9}, (), 0.1))
    assert missed.log_score() == pytest.approx(np.log(1e-3))
    assert named.log_score() == pytest.approx(np.log(0.9))


def test_either_half_has_all_kinds():
    tasks = [{"task": task} for task in plan(40, 40, 800_000, 3000, "other.py")]
    for half in (0, 1):
        assert {t["task"][1] for t in tasks if half_of(t) == half} >= {*KINDS, "catalogue"}


def test_what_a_log_does_not_show_is_unknown_to_it():
    pair = {**flight(["mass", "wind"], ["mass", "wind"]), "hidden": ["wind"]}
    assert acts_unknown(pair)
    assert is_right(pair, "mass")
    assert not is_right(pair, "wind")


def test_a_run_has_flights_of_both_and_none_twice():
    tasks = plan(20, 20, 0, 3, "other.py")
    assert len(set(tasks)) == len(tasks)
    assert {t[1] for t in tasks if t[0] == "own"} >= {"single", "pair", "nothing", "left out"}
    assert {t[1] for t in tasks if t[0] == "other.py"} == {"catalogue", "left out"}


def test_each_half_is_scored_by_the_other(records):
    changed = [json.loads(json.dumps(r)) for r in records]
    for r in changed:
        if half_of(r):
            r["result"]["truth"] = {}
    for r, a, b in zip(records, cross_fitted(records), cross_fitted(changed), strict=True):
        same = a.found.unknown == b.found.unknown
        assert same == bool(half_of(r))  # the half that did not change gave its weights


def test_other_logs_are_of_all_ways_and_none_is_flown_twice():
    tasks = plan_of_other_logs(20, 0, 1000, "other.py")
    assert len(set(tasks)) == len(tasks) == 60
    assert {t[3] for t in tasks} == set(WAYS_TO_LOG[1:])
    assert {t[3] for t in tasks if t[0] == "other.py"} == {"filtered"}
    assert {t[1] for t in tasks if t[0] == "own"} == set(KINDS)
