"""Which logs a fleet has, which vehicle flew each, and outcomes on the disk."""

import json

import pytest

from windwrench.dynamics import InputError, dump_vehicle, load_vehicle
from windwrench.identification.fleet.flight import diagnose_one, key_of
from windwrench.identification.fleet.manifest import MANIFEST, FleetLog, find_logs
from windwrench.identification.fleet.outcomes import Outcomes


@pytest.fixture
def folder(tmp_path):
    """Logs of two individuals and one loose log, beside things that are none."""
    for name in (
        "alpha/flight10.csv",
        "alpha/flight9.csv",
        "beta/day1/a.csv.gz",
        "beta/b.ulg",
        "loose.parquet",
        "notes.txt",
        ".hidden/x.csv",
        "out/fleet.csv",
        "bag/metadata.yaml",
        "bag/bag_0.mcap",
    ):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"ULog\x01\x12\x35" if name == "beta/b.ulg" else b"")
    (tmp_path / "beta" / "vehicle.yaml").write_text(dump_vehicle(load_vehicle("crazyflie")))
    return tmp_path


def test_logs_are_found_in_folders_with_their_individuals(folder):
    logs, doubts = find_logs([folder], without=folder / "out")
    assert [(log.name, log.id) for log in logs] == [
        ("alpha/flight9.csv", "alpha"),
        ("alpha/flight10.csv", "alpha"),
        ("bag", ""),
        ("beta/b.ulg", "beta"),
        ("beta/day1/a.csv.gz", "beta"),
        ("loose.parquet", ""),
    ]
    assert doubts == []
    beside = str(folder / "beta" / "vehicle.yaml")
    assert [log.vehicle for log in logs] == [None, None, None, beside, beside, None]
    logs, _ = find_logs([folder], vehicle="ardrone2", without=folder / "out")
    assert {log.vehicle for log in logs} == {"ardrone2"}
    logs, _ = find_logs([folder / "alpha", folder / "alpha" / "flight9.csv"])
    assert len(logs) == 2  # none twice


@pytest.mark.parametrize("form", ["yaml", "csv"])
def test_a_manifest_says_what_logs_do_not(folder, form):
    if form == "yaml":
        path = folder / "fleet.yaml"  # found by itself
        path.write_text(
            "logs:\n"
            "  - {log: 'alpha/*9.csv', vehicle: beta/vehicle.yaml, id: A, session: a,\n"
            "     time: 2026-03-01T10:00}\n"
            "  - {log: 'alpha/*', vehicle: hummingbird, time: 7}\n"
            "  - {log: 'gamma/*', vehicle: hummingbird}\n"
            "  - {log: '*.ulg', reader: px4_ulog}\n"
        )
    else:
        path = folder / "list.csv"
        path.write_text(
            "log,vehicle,id,reader,time,session\n"
            "alpha/*9.csv,beta/vehicle.yaml,A,,2026-03-01T10:00,a\n"
            "alpha/*,hummingbird,,,7,\n"
            "gamma/*,hummingbird,,,,\n"
            "*.ulg,,,px4_ulog,,\n"
        )
    logs, doubts = find_logs([folder], None if form == "yaml" else path, without=folder / "out")
    found = {log.name: log for log in logs}
    nine, ten = found["alpha/flight9.csv"], found["alpha/flight10.csv"]
    assert (nine.id, nine.session, nine.vehicle, nine.time) == (
        "A",
        "a",
        str(folder / "beta/vehicle.yaml"),
        1772359200.0,
    )
    assert (ten.id, ten.vehicle, ten.time) == ("alpha", "hummingbird", 7.0)
    assert found["beta/b.ulg"].reader == "px4_ulog"
    assert found["beta/b.ulg"].vehicle == str(folder / "beta" / "vehicle.yaml")
    assert len(doubts) == 1
    assert "gamma/*" in doubts[0]


def test_a_map_stands_in_place_of_a_reader(folder):
    (folder / "own.yaml").write_text(
        "time: {column: t}\n"
        "position: {columns: [x, y, z]}\n"
        "attitude: {columns: [q0, q1, q2, q3], order: wxyz}\n"
        "rotors: {columns: [a, b, c, d], unit: rpm, order: windwrench}\n"
    )
    (folder / MANIFEST).write_text('logs: [{log: "alpha/*", map: own.yaml}]')
    logs, doubts = find_logs([folder], reader="nanobench", without=folder / "out")
    assert doubts == []
    found = {log.name: (log.reader, log.map) for log in logs}
    assert found["alpha/flight9.csv"] == (None, str(folder / "own.yaml"))
    assert found["loose.parquet"] == ("nanobench", None)
    (folder / MANIFEST).write_text('logs: [{log: "alpha/*", map: absent.yaml}]')
    with pytest.raises(InputError, match=r"absent\.yaml"):
        find_logs([folder], without=folder / "out")


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
    found = diagnose_one(FleetLog("a.csv", "a.csv"), ())
    assert (found["status"], found["kind"]) == ("refused", kind)
    assert "\n" not in found["reason"]
    assert kind != "error" or "ZeroDivisionError (test_logs_and_outcomes.py" in found["reason"]
