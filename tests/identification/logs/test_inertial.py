"""Inertial sensors in a log: read whole or not at all, and left out where the pose contradicts
them.
"""

import re
from dataclasses import replace
from math import nan, pi

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from tests.support.flown import without_pose
from tests.support.hostile_conventions import scaled
from tests.support.imu_flights import imu_flight
from tests.support.vehicles import VEHICLE
from windwrench.identification.logs.flight_log import with_rows, write_log
from windwrench.identification.logs.inertial import check_inertial
from windwrench.identification.logs.reading import read_log

FRD = np.array([1.0, -1.0, -1.0])


@pytest.fixture(scope="module")
def log():
    """A log with a biased, noisy IMU in every row."""
    return replace(imu_flight(VEHICLE, (), 6.0), source="flight.csv")


@pytest.mark.parametrize("trajectory", ["hover", "excite"])
@pytest.mark.parametrize("seconds", [1.0, 6.0])
def test_honest_sensors_pass(trajectory, seconds):
    log = imu_flight(VEHICLE, (), seconds, trajectory)
    checked, notes = check_inertial(log)
    assert notes == ()
    assert checked is log


@pytest.mark.parametrize("gravity", [9.81, 0.0])
def test_an_acceleration_in_world_axes_is_turned_into_body_axes(log, gravity):
    turn = Rotation.from_quat(log.quaternion, scalar_first=True)
    world = turn.apply(log.accelerometer) - [0.0, 0.0, 9.81 - gravity]
    checked, notes = check_inertial(replace(log, accelerometer=world))
    assert "in world axes" in notes[0]
    assert_allclose(checked.accelerometer, log.accelerometer, atol=1e-9)


WRONG = {
    "gyro": {
        "degrees per second; expected rad/s": 180 / pi,
        "forward, right, down": FRD,
        "degrees per second.*forward, right, down": 180 / pi * FRD,
        "inverted": -1.0,
        "contradict the attitude's rate": [0.0, 0.0, 3.0],
    },
    "accelerometer": {
        "look like g; expected m/s2": 1 / 9.80665,
        "forward, right, down": FRD,
        "look like g.*forward, right, down": FRD / 9.80665,
        "inverted": -1.0,
        "contradict the position": 3.0,
    },
}


@pytest.mark.parametrize(
    ("sensor", "words", "factor"),
    [(sensor, words, factor) for sensor, cases in WRONG.items() for words, factor in cases.items()],
)
def test_wrong_sensors_are_left_out(log, sensor, words, factor):
    other = "gyro" if sensor == "accelerometer" else "accelerometer"
    checked, (note,) = check_inertial(scaled(log, **{sensor: factor}))
    assert re.search(f"{words}.*They were left out", note)
    assert getattr(checked, sensor) is None
    assert_array_equal(getattr(checked, other), getattr(log, other))


@pytest.mark.parametrize("sensor", ["gyro", "accelerometer"])
def test_units_are_told_in_a_short_hover(sensor):
    log = imu_flight(VEHICLE, (), 1.0, "hover")
    factor = {"gyro": 180 / pi, "accelerometer": 1 / 9.81}[sensor]
    (note,) = check_inertial(scaled(log, **{sensor: factor}))[1]
    assert {"gyro": "degrees per second", "accelerometer": "look like g"}[sensor] in note


def test_gravity_left_out_and_a_gyro_that_stands_still_are_told(log):
    up = Rotation.from_quat(log.quaternion, scalar_first=True).inv().apply([0.0, 0.0, 9.81])
    wrong = replace(log, accelerometer=log.accelerometer - up, gyro=np.zeros_like(log.gyro))
    gyro, accelerometer = check_inertial(wrong)[1]
    assert "never change" in gyro
    assert "without gravity" in accelerometer


def test_leaps_and_gaps_of_the_pose_are_no_sensors_fault(log):
    position = log.position.copy()
    quaternion = log.quaternion.copy()
    position[400:] += 5.0
    quaternion[700] = [0.0, 1.0, 0.0, 0.0]
    position[900:1000] = quaternion[900:1000] = nan
    log = replace(log, position=position, quaternion=quaternion, valid=np.empty(0, dtype=bool))
    assert check_inertial(log)[1] == ()


def test_a_sensor_faster_than_the_pose_has_rows_of_its_own(log, tmp_path):
    every = np.arange(len(log.t)) % 4 == 0
    log = without_pose(log, ~every)
    write_log(log, tmp_path / "flight.csv")
    read = read_log(tmp_path / "flight.csv", vehicle=VEHICLE)
    assert read.notes == ()  # no pose was lost between two poses
    assert_array_equal(read.gyro, log.gyro)
    assert_array_equal(with_rows(read, every).accelerometer, log.accelerometer[every])
