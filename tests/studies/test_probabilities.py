"""What is said of probabilities follows from flights that are kept, and no flight knows its own
weights.
"""

from dataclasses import asdict

import pytest

from windwrench.identification.posterior.pooling import POOLING, SEARCH_ALONE
from windwrench.studies.kept_results import kept
from windwrench.studies.probabilities.__main__ import plan, plan_of_other_logs
from windwrench.studies.probabilities.calibration import (
    RESULTS,
    half_of,
    weights_without_posterior,
)
from windwrench.studies.probabilities.fitting import fit
from windwrench.studies.probabilities.flights import KINDS, WAYS_TO_LOG


@pytest.fixture(scope="module")
def records():
    return kept(RESULTS["first"])


def test_the_weights_in_use_are_those_of_the_kept_flights(records):
    found = weights_without_posterior(kept(RESULTS["other logs"]), records)
    found["with a posterior"] = fit([r["result"] for r in records])
    for kind, weights in {**SEARCH_ALONE, "with a posterior": POOLING}.items():
        for name, value in asdict(weights).items():
            assert getattr(found[kind], name) == pytest.approx(value, abs=0.02), (kind, name)


def test_either_half_has_all_kinds():
    tasks = [{"task": task} for task in plan(40, 40, 800_000, 3000, "other.py")]
    for half in (0, 1):
        assert {t["task"][1] for t in tasks if half_of(t) == half} >= {*KINDS, "catalogue"}


def test_a_run_has_flights_of_both_and_none_twice():
    tasks = plan(20, 20, 0, 3, "other.py")
    assert len(set(tasks)) == len(tasks)
    assert {t[1] for t in tasks if t[0] == "own"} >= {"single", "pair", "nothing", "left out"}
    assert {t[1] for t in tasks if t[0] == "other.py"} == {"catalogue", "left out"}


def test_other_logs_are_of_all_ways_and_none_is_flown_twice():
    tasks = plan_of_other_logs(20, 0, 1000, "other.py")
    assert len(set(tasks)) == len(tasks) == 60
    assert {t[3] for t in tasks} == set(WAYS_TO_LOG[1:])
    assert {t[3] for t in tasks if t[0] == "other.py"} == {"filtered"}
    assert {t[1] for t in tasks if t[0] == "own"} == set(KINDS)
