"""The laws of the tasks beside FanTracking; golden leaderboards hold what they command."""

import numpy as np
import pytest

from windwrench.controllers import wind_observation as seen
from windwrench.controllers.registry import TASK_LAWS, make_controller, tuned_gains
from windwrench.controllers.wind_laws import INDI, PID, L1Adaptive
from windwrench.dynamics import load_vehicle


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
