"""Logs of kinds that were read wrongly, with what ``tests/golden/logs.json`` does not keep."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.data_paths import data_file
from tests.support.hostile_conventions import (
    DOWN,
    ONE,
    conjugate,
    framed,
    permuted,
)
from tests.support.outcomes import noted, refused
from windwrench.dynamics import load_vehicle
from windwrench.identification.logs.clocks import on_one_clock
from windwrench.identification.logs.flight_log import with_rows
from windwrench.identification.logs.inertial import check_inertial
from windwrench.identification.logs.reading import read_log
from windwrench.identification.logs.screening import screen_log
from windwrench.identification.report.log_check import check_log


@pytest.mark.parametrize("name", ["actuator_only", "matlab_struct.mat"])
def test_rotor_speeds_are_in_rad_s(name):
    log = read_log(data_file(f"hard_logs/{name}"), vehicle=load_vehicle("ardrone2"))
    assert 360.0 < np.median(log.rotor_speeds) < 420.0


def test_rounded_rotor_speeds_of_a_smooth_flight_come_with_each_row():
    log = read_log(data_file("hard_logs/perfect_model_smooth_rounded.csv.gz"))
    assert log.motor_rate == pytest.approx(1.0 / log.period)


@pytest.fixture(scope="module")
def mended_log():
    """A log of a late IMU, mended."""
    log = read_log(data_file("hard_logs/imu_clock_late.csv.gz"), vehicle=load_vehicle("ardrone2"))
    assert noted(log, "the IMU is 0.119 s late")  # 0.12 s
    return with_rows(log, np.isfinite(log.gyro[:, 0]))


LATE = (-30, 3)  # rows


@pytest.mark.parametrize(
    ("whose", "names", "rows"),
    [
        *(("IMU", ("gyro", "accelerometer"), rows) for rows in LATE),
        ("IMU", ("accelerometer",), 6),
        *(("pose", ("position", "quaternion"), rows) for rows in LATE),
    ],
)
def test_a_late_clock_is_found_and_mended(mended_log, whose, names, rows):
    log = mended_log if len(names) > 1 else replace(mended_log, gyro=None)
    late = replace(log, **{name: np.roll(getattr(log, name), rows, axis=0) for name in names})
    mended, notes = on_one_clock(late, load_vehicle("ardrone2"))
    said = float(notes[0].split(" s ")[0].split()[-1])
    assert said == pytest.approx(abs(rows) * log.period, abs=0.003)
    if abs(rows) * log.period < 0.02:  # the rotors do not tell
        assert notes[0].endswith("the IMU was moved")
        return
    assert notes[0].endswith(f"the {whose} was moved")
    inside = slice(60, -60)
    for name in names:
        off = getattr(mended, name)[inside] - getattr(log, name)[inside]
        assert np.median(np.abs(off)) < 0.02 * np.ptp(getattr(log, name)[inside])


def test_an_imu_whose_clock_jumps_is_left_out(mended_log):
    gyro = mended_log.gyro.copy()
    gyro[2000:] = np.roll(gyro, 10, axis=0)[2000:]
    log, notes = on_one_clock(replace(mended_log, gyro=gyro), None)
    assert log.gyro is None
    assert "s in turn against the pose" in notes[0]


def test_a_simulation_that_blew_up_is_no_flight_in_milli_g():
    log = read_log(data_file("hard_logs/perfect_model_gusts_10mN_imu.csv.gz"))
    growth = 0.3 * np.exp(np.minimum(log.t, 12.0))
    tumbling = np.sin(np.multiply.outer(log.t, [40.0, 37.0, 43.0]))
    wrong = replace(log, accelerometer=log.accelerometer + growth[:, None] * tumbling)
    checked, (note,) = check_inertial(wrong)
    assert "in changing directions" in note
    assert checked.accelerometer is None
    _, (note,) = check_inertial(replace(log, accelerometer=log.accelerometer * 1e3 / 9.80665))
    assert "look like milli-g" in note


NORTH_EAST_DOWN = np.array(
    [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]
)  # from east, north, up


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (
            lambda log: framed(log, ONE, NORTH_EAST_DOWN, DOWN),
            r"attitude is north, east, down .* but the position east, north, up",
        ),
        (
            lambda log: permuted(conjugate(log), [3, 1, 0, 2]),
            r"quaternion is world to body; .* \(qw, qx, qy, qz\); the rotors .* 4,2,1,3 .*px4-x",
        ),
    ],
)
def test_an_advice_leaves_a_consistent_log(change, expected):
    """One remedy would lead to a second refusal; the line names both."""
    vehicle = load_vehicle("ardrone2")
    log = read_log(data_file("hard_logs/perfect_model_gusts_10mN.csv.gz"), vehicle=vehicle)
    with refused(expected):
        screen_log(change(with_rows(log, log.t < 15.0)), vehicle)


@pytest.mark.parametrize(
    ("name", "doubt"),
    [
        ("ned_quaternion_swapped.csv.gz", "the body axes are right, forward, up"),
        ("perfect_model_gusts_30mN.csv.gz", ""),
    ],
)
def test_a_convention_is_checked_without_a_vehicle(name, doubt):
    doubts = check_log(data_file(f"hard_logs/{name}")).doubts
    said = [text for text in doubts if "As logged, the motion contradicts" in text]
    assert len(said) == bool(doubt)
    assert all(doubt in text for text in said)
