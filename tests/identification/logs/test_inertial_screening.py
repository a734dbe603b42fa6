"""Logs without a pose: what their IMU claims is asked of gravity and of the rotors."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.support.imu_flights import imu_flight, pose_removed
from tests.support.outcomes import refused
from tests.support.vehicles import VEHICLE
from windwrench.identification.logs.flight_log import with_rows, write_log
from windwrench.identification.logs.reading import read_log
from windwrench.identification.logs.screening import screen_log
from windwrench.identification.motion.inertial_signals import pose_rate, reads_imu

SIDE = np.eye(3)[[2, 1, 0]]  # a board that is mounted on its side
BETAFLIGHT = np.eye(4)[[3, 2, 0, 1]]  # that order of rotors, by the torques against the gyro


@pytest.fixture(scope="module")
def flown():
    """A flight of 12 s with pose and IMU."""
    return imu_flight(VEHICLE, seconds=12.0)


def test_a_log_without_a_pose_passes(flown):
    """Nothing is wrong with it, for either use."""
    log = pose_removed(flown)
    assert reads_imu(log)
    assert not reads_imu(flown)
    assert screen_log(log, VEHICLE)[1] == ()
    assert screen_log(log, VEHICLE, None)[1] == ()


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"accelerometer": 1.0 / 9.80665}, "ax, ay, az look like g"),
        ({"accelerometer": [1.0, -1.0, -1.0]}, "forward, right, down.*; or look inverted"),
        ({"accelerometer": 0.1}, r"expected the specific force|look like"),
        ({"gyro": 180.0 / np.pi}, "degrees per second"),
        ({"gyro": [1.0, -1.0, -1.0]}, "negate y and z"),
        ({"gyro": [0.0, 0.0, 0.0]}, "gx, gy, gz never change"),
        ({"accelerometer": SIDE}, "in the median of a flight, along ax; expected the specific for"),
        ({"rotor_speeds": BETAFLIGHT}, "betaflight.* As logged, the gyro contradicts the rotors"),
    ],
)
def test_other_units_and_axes_are_refused(flown, fields, words):
    """The message says what the columns look like and what to do."""
    log = pose_removed(flown)
    changed = {
        name: getattr(log, name) * factor if np.ndim(factor) < 2 else getattr(log, name) @ factor
        for name, factor in ((name, np.asarray(factor)) for name, factor in fields.items())
    }
    with refused(words):
        screen_log(replace(log, **changed), VEHICLE)


def test_a_log_that_is_too_slow_or_too_short_is_refused(flown):
    """30 readings a second, and 8 s."""
    log = pose_removed(flown)

    rows = np.arange(len(log.t))
    with refused(r"28\.6 IMU readings a second"):
        screen_log(with_rows(log, rows % 7 == 0), VEHICLE)
    with refused("of unbroken gyro and accelerometer"):
        screen_log(with_rows(log, rows < 1600), VEHICLE)


def test_positions_without_an_attitude_are_a_log(flown, tmp_path):
    """Ten positions a second beside the IMU: written, read back, and read by the IMU."""
    log = pose_removed(flown, position_every=20)
    path = tmp_path / "slow.csv"
    write_log(log, path)
    header = path.read_text(encoding="utf-8").splitlines()[0]
    assert "px" in header
    assert "qw" not in header
    back = read_log(path, vehicle=VEHICLE)
    assert not back.has_pose
    assert pose_rate(back) == pytest.approx(10.0)
    assert_allclose(back.position[::20], flown.position[::20], rtol=1e-9)
    assert screen_log(back, VEHICLE)[1] == ()
