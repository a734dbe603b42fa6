"""The laws of the tasks beside FanTracking; golden leaderboards hold what they command."""

import numpy as np
import pytest

from windwrench.controllers import wind_observation as seen
from windwrench.controllers.registry import TASK_LAWS, make_controller, tuned_gains
from windwrench.controllers.wind_laws import INDI, PID, L1Adaptive
from windwrench.dynamics import InputError


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


@pytest.mark.parametrize(
    "make",
    [
        lambda: INDI(cutoff=20.0),
        lambda: L1Adaptive(pole=0.0),
        lambda: make_controller("x", "y"),
    ],
)
def test_gains_that_cannot_be_are_named(make):
    with pytest.raises(InputError):
        make()
