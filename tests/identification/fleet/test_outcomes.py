"""Outcomes on the disk: appended whole, found again, torn lines count for nothing."""

import json

import pytest

from windwrench.dynamics import InputError
from windwrench.identification.fleet.flight import diagnose_one, key_of
from windwrench.identification.fleet.manifest import FleetLog
from windwrench.identification.fleet.outcomes import Outcomes

A, B, C = ("0a" * 16, "0b" * 16, "0c" * 16)


def test_outcomes_are_found_again(tmp_path):
    path = tmp_path / "outcomes.jsonl"
    first = Outcomes(path)
    first.add({"key": A, "status": "diagnosed", "notes": ["°"]})
    first.add({"key": B, "status": "refused"})
    assert first[A]["notes"] == ["°"]  # while it is written to
    first.add({"key": A, "status": "refused"})
    assert (first[A]["status"], len(first)) == ("refused", 2)
    again = Outcomes(path)
    assert again[A]["status"] == "refused"
    assert B in again
    assert C not in again


def test_a_torn_line_costs_one_outcome_alone(tmp_path):
    path = tmp_path / "outcomes.jsonl"
    whole = [json.dumps({"key": key, "status": "diagnosed"}) for key in (A, B)]
    path.write_text("\n".join([whole[0], "[1]", "{}", '{"key": 3, "status": ""}', whole[1][:20]]))
    outcomes = Outcomes(path)
    assert A in outcomes
    assert B not in outcomes
    outcomes.add({"key": C, "status": "refused"})
    again = Outcomes(path)
    assert (again[A]["status"], again[C]["status"]) == ("diagnosed", "refused")


def test_what_cannot_be_written_is_named(tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        Outcomes(tmp_path)
    with pytest.raises(ValueError, match="not JSON compliant"):
        Outcomes(tmp_path / "a").add({"key": A, "status": "diagnosed", "x": float("nan")})


def test_the_key_is_of_all_that_an_outcome_depends_on(tmp_path):
    path, other = tmp_path / "a.csv", tmp_path / "b.csv"
    path.write_text("1")
    other.write_text("1")

    def key(file=path, without=(), **given):
        return key_of(FleetLog(str(file), "a", **given), without)

    assert key() == key() == key(other) == key(id="x", time=3.0)
    keys = {key(), key(vehicle="ardrone2"), key(vehicle="crazyflie"), key(reader="nanobench")}
    keys |= {key(without=("mass",)), key(reader="nanobench", without=("mass",))}
    keys.add(key(piece=2))
    assert len(keys) == 7
    path.write_text("2")
    assert key() not in keys
    with pytest.raises(InputError, match=r"gone\.csv: is no regular file"):
        key(tmp_path / "gone.csv")


@pytest.mark.parametrize(
    ("error", "kind"), [(MemoryError(), "memory"), (ZeroDivisionError("a\nb"), "error")]
)
def test_an_error_of_any_kind_is_an_outcome(monkeypatch, error, kind):
    def fails(*_):
        raise error

    monkeypatch.setattr("windwrench.identification.fleet.flight.read_log", fails)
    found = diagnose_one(FleetLog("a.csv", "a.csv"))
    assert (found["status"], found["kind"]) == ("refused", kind)
    assert "\n" not in found["reason"]
    assert kind != "error" or "ZeroDivisionError (test_outcomes.py" in found["reason"]
