"""Whole measured flights, and the benchmark of half a second of flight. Excerpts, which every clone
has, are diagnosed in ``tests/identification/test_measured_excerpts.py``.
"""

import pytest

from tests.support.data_paths import crazyswarm2_file, data_file
from tests.support.parameters import mostly_slow
from windwrench.dynamics import load_vehicle
from windwrench.evidence.kept_results import DOCS, kept
from windwrench.evidence.measured_flights import CARRIER, payload_vehicle
from windwrench.evidence.nanodrone_benchmark import section, study
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.diagnosis.commanded_rotors import in_flight
from windwrench.identification.logs.reading import read_log

VEHICLE = load_vehicle("crazyflie")


@pytest.mark.measured
@pytest.mark.parametrize("number", mostly_slow(["202", "201", "165"], lambda n: n != "201"))
def test_slung_payload(number):
    carrier = payload_vehicle(0.032 if number == "165" else CARRIER)
    log = read_log(crazyswarm2_file(number), "crazyswarm2", carrier)
    diagnosis = diagnose([log], carrier)
    named = {e.name: e for e in diagnosis.effects}
    if number == "165":
        assert "slung_payload" not in named
        assert all("slung_payload" not in e.indistinguishable_from for e in diagnosis.effects)
        return
    load = named["slung_payload"]
    assert 0.002 < load.coefficients["m"] < 0.009
    assert load.coefficients["l"] == 0.5
    assert load.indistinguishable_from == () or number != "202"


@pytest.mark.measured
def test_only_the_time_in_the_air_counts():
    log = read_log(data_file("nanobench/B2_circle_fast_rep3.csv"), "nanobench", VEHICLE)
    flight = in_flight(log, VEHICLE)
    assert 29 < flight.t[-1] - flight.t[0] < 33
    assert flight.position[:, 2].min() > 0.4
    assert len(flight.voltage) == len(flight.t) == len(flight.valid)


def test_the_page_shows_the_kept_results():
    text = section(kept("identify/nanodrone.json"))
    assert text in (DOCS / "identify.md").read_text(encoding="utf-8")


def test_without_the_flights_the_study_says_so(tmp_path, capsys):
    study(tmp_path, None, tmp_path / "out.json")
    assert "skipped" in capsys.readouterr().out
    assert not (tmp_path / "out.json").exists()
