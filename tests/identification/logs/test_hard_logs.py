"""Logs of kinds that were read wrongly, with their right readings."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.data_paths import data_file
from tests.support.outcomes import refused
from windwrench.dynamics import load_vehicle
from windwrench.identification.logs.flight_log import with_rows
from windwrench.identification.logs.inertial import on_one_clock
from windwrench.identification.logs.map_guess import guess_map
from windwrench.identification.logs.reading import read_log
from windwrench.identification.logs.screening import screen_log
from windwrench.identification.logs.text_table import open_table


@pytest.mark.parametrize(
    "name", ["actuator_only", "bf_erpm100_names.bbl", "px4_gz_rads_as_rpm.ulg", "matlab_struct.mat"]
)
def test_rotor_speeds_are_in_rad_s(name):
    log = read_log(data_file(f"hard_logs/{name}"), vehicle=load_vehicle("ardrone2"))
    assert 360.0 < np.median(log.rotor_speeds) < 420.0


def test_rounded_times_are_even():
    log = read_log(data_file("hard_logs/time_two_decimals.csv.gz"))
    assert np.ptp(np.diff(log.t)) < 1e-9
    assert log.period == pytest.approx(0.005, rel=1e-3)


def test_rounded_rotor_speeds_of_a_smooth_flight_come_with_each_row():
    log = read_log(data_file("hard_logs/perfect_model_smooth_rounded.csv.gz"))
    assert log.motor_rate == pytest.approx(1.0 / log.period)


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("excel_time.csv.gz", "column time is 1.7e+09 in nearly every row"),
        ("asctec_plus.csv.gz", "a plus, motors 1 front, 2 rear, 3 left, 4 right"),
    ],
)
def test_a_guess_says_why(name, line):
    guess = guess_map(open_table(data_file(f"hard_logs/{name}")))
    assert line in f"{guess.lacks} {[reason.why for reason in guess.reasons]}"


@pytest.mark.parametrize("name", ["motive_take", "vicon_nexus"])
def test_motion_capture_alone_is_named(name):
    with refused("motion capture alone, without motors"):
        open_table(data_file(f"hard_logs/{name}.csv.gz"))


def test_body_axes_turned_about_z_are_named():
    vehicle = load_vehicle("ardrone2")
    log = read_log(data_file("hard_logs/ned_quaternion_swapped.csv.gz"), vehicle=vehicle)
    with refused(r"right, forward, up.* take 0\.7071 \(qw - qz, qx \+ qy"):
        screen_log(log, vehicle)


@pytest.mark.parametrize("rows", [-30, -16, -3, 3, 6, 30])
@pytest.mark.parametrize("whose", ["IMU", "pose"])
def test_a_late_clock_is_found_and_mended(whose, rows):
    log = read_log(data_file("hard_logs/imu_clock_late.csv.gz"), vehicle=load_vehicle("ardrone2"))
    assert any("the IMU is 0.119 s late" in note for note in log.notes)  # 0.12 s, and mended
    log = with_rows(log, np.isfinite(log.gyro[:, 0]))
    names = ["gyro", "accelerometer"] if whose == "IMU" else ["position", "quaternion"]
    late = replace(log, **{name: np.roll(getattr(log, name), rows, axis=0) for name in names})
    mended, notes = on_one_clock(late, load_vehicle("ardrone2"))
    said = float(notes[0].split(" s ")[0].split()[-1])
    assert said == pytest.approx(abs(rows) * log.period, abs=0.003)
    if abs(rows) * log.period < 0.06:  # the rotors do not tell
        assert notes[0].endswith("the IMU was moved")
        return
    assert notes[0].endswith(f"the {whose} was moved")
    inside = slice(60, -60)
    for name in names:
        off = getattr(mended, name)[inside] - getattr(log, name)[inside]
        assert np.median(np.abs(off)) < 0.02 * np.ptp(getattr(log, name)[inside])
