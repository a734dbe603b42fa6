"""Logs of the kit's format without a pose, and with motor commands in place of rotor speeds."""

from dataclasses import replace
from math import nan, pi

import numpy as np
from numpy.testing import assert_allclose

from tests.support.flown import resting
from tests.support.outcomes import noted, refused
from windwrench.dynamics import load_vehicle
from windwrench.dynamics.vehicle import MotorCurve
from windwrench.identification.logs.commanded_speeds import with_commanded_speeds
from windwrench.identification.logs.flight_log import FlightLog, write_log
from windwrench.identification.logs.reading import read_log
from windwrench.identification.logs.screening import screen_log


def curved():
    """A vehicle that states its motor curve: 0.12 N a rotor at the full command and 4 V."""
    curve = MotorCurve(thrust=(0.0, 0.02, 0.10), voltage_exponent=2.0, command=(0.0, 65535.0))
    return replace(load_vehicle("crazyflie"), motor_curve=curve, voltage_ref=4.0)


def inertial_log(**fields):
    """Two seconds of commands and inertial sensors at 100 Hz, without a pose."""
    count = 200
    nothing = np.full((count, 3), nan)
    command = np.tile([0.5, 0.6, 0.7, 0.8], (count, 1))
    given = {
        "t": 0.01 * np.arange(count),
        "position": nothing,
        "quaternion": np.full((count, 4), nan),
        "rotor_speeds": np.full((count, 4), nan),
        "accelerometer": [0.0, 0.0, 9.81] + 0.1 * np.sin(np.outer(np.arange(count), [1, 2, 3])),
        "gyro": 0.1 * np.cos(np.outer(np.arange(count), [1, 2, 3])),
        "command": command,
        "voltage": np.full(count, 3.8),
    }
    return FlightLog(**{**given, **fields})  # type: ignore[arg-type]


def test_a_motor_curve_turns_commands_into_rotor_speeds(tmp_path):
    """At 3.8 V of 4 V and an exponent of 2, thrust is 0.9025 of the curve's."""
    path = tmp_path / "imu.csv"
    vehicle = curved()
    write_log(inertial_log(), path)
    assert not read_log(path).has_rotor_speeds
    log = read_log(path, vehicle=vehicle)
    assert log.commanded
    assert noted(log, "motor curve")
    u = np.array([0.5, 0.6, 0.7, 0.8])
    thrust = (0.02 * u + 0.10 * u**2) * (3.8 / 4.0) ** 2
    assert_allclose(vehicle.k * log.rotor_speeds[0] ** 2, thrust, rtol=1e-12)


def test_commands_without_a_curve_are_refused_where_thrust_is_needed():
    """A vehicle without a motor curve cannot say what a command gives."""
    log = inertial_log(
        position=np.zeros((200, 3)), quaternion=np.tile([1.0, 0.0, 0.0, 0.0], (200, 1))
    )
    with refused("motor_curve"):
        screen_log(log, load_vehicle("crazyflie"))


def test_the_scale_of_commands_counts_the_dips_between_high_thrusts():
    """Thrust that swings from 0.2 to 1.8 of the weight has the weight as its mean; without its dips
    the mean is above it, and the scale would be too small.
    """
    vehicle = load_vehicle("ardrone2")
    t = 0.01 * np.arange(2000)
    weights = 1.0 + 0.8 * np.sin(2.0 * pi * t)
    weights[t < 2.0] = 0.05  # on the ground, rotors idling
    command = np.tile(np.sqrt(weights / 4.0 * vehicle.weight / 3.0)[:, None], (1, 4))
    log = resting(t, rotor_speeds=np.full((len(t), 4), nan), command=command)
    read = with_commanded_speeds(log, vehicle)
    full = vehicle.k[0] * np.square(read.rotor_speeds[:, 0] / command[:, 0])
    assert_allclose(full, 3.0, rtol=0.01)  # N of a motor at full command


def test_without_pose_and_curve_the_accelerometer_sets_the_scale(tmp_path):
    """Commands beside an IMU, the most common log: thrust in flight is the mass times what the
    accelerometer feels along the rotors' axis; the note says what that cannot tell.
    """
    vehicle = load_vehicle("ardrone2")
    felt = 9.81 + 2.0 * np.sin(0.1 * np.arange(200))
    command = np.tile(np.sqrt(vehicle.mass * felt / 4.0 / 2.5)[:, None], (1, 4))
    accelerometer = np.column_stack([np.zeros(200), np.zeros(200), felt])
    path = tmp_path / "imu.csv"
    write_log(inertial_log(accelerometer=accelerometer, command=command), path)
    log = read_log(path, vehicle=vehicle)
    assert log.commanded
    full = vehicle.k * np.square(log.rotor_speeds / command)
    assert_allclose(full, 2.5, rtol=1e-9)  # N of a motor at full command
    assert noted(log, "Mass or a factor on thrust cannot be found")
