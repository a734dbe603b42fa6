"""The study of a long stream in a short version: nothing lost, the offline filter's estimates, and
memory that does not grow; and that the committed result says so of a day.
"""

import json

import pytest

from tests.support.paths import ROOT
from windwrench.studies.live_stream.__main__ import FAULTS
from windwrench.studies.live_stream.long_stream import Faults, run_long

RESULT = json.loads((ROOT / "docs" / "live" / "live-stream.json").read_text(encoding="utf-8"))


def test_a_stream_in_order_is_the_offline_filter_to_the_end():
    found = run_long(0.05, 20.0, Faults(lost=0.01, doubled=0.01, silences=60.0))
    assert found["lost_on_the_way"] > 100
    assert found["doubled_on_the_way"] > 10
    assert found["estimates"] == found["messages_sent"] - found["doubled_on_the_way"]
    assert found["counts"] == {"doubled": found["doubled_on_the_way"]}
    assert found["largest_difference_from_offline"] < 1e-9


def test_a_stream_with_faults_loses_nothing_that_came(tmp_path):
    found = run_long(0.02, 100.0, FAULTS, tmp_path / "flight.csv")
    assert found["late_on_the_way"] > 100
    assert found["estimates"] == found["messages_sent"] - found["doubled_on_the_way"]
    assert found["recorded_rows"] == found["estimates"]
    assert set(found["counts"]) == {"late", "doubled"}


def test_of_a_day_too():
    day, faults = RESULT["long"], RESULT["faults"]
    assert day["hours"] == 24.0
    assert day["estimates"] == day["messages_sent"] == round(86_400 * day["rate_hz"]) + 1
    assert day["counts"] == {}
    assert day["largest_difference_from_offline"] < 1e-9
    assert day["memory_MB"]["growth_per_hour"] < 0.1
    assert faults["estimates"] == faults["messages_sent"] - faults["doubled_on_the_way"]
    assert faults["recorded_rows"] == faults["estimates"]


def test_the_tutorial_says_what_was_found():
    page = (ROOT / "docs" / "tutorials" / "live.md").read_text(encoding="utf-8")
    day = RESULT["long"]
    assert f"{day['estimates']:,} estimates" in page
    for one in RESULT["latency"]:
        own = one["arrival_to_estimate_ms"]
        assert f"{own['median']:.2f} ms" in page
        assert f"{own['p99']:.2f} ms" in page


@pytest.mark.parametrize("part", ["long", "faults", "latency"])
def test_the_result_is_whole(part):
    assert RESULT[part]
