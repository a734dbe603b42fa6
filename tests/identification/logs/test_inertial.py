"""Inertial sensors in a log: read whole or not at all, and left out where the pose contradicts
them.
"""

from dataclasses import replace
from math import nan, pi

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from tests.support.hostile_conventions import scaled
from tests.support.outcomes import noted
from tests.support.vehicles import VEHICLE
from windwrench.identification.logs.flight_log import FlightLog, with_rows, write_log
from windwrench.identification.logs.inertial import check_inertial
from windwrench.identification.logs.reading import read_log

FRD = np.array([1.0, -1.0, -1.0])


def flight(seconds=6.0, rate=200.0, moving=1.0, noise=0.003, bias=0.1, seed=0):
    """A log with a biased, noisy IMU in every row."""
    rng = default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / rate)
    position, angles = _path(t, moving)
    turn = Rotation.from_euler("ZYX", angles)
    after = Rotation.from_euler("ZYX", _path(t + 1e-5, moving)[1])
    acceleration = (
        _path(t + 1e-3, moving)[0] - 2 * position + _path(t - 1e-3, moving)[0]
    ) / 1e-6 + [0.0, 0.0, 9.81]
    shaken = turn * Rotation.from_rotvec(noise * rng.standard_normal((len(t), 3)))
    return FlightLog(
        t,
        position + noise * rng.standard_normal(position.shape),
        shaken.as_quat(scalar_first=True),
        np.full((len(t), 4), VEHICLE.hover_rate),
        accelerometer=turn.inv().apply(acceleration) + bias + rng.normal(0, 0.3, (len(t), 3)),
        gyro=(turn.inv() * after).as_rotvec() / 1e-5 + bias + rng.normal(0, 0.05, (len(t), 3)),
        source="flight.csv",
    )


def _path(t, moving):
    swing = moving * np.sin(np.multiply.outer(t, [2.0, 3.1, 1.3]))
    return np.array([0, 0, 2]) + swing, 0.3 * moving * np.sin(
        np.multiply.outer(t, [1.7, 2.9, 3.3]) + 0.4
    )


@pytest.mark.parametrize("moving", [0.0, 1.0])
@pytest.mark.parametrize("seconds", [1.0, 6.0])
def test_honest_sensors_pass(moving, seconds):
    log = flight(seconds, moving=moving)
    checked, notes = check_inertial(log)
    assert notes == ()
    assert checked is log


@pytest.mark.parametrize("gravity", [9.81, 0.0])
def test_an_acceleration_in_world_axes_is_turned_into_body_axes(gravity):
    log = flight()
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
def test_wrong_sensors_are_left_out(tmp_path, sensor, words, factor):
    log = flight()
    other = "gyro" if sensor == "accelerometer" else "accelerometer"
    write_log(scaled(log, **{sensor: factor}), tmp_path / "flight.csv")
    with pytest.warns(UserWarning, match=f"{words}.*They were left out"):
        read = read_log(tmp_path / "flight.csv", vehicle=VEHICLE)
    assert getattr(read, sensor) is None
    assert_array_equal(getattr(read, other), getattr(log, other))
    assert noted(read, "left out")


@pytest.mark.parametrize("sensor", ["gyro", "accelerometer"])
def test_units_are_told_in_a_short_hover(sensor):
    log = flight(1.0, moving=0.0, bias=0.01)
    factor = {"gyro": 180 / pi, "accelerometer": 1 / 9.81}[sensor]
    (note,) = check_inertial(scaled(log, **{sensor: factor}))[1]
    assert {"gyro": "degrees per second", "accelerometer": "look like g"}[sensor] in note


def test_gravity_left_out_and_a_gyro_that_stands_still_are_told():
    log = flight()
    up = Rotation.from_quat(log.quaternion, scalar_first=True).inv().apply([0.0, 0.0, 9.81])
    wrong = replace(log, accelerometer=log.accelerometer - up, gyro=np.zeros_like(log.gyro))
    gyro, accelerometer = check_inertial(wrong)[1]
    assert "never change" in gyro
    assert "without gravity" in accelerometer


def test_leaps_and_gaps_of_the_pose_are_no_sensors_fault():
    log = flight()
    position = log.position.copy()
    quaternion = log.quaternion.copy()
    position[400:] += 5.0
    quaternion[700] = [0.0, 1.0, 0.0, 0.0]
    position[900:1000] = quaternion[900:1000] = nan
    log = replace(log, position=position, quaternion=quaternion, valid=np.empty(0, dtype=bool))
    assert check_inertial(log)[1] == ()


def test_a_sensor_faster_than_the_pose_has_rows_of_its_own(tmp_path):
    log = flight(rate=1000.0)
    every = np.arange(len(log.t)) % 10 == 0
    position = log.position.copy()
    quaternion = log.quaternion.copy()
    position[~every] = quaternion[~every] = nan
    log = replace(log, position=position, quaternion=quaternion, valid=every)
    write_log(log, tmp_path / "flight.csv")
    read = read_log(tmp_path / "flight.csv", vehicle=VEHICLE)
    assert read.notes == ()  # no pose was lost between two poses
    assert_array_equal(read.gyro, log.gyro)
    assert_array_equal(with_rows(read, every).accelerometer, log.accelerometer[every])
