"""Blackboxes of Betaflight: synthetic ones, decoded by this kit and, where it is installed,
by orangebox.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.support.blackbox_writer import FIELDS, LEAST_MOTOR, blackbox, flight
from tests.support.outcomes import noted, refused
from windwrench.identification.logs.reading import read_log

COUNT = 400
G = 9.80665


def column(rows, name):
    return np.array(
        [[row[f"{name}[{i}]"] for i in range(4 if name in "motor eRPM" else 3)] for row in rows]
    )


def test_a_blackbox_is_read_field_by_field(write):
    rows = flight()
    log = read_log(write(blackbox(rows)))
    assert not log.has_pose
    t = np.array([row["time"] for row in rows])
    assert_allclose(log.t, 1e-6 * (t - t[0]), atol=1e-9)
    assert_allclose(log.gyro, np.radians(column(rows, "gyroADC")), atol=1e-12)
    assert_allclose(log.accelerometer, column(rows, "accSmooth") * G / 2048, atol=1e-9)
    ours = [3, 2, 0, 1]  # Betaflight's motors, from 0, front-left first
    command = (column(rows, "motor")[:, ours] - LEAST_MOTOR) / (2047 - LEAST_MOTOR)
    assert_allclose(log.command, command, atol=1e-12)
    speeds = column(rows, "eRPM")[:, ours] * 200 / 14 * 2 * np.pi / 60
    assert_allclose(log.rotor_speeds, speeds, rtol=1e-12)
    assert_allclose(log.voltage, [0.01 * row["vbatLatest"] for row in rows])
    assert noted(log, "motor_poles of the header")


@pytest.mark.parametrize(
    ("header", "bits", "scale"),
    [
        ("gyro_scale", "0x3f800000", 1.0),  # Betaflight
        ("gyro_scale", "0x3d79c190", 0.06098),  # Cleanflight: degrees per second a count
        ("gyro.scale", "0x3092419a", 1.0642e-9 * 1e6 * np.degrees(1.0)),  # rad/us
        ("gyro_scale", "none", 1.0),
    ],
)
def test_counts_of_a_gyro_have_the_size_that_the_header_says(write, header, bits, scale):
    rows = flight(100)
    log = read_log(write(blackbox(rows, {header: bits})))
    wanted = scale * np.radians(column(rows, "gyroADC"))
    assert_allclose(log.gyro, wanted, rtol=1e-3, atol=1e-12)


def test_pulses_lie_between_the_throttles_that_the_header_says(write):
    old = {"motorOutput": "", "minthrottle": "150", "maxthrottle": "1850"}
    log = read_log(write(blackbox(flight(100), old)))
    assert noted(log, "150 to 1850 (minthrottle and maxthrottle of the header)")


def test_the_magnet_poles_are_an_option(write):
    path = write(blackbox(flight(60)))
    speeds = read_log(path).rotor_speeds
    assert_allclose(read_log(path, "betaflight:28").rotor_speeds, 0.5 * speeds)


def test_orangebox_decodes_the_same(write):
    orangebox = pytest.importorskip("orangebox", reason="pip install orangebox")
    rows = flight(seed=3)
    path = write(blackbox(rows, variable=False))  # orangebox lacks that encoding
    parser = orangebox.Parser.load(str(path))
    frames = [frame.data[: len(FIELDS)] for frame in parser.frames()]
    assert frames == [tuple(row[name] for name in FIELDS) for row in rows]
    assert len(read_log(path).t) == len(frames)


def test_what_is_damaged_is_left_out_until_the_next_whole_frame(write):
    rows = flight()
    data = bytearray(blackbox(rows))
    for place in range(len(data) // 2, len(data) // 2 + 40):
        data[place] = 0
    log = read_log(write(bytes(data)))
    assert 0.8 * COUNT < len(log.t) < COUNT
    assert noted(log, "could not be decoded")
    cut = read_log(write(blackbox(rows)[: 3 * len(data) // 4]))
    assert 0.6 * COUNT < len(cut.t) < 0.9 * COUNT


def test_the_longest_of_several_logs_is_read(write):
    log = read_log(write(blackbox(flight(50)) + blackbox(flight(200)) + blackbox(flight(20))))
    assert len(log.t) == 200
    assert noted(log, "3 logs; number 2 was read")


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (
            (b"H Field P encoding:9", b"H Field P encoding:5"),
            "header Field P encoding: 5; expected",
        ),
        ((b"H Field P encoding:9,", b"H Field P encoding:"), "expected as many as the 30 names"),
        ((b"Data version:2", b"Data version:1"), "header Data version: '1'; expected 2"),
        ((b"motorOutput:158,2047", b"motorOutput:a"), "header motorOutput: 'a'; expected two"),
        ((b"S\x03\x01", b""), None),
    ],
)
def test_headers_that_say_something_else_are_named(write, change, expected):
    path = write(blackbox(flight(60)).replace(*change))
    if expected is None:
        assert len(read_log(path).t) == 60
        return
    with refused(f"log03: .*{expected}"):
        read_log(path)


def table(rows, path, units=("", ""), erpm=False):
    """Write what blackbox_decode writes, with a space behind each comma."""
    names = {name: name for name in FIELDS if erpm or "eRPM" not in name}
    names["time"] = "time (us)"
    names["vbatLatest"] = "vbatLatest (V)"
    names |= {f"accSmooth[{i}]": f"accSmooth[{i}]{units[0]}" for i in range(3)}
    names |= {f"gyroADC[{i}]": f"gyroADC[{i}]{units[1]}" for i in range(3)}
    lines = [", ".join([*names.values(), "flightModeFlags (flags)"])]
    for row in rows:
        fields = [
            f"{0.01 * row[name]:.2f}" if name == "vbatLatest" else str(row[name]) for name in names
        ]
        lines.append(", ".join([*fields, "ARM|ANGLE"]))
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_table_of_blackbox_decode_is_the_same_log(tmp_path, write):
    rows = flight(600)
    whole = read_log(write(blackbox(rows)))
    log = read_log(table(rows, tmp_path / "LOG00001.01.csv", erpm=True))
    assert "reader betaflight_csv" in log.source
    for name in ("t", "gyro", "accelerometer", "rotor_speeds", "voltage"):
        assert_allclose(getattr(log, name), getattr(whole, name), atol=1e-6)
    assert noted(log, "2048 counts taken as 1 g")
    assert noted(log, "14 magnet poles (assumed")
    # without headers DShot's whole range is assumed
    motors = column(rows, "motor")[:, [3, 2, 0, 1]]
    assert_allclose(log.command, (motors - 48) / 1999, atol=1e-9)
    commands = read_log(table(rows, tmp_path / "b.csv"))
    assert not commands.has_rotor_speeds
    assert commands.command is not None


def test_stated_units_are_taken(tmp_path):
    log = read_log(table(flight(60), tmp_path / "a.csv", units=(" (m/s2)", " (rad/s)")))
    assert_allclose(log.accelerometer[0], [0, 0, 2048])  # as the column says
