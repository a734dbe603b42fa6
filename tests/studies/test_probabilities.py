"""What is said of probabilities follows from flights that are kept."""

from dataclasses import asdict

import pytest

from windwrench.identification.diagnosis.unknown import UNKNOWN
from windwrench.studies.kept_results import kept
from windwrench.studies.probabilities.__main__ import plan, plan_of_other_logs
from windwrench.studies.probabilities.calibration import RESULTS, flights_of
from windwrench.studies.probabilities.fitting import fit
from windwrench.studies.probabilities.flights import KINDS, WAYS_TO_LOG


def test_the_weights_in_use_are_those_of_the_kept_flights():
    found = fit(flights_of(kept(RESULTS["first"])))
    for name, value in asdict(UNKNOWN).items():
        assert getattr(found, name) == pytest.approx(value, abs=0.02), name


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
