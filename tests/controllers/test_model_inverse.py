"""The declared model in the flight loop: it takes off what effects push, and inverts what rotors
deliver.
"""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.support.vehicles import VEHICLE
from windwrench import _core
from windwrench.controllers.flight import flight_record
from windwrench.dynamics.effects import get, names, parse_setting
from windwrench.dynamics.model import MODEL_FIELDS, load_model
from windwrench.dynamics.rotation import quaternion_of_yaw
from windwrench.envs.wind_tasks import WindHoverEnv, WindTrajectoryEnv

_SPEEDS = np.array([380.0, 370.0, 390.0, 375.0])
HORIZON = 0.02  # s, of the core
_LATE = ("latency", "motor_lag")


def made(*texts):
    """A flight loop and a model (1,) that flies at ``_SPEEDS`` and has effects."""
    declared = VEHICLE.with_effects(*[parse_setting(text, VEHICLE) for text in texts])
    model = np.zeros(1, dtype=MODEL_FIELDS)
    amended = load_model(model[0], declared)
    for _ in range(40):
        _core.drive(model.ctypes.data, _SPEEDS, 0.005, 0.95 * VEHICLE.voltage_ref)
    return flight_record(amended), model


def commanded(wanted, *texts):
    flight, model = made(*texts)
    flight["command"] = wanted
    _core.through_the_rotors(flight.ctypes.data, model.ctypes.data)
    return flight["command"][0], model


STATIC = [n for n in names() if get(n).kind == "rotor input" and n not in _LATE]


@pytest.mark.parametrize("name", STATIC)
def test_commands_deliver_the_wanted_rotor_speeds(name):
    wanted = _SPEEDS * np.array([1.05, 0.97, 1.02, 0.9])
    command, model = commanded(wanted, name)
    assert model["rotor_count"] == 1
    _core.drive(model.ctypes.data, command.copy(), HORIZON, float(model["voltage"][0]))
    assert_allclose(model["rotors"][0, :4], wanted, rtol=1e-6)


def test_a_lag_is_led_by_what_remains_after_the_horizon():
    command, model = commanded(_SPEEDS + 10.0, "motor_lag:tau=0.035")
    share = 1.0 - math.exp(-HORIZON / 0.035)
    assert_allclose(command, _SPEEDS + 10.0 / share, rtol=1e-9)
    # and looking ahead has not moved the model's own rotors
    assert_allclose(model["rotors"][0, :4], _SPEEDS, rtol=1e-3)


def test_drag_is_foreseen_at_the_reference_and_not_at_the_vehicle():
    flight, model = made("rotor_drag:kdx=0.0001,kdy=0.0001")
    flight["setpoint"][0, 3:6] = 1.5, 0.0, 0.0
    flight["wanted"] = _SPEEDS
    state = np.zeros(20)
    state[3:7] = quaternion_of_yaw(0.4)
    state[7:10] = -3.0, 2.0, 1.0
    _core.foresee(flight.ctypes.data, model.ctypes.data, state)
    expected = [-1e-4 * _SPEEDS.sum() * 1.5, 0.0, 0.0]
    assert_allclose(flight["foreseen"][0, :3], expected, atol=1e-12)


def test_without_effects_the_flight_is_the_same_bit_for_bit():
    def flown(model_in_loop):
        env = WindTrajectoryEnv("fan-wall", model_in_loop=model_in_loop)
        env.reset(seed=3)
        return [env.step(np.array([0.3, -0.2, 0.1]))[0] for _ in range(25)]

    assert_array_equal(flown(True), flown(False))


@pytest.mark.parametrize("text", ["com_offset", "rotor_efficiency"])
def test_a_declared_effect_no_longer_pushes_the_vehicle_off(text):
    setting = parse_setting(text, VEHICLE)

    def error(model):
        env = WindHoverEnv("calm", vehicle=model, truth=VEHICLE, effects=(setting,))
        env.reset(seed=700_000)
        some = [env.step(np.zeros(3))[4]["error"] for _ in range(150)]
        return math.sqrt(np.square(some).mean())

    assert error(VEHICLE.with_effects(setting)) < 0.9 * error(VEHICLE)
