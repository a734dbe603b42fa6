"""Tables of the maps that ship: what their columns become."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from tests.support.map_tables import hover_table
from tests.support.outcomes import noted
from windwrench.dynamics import load_vehicle
from windwrench.dynamics.vehicle import MotorCurve
from windwrench.identification.logs.reading import read_log

VEHICLE = load_vehicle("crazyflie")
COUNT = 40
TIME = 0.004 * np.arange(COUNT)
AXES = ("roll_rad", "pitch_rad", "yaw_rad")


@pytest.fixture
def read(write):
    """Read a hover by a map; golden lines say what is refused of one."""

    def read_table(name, vehicle=None, **given):
        return read_log(write(hover_table(name, **given), "log.csv"), None, vehicle)

    return read_table


def test_requests_of_crazypad_are_linear_in_thrust(read):
    curved = replace(VEHICLE, motor_curve=MotorCurve((0.0, 0.2)))
    log = read("crazypad", curved, est_ax_g=0.5, est_ay_g=None)
    assert log.commanded
    assert_allclose(np.square(log.rotor_speeds) * VEHICLE.k, 0.2 * log.command)
    assert "onboard_acceleration" not in log.extra  # one of its three columns is missing


def test_wrenches_of_crazyswarm2_become_rotor_speeds(read):
    torque = dict(zip((f"torque_cmd_{a}_Nm" for a in "xyz"), (1e-3, -5e-4, 1e-4), strict=True))
    log = read("crazyswarm2", VEHICLE, thrust_cmd_N=0.3, **torque)
    wrench = VEHICLE.rotor_wrench(log.rotor_speeds[7])
    assert_allclose(wrench, [0.3, *torque.values()], rtol=1e-9)
    assert "reader crazyswarm2" in log.source
    assert noted(log, "inverse of the rotor mixing of crazyflie")
    pull = np.where((np.arange(COUNT) >= 5) & (np.arange(COUNT) < 8), 0.02, 0.0)
    log = read("crazyswarm2", VEHICLE, thrust_cmd_N=0.3, torque_cmd_x_Nm=pull)
    assert log.rotor_speeds.min() == 0.0
    assert log.rotor_speeds.max() <= VEHICLE.omega_max
    assert noted(log, "commands of 3 sample(s)")


def test_attitude_turns_about_z_then_y_then_x(read):
    log = read("crazyswarm2", **dict(zip(AXES, (0.3, -0.2, 1.1), strict=True)))
    about = Rotation.from_rotvec
    expected = about([0, 0, 1.1]) * about([0, -0.2, 0]) * about([0.3, 0, 0])
    turn = Rotation.from_quat(log.quaternion[0], scalar_first=True)
    assert (expected.inv() * turn).magnitude() < 1e-8


def test_held_positions_are_no_measurements(read):
    held = 0.01 * np.repeat(np.arange(14.0), 3)[:COUNT]
    payload = {f"payload_{axis}_m": value for axis, value in zip("xyz", (0, 0, 0.5), strict=True)}
    log = read("crazyswarm2", mocap_x_m=0.0, mocap_y_m=held, mocap_z_m=0.0, **payload)
    assert_array_equal(np.flatnonzero(log.valid), np.arange(0, COUNT, 3))
    assert_allclose(log.position[3], [0, 0.01, 0])
    assert np.isnan(log.position[1]).all()
    assert noted(log, "26 of 40 rows repeat")
    # the attitude of the rows between is not lost
    assert np.isfinite(log.extra["onboard_angles"]).all()
    assert_array_equal(log.extra["payload_position"], np.tile([0, 0, 0.5], (COUNT, 1)))
    assert log.extra["commanded_thrust"].shape == (COUNT,)


@pytest.mark.parametrize(("stray", "left"), [(5, COUNT - 5), (30, COUNT)])
def test_stray_samples_are_dropped(read, stray, left):
    """A few before a gap at the start; a gap in the flight is none."""
    log = read(
        "crazyswarm2", t_s=TIME + 0.7 * (np.arange(COUNT) >= stray), mocap_x_m=np.arange(40.0)
    )
    assert len(log.t) == left
    assert log.t[0] == 0.0
    assert log.position[0, 0] == COUNT - left
    assert all(len(column) == left for column in log.extra.values())
    said = "dropped 5 stray sample(s) before a gap of 0.7" if stray == 5 else "1 gap(s) in time"
    assert noted(log, said)
