"""Which reader a log needs is told from what is in it, whatever its name."""

import sys
from pathlib import Path

import pytest

from tests.support.outcomes import refused
from windwrench.dynamics import InputError
from windwrench.identification.logs.reading import (
    READERS,
    find_reader,
    read_log,
    reader_by_columns,
    reader_by_content,
)

BEGINNINGS = {
    b"ULog\x01\x12\x35\x01": "px4_ulog",
    b"\xa3\x95\x80\x80": "ardupilot_bin",
    b"#ROSBAG V2.0\n": "rosbag",
    b"\x89MCAP0\r\n": "rosbag",
    b"SQLite format 3\0": "rosbag",
    b"\xbc\x02\x00\x01\x00": "crazyflie_sd",
    b"\xbc\x01\x00\x01\x00": "crazyflie_sd",
    b"H Product:Blackbox flight data recorder by Nicholas Sherlock\n": "betaflight",
}


@pytest.mark.parametrize("begins", BEGINNINGS)
@pytest.mark.parametrize("name", ["a", "a.csv", "a.bag"])
def test_the_first_bytes_decide_whatever_the_name(tmp_path, begins, name):
    (tmp_path / name).write_bytes(begins + bytes(20))
    assert reader_by_content(tmp_path / name).name == BEGINNINGS[begins]
    with pytest.raises(InputError):  # that reader's own words
        read_log(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "begins", "package"),
    [
        ("flight.ulg", b"ULog\x01\x12\x35\x01", "pyulog"),
        ("flight.bag", b"#ROSBAG V2.0\n", "rosbags"),
        ("flight.parquet", b"PAR1", "pyarrow"),
    ],
)
def test_a_missing_package_is_named(tmp_path, monkeypatch, name, begins, package):
    (tmp_path / name).write_bytes(begins)
    monkeypatch.setitem(sys.modules, package, None)
    with refused(rf"{name}: {package} is not installed; pip install 'windwrench\["):
        read_log(tmp_path / name)


@pytest.mark.parametrize("entry", ["metadata.yaml", "a.db3", "b.mcap"])
def test_the_folder_of_a_bag_is_known_by_what_is_in_it(tmp_path, entry):
    (tmp_path / entry).write_bytes(b"")
    assert reader_by_content(tmp_path) is READERS["rosbag"]


def test_a_table_that_fits_two_readers_is_refused():
    header = [*find_reader("racer").signature, *find_reader("nanobench").signature]
    with refused("--reader nanobench or --reader racer"):
        reader_by_columns(Path("a.csv"), header)
