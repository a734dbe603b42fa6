"""Controllers: which way they push, and what they need."""

import numpy as np
import pytest

from windwrench.controllers import CONTROLLERS, AdmittancePID, make_controller
from windwrench.controllers.flight import flight_record, fly, move_setpoint
from windwrench.controllers.observation import FORCE_X, MAX_COMMAND, OBSERVATION_SIZE, TORQUE_Z
from windwrench.dynamics import load_vehicle
from windwrench.estimator.estimate import STATE_SIZE

VEHICLE = load_vehicle("ardrone2")


def observation(torque=0.0, force=0.5):
    o = np.zeros(OBSERVATION_SIZE, dtype=np.float32)
    o[TORQUE_Z], o[FORCE_X] = torque, force
    return o


@pytest.mark.parametrize("name", sorted(CONTROLLERS.keys() - {"oracle"}))
def test_a_command_is_one_number_within_bounds(name):
    controller = make_controller(name)
    controller.reset()
    for torque in (0.0, 0.02, -5.0):
        command = controller(observation(torque))
        assert command.shape == (1,)
        assert abs(command[0]) <= MAX_COMMAND


def test_the_flight_loop_s_commands_can_be_flown():
    turning = np.zeros(STATE_SIZE)
    turning[2], turning[3], turning[10:13] = 1.0, 1.0, (30.0, -30.0, 10.0)
    for where in ({0: 100.0, 1: -100.0, 2: 100.0, 9: 3.0}, {2: -100.0}):
        c = flight_record(VEHICLE)[0]
        for index, value in where.items():
            c["setpoint"][index] = value
        fly(c, turning, 0.005)
        assert np.all(np.isfinite(c["command"]))
        assert np.all((c["command"] >= 0) & (c["command"] <= VEHICLE.omega_max))


def test_a_moving_set_point_waits_for_the_vehicle():
    c = flight_record(VEHICLE)[0]
    c["setpoint"][4] = 1.0
    for _ in range(400):
        move_setpoint(c, np.zeros(3), 0.005)
    # it stops within one step of 5 mm of the leash's end
    assert c["leash"] - 0.0051 <= c["setpoint"][1] <= c["leash"]
    c["setpoint"][4] = -1.0
    move_setpoint(c, np.zeros(3), 0.005)
    assert c["setpoint"][1] < c["leash"] - 0.005


def test_a_set_point_at_rest_is_not_dragged_along():
    """A vehicle that a gust has thrown off must find its way back."""
    c = flight_record(VEHICLE)[0]
    for _ in range(400):
        move_setpoint(c, np.array([3.0, -2.0, 1.0]), 0.005)
    np.testing.assert_array_equal(c["setpoint"], np.zeros(len(c["setpoint"])))


def test_the_integral_follows_and_does_not_wind_up():
    pid = AdmittancePID(gain=1.0, integral=10.0, lead=0.0)
    for _ in range(10):
        command = pid(observation(0.02))[0]
    assert command == pytest.approx(-(0.02 + 10.0 * 10 * 0.08 * 0.02), rel=1e-4)
    for _ in range(1000):
        pid(observation(0.2))
    assert -MAX_COMMAND <= pid(observation(0.2))[0] <= -0.8
    # a torque of the other sign takes it off the bound at once, not after as long a time
    turned = [pid(observation(-0.2))[0] for _ in range(12)]
    assert turned[-1] > 0.0
    pid.reset()
    assert pid(observation(0.0))[0] == 0.0
