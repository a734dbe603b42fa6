"""The laws of the tasks beside FanTracking, each held to its equations."""

import math

import numpy as np
import pytest

from windwrench.controllers import wind_observation as seen
from windwrench.controllers.registry import TASK_LAWS, make_controller, tuned_gains
from windwrench.controllers.wind_laws import INDI, PID, L1Adaptive, PIDWithForce, WindOracle
from windwrench.dynamics import InputError


def test_every_law_flies_with_the_gains_that_were_found():
    for task, laws in TASK_LAWS.items():
        for name in laws:
            if name == "hover" or task == "FanTracking":
                continue
            source = "WindHover" if task == "WindTrajectory" else task
            found = tuned_gains(source)[name]
            assert found["rmse_m"] <= found["default_rmse_m"]
            law = make_controller(name, task)
            for gain, value in found["gains"].items():
                assert getattr(law, gain) == value


def frame(**parts):
    o = np.zeros(seen.WIND_OBSERVATION_SIZE)
    for name, value in parts.items():
        o[getattr(seen, name)] = value
    return o


def test_pid_is_its_formula_and_its_integral_waits_at_the_limit():
    law = PID(kp=2.0, kd=3.0, ki=0.5)
    o = frame(POSITION_ERROR=[0.1, 0, 0], VELOCITY=[0, 0.2, 0], REFERENCE_VELOCITY=[0, 0, 0.1])
    first = law(o)
    np.testing.assert_allclose(first, [0.2 + 0.5 * 0.004, -0.6, 0.3], rtol=1e-6)
    np.testing.assert_allclose(law(o)[0], 0.2 + 0.5 * 0.008, rtol=1e-6)
    law.reset()
    np.testing.assert_array_equal(law(o), first)
    far = frame(POSITION_ERROR=[3.0, 0, 0])
    for _ in range(100):
        assert law(far)[0] == 4.0
    law.kp = 0.0
    assert abs(law(frame())[0]) < 0.01


def test_the_force_is_fed_forward_with_its_lead():
    law = PIDWithForce(gain=0.5, lead=0.1)
    np.testing.assert_allclose(law(frame(FORCE=[0.2, 0, 0])), [-0.5 * 0.2 / 0.465, 0, 0], rtol=1e-6)
    rate = 0.1 * 0.1 / seen.WIND_PERIOD
    expected = -0.5 * (0.3 + rate) / 0.465
    np.testing.assert_allclose(law(frame(FORCE=[0.3, 0, 0]))[0], expected, rtol=1e-6)
    oracle = WindOracle()
    with pytest.raises(InputError, match="info"):
        oracle(frame())
    np.testing.assert_allclose(
        oracle(frame(), {"force_ahead": np.array([0.0, 0.465, 0.0])}), [0, -1, 0], rtol=1e-6
    )


def test_indi_is_a_butterworth_of_the_specific_forces():
    from scipy.signal import butter, lfilter, lfilter_zi

    x = np.random.default_rng(0).standard_normal((60, 3))
    law = INDI(cutoff=4.0, gain=0.9)
    out = [law(frame(SPECIFIC_FORCE=0.1 * row, ROTOR_FORCE=0.3 * row)) for row in x]
    b, a = butter(2, 4.0, fs=1 / seen.WIND_PERIOD)
    start = lfilter_zi(b, a)[:, None] * 0.2 * x[0]
    expected, _ = lfilter(b, a, 0.2 * x, axis=0, zi=start)
    np.testing.assert_allclose(out, 0.9 * expected, atol=1e-6)


def test_l1_finds_a_constant_force_up_to_what_its_law_leaves():
    law, v, push = L1Adaptive(pole=2.0, bandwidth=8.0), np.zeros(3), np.array([0.7, -0.2, 0.1])
    action = np.zeros(3)
    law(frame(VELOCITY=v, ROTOR_FORCE=[0, 0, 9.81]))
    for _ in range(150):
        # a vehicle whose rotors follow the action at once
        rotors = action + np.array([0, 0, 9.81])
        v = v + seen.WIND_PERIOD * (action + push)
        action = law(frame(VELOCITY=v, ROTOR_FORCE=rotors)).astype(float)
    np.testing.assert_allclose(action, -math.exp(-2.0 * seen.WIND_PERIOD) * push, rtol=1e-3)


@pytest.mark.parametrize(
    "make",
    [lambda: INDI(cutoff=20.0), lambda: L1Adaptive(pole=0.0), lambda: make_controller("x", "y")],
)
def test_gains_that_cannot_be_are_named(make):
    with pytest.raises(InputError):
        make()
