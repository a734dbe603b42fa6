"""The laws of the tasks beside FanTracking; golden leaderboards hold what they command."""

import numpy as np
import pytest

from windwrench.controllers import wind_observation as seen
from windwrench.controllers.axis_models import PLACE, axis_models
from windwrench.controllers.lqg import LQG
from windwrench.controllers.registry import TASK_LAWS, make_controller, tuned_gains
from windwrench.controllers.wind_laws import INDI, PID, L1Adaptive, PIDWithWrench
from windwrench.controllers.wind_observation import TORQUE, WIND_OBSERVATION_SIZE, WIND_PERIOD
from windwrench.dynamics import load_vehicle
from windwrench.envs.closed_loop import ClosedLoop
from windwrench.envs.plant import TICK, PlantSettings


@pytest.mark.parametrize("task", sorted(TASK_LAWS.keys() - {"FanTracking"}))
def test_every_law_flies_with_the_gains_that_were_found(task):
    tuned = tuned_gains("WindHover" if task == "WindTrajectory" else task)
    for name in TASK_LAWS[task].keys() & tuned:
        assert tuned[name]["rmse_m"] <= tuned[name]["default_rmse_m"]
        assert tuned[name]["gains"].items() <= vars(make_controller(name, task)).items()


def frame(**parts):
    o = np.zeros(seen.WIND_OBSERVATION_SIZE)
    for name, value in parts.items():
        o[getattr(seen, name)] = value
    return o


def test_the_integral_of_a_pid_waits_at_the_limit():
    law = PID(kp=2.0, kd=3.0, ki=0.5)
    for _ in range(100):
        assert law(frame(POSITION_ERROR=[3.0, 0, 0]))[0] == 4.0
    law.kp = 0.0
    assert abs(law(frame())[0]) < 0.01


@pytest.mark.parametrize("law", [INDI(), L1Adaptive()])
def test_the_flight_loop_turns_against_a_steady_torque(law):
    """The attitude loop makes k_attitude a / g of an acceleration; tau / J stands against it."""
    level = {"SPECIFIC_FORCE": [0, 0, 9.81], "ROTOR_FORCE": [0, 0, 9.81]}
    law(frame(**level))
    ahead = law(frame(TORQUE=[0.01, 0.02, 0.03], **level))
    for _ in range(100):
        action = law(frame(TORQUE=[0.01, 0.02, 0.03], **level))
    inertia = load_vehicle("ardrone2").inertia
    cancels = 9.81 / 110.0 * np.array([-0.02 / inertia[1, 1], 0.01 / inertia[0, 0], 0.0])
    np.testing.assert_allclose(action, cancels, atol=1e-6)
    assert ahead[0] < action[0]  # a torque that grows is met before it is seen in full


@pytest.mark.parametrize("pushed", ["action", "force", "torque", "set point"])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_an_axis_moves_as_the_vehicle_in_mujoco_does(axis, pushed):
    """Steps of 0.5 m/s2, 0.2 N, 0.01 Nm and 0.2 m/s, for 0.8 s, without any noise."""
    if (axis, pushed) == (2, "torque"):
        pytest.skip("a torque does not lift")
    vehicle = load_vehicle("ardrone2")
    quiet = PlantSettings(disturbance_force=0.0, disturbance_torque=0.0, sensor_noise=False)
    loop = ClosedLoop(vehicle, settings=quiet)
    loop.reset(np.random.default_rng(0), np.array([0.0, 0.0, 1.5]), np.pi)
    model = axis_models(vehicle)[axis]
    if pushed == "set point":
        model = model.with_set_point()
    A, B, D = model.held(TICK)
    command, push = 0.0, np.zeros(D.shape[1])
    if pushed == "action":
        command = loop.action[axis] = 0.5
    elif pushed == "set point":
        command = loop.setpoint[3 + axis] = 0.2
    elif pushed == "force":
        push[0] = loop.applied[axis] = 0.2
    else:
        push[1] = 0.01
        loop.applied[3 + (1, 0)[axis]] = (1, -1)[axis] * 0.01
    x, start, there, expected = np.zeros(len(A)), loop.position[axis], [], []
    for _ in range(160):
        loop.run(np.zeros((1, loop.noise_size)))
        x = A @ x + B[:, 0] * command + D @ push
        there.append(loop.position[axis] - start)
        expected.append(x[PLACE])
    largest = np.abs(expected).max()
    assert largest > 0.005
    # the filter and the ticks between sample and command are not in the model
    assert np.abs(np.array(there) - expected).max() < 0.12 * largest


def test_the_torque_is_answered_before_anything_has_moved():
    law = LQG()
    law(np.zeros(WIND_OBSERVATION_SIZE) + _hovering())
    felt = _hovering()
    felt[TORQUE] = [-0.02, 0.02, 0.0]
    x, y, z = law(felt)
    assert x < -0.05
    assert y < -0.05
    assert abs(z) < 1e-6
    fed = PIDWithWrench(tilt=10.0, tilt_lead=0.1)
    np.testing.assert_allclose(fed(felt), [-0.2, -0.2, 0.0], atol=1e-6)
    felt[TORQUE] = [-0.02, 0.03, 0.0]
    expected = -10.0 * (0.03 + 0.1 * 0.01 / WIND_PERIOD)
    np.testing.assert_allclose(fed(felt)[0], expected, rtol=1e-5)


def _hovering():
    o = np.zeros(WIND_OBSERVATION_SIZE)
    o[20] = o[23] = 9.81
    return o
