"""Logs of kinds that were read wrongly, with their right readings."""

import numpy as np
import pytest
from tests.support.data_paths import data_file

from windwrench.dynamics import load_vehicle
from windwrench.identification.logs.map_guess import guess_map
from windwrench.identification.logs.reading import read_log
from windwrench.identification.logs.screening import screen_log
from windwrench.identification.logs.tables import open_table
from windwrench.runtime.errors import InputError


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
    with pytest.raises(InputError, match="motion capture alone, without motors"):
        open_table(data_file(f"hard_logs/{name}.csv.gz"))


def test_body_axes_turned_about_z_are_named():
    vehicle = load_vehicle("ardrone2")
    log = read_log(data_file("hard_logs/ned_quaternion_swapped.csv.gz"), vehicle=vehicle)
    with pytest.raises(InputError, match=r"right, forward, up.* take 0\.7071 \(qw - qz, qx \+ qy"):
        screen_log(log, vehicle)
