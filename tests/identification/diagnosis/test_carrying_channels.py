"""Which channels carry a finding: where it leaves its trace, and what its model reads."""

import pytest

from tests.support.flown import VEHICLE, recorded
from windwrench.identification.diagnosis.carrying_channels import ORDER, carrying_channels
from windwrench.identification.diagnosis.regression import Flights

CASES = {
    "constant_torque": ({"tx": 0.01, "ty": 0.01, "tz": 0.0}, {"attitude"}, {"rotor speeds"}),
    "rotor_drag": ({"kdx": 1e-4, "kdy": 1e-4}, {"position", "attitude", "rotor speeds"}, set()),
    "battery_sag": ({"n": 1.0}, {"position", "rotor speeds", "battery voltage"}, {"gyro"}),
    "mass": ({"dm": 0.05}, {"position"}, {"battery voltage"}),
}


@pytest.mark.parametrize("effect", CASES)
def test_channels_are_those_of_the_trace_and_of_the_model(effect):
    coefficients, carried, others = CASES[effect]
    log = recorded(seconds=12.0, **{effect: coefficients})
    found = carrying_channels(Flights([log], VEHICLE), {effect: coefficients}, effect)
    assert carried <= set(found)
    assert not others & set(found)
    assert list(found) == [channel for channel in ORDER if channel in found]
