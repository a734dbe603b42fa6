"""Which logs a fleet has, and which vehicle flew each."""

import pytest

from windwrench.dynamics import InputError, dump_vehicle, load_vehicle
from windwrench.identification.fleet.manifest import MANIFEST, find_logs


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
