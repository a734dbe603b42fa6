"""Which channels carry a finding: where it leaves its trace, and what its model reads."""

import pytest

from windwrench.dynamics import load_vehicle
from windwrench.dynamics.vehicle import EffectSetting
from windwrench.envs.recording import record_flight
from windwrench.identification.inference.carrying_channels import ORDER, carrying_channels
from windwrench.identification.inference.regression import Flights
from windwrench.identification.inference.search import FittedEffects, Search
from windwrench.identification.logs.flight_log import FlightLog

VEHICLE = load_vehicle("ardrone2")
CASES = {
    "constant_torque": ({"tx": 0.01, "ty": 0.01, "tz": 0.0}, {"attitude"}, {"rotor speeds"}),
    "rotor_drag": ({"kdx": 1e-4, "kdy": 1e-4}, {"position", "attitude", "rotor speeds"}, set()),
    "battery_sag": ({"n": 1.0}, {"position", "rotor speeds", "battery voltage"}, {"gyro"}),
    "mass": ({"dm": 0.05}, {"position"}, {"battery voltage"}),
}


@pytest.mark.parametrize("effect", CASES)
def test_channels_are_those_of_the_trace_and_of_the_model(effect):
    coefficients, carried, others = CASES[effect]
    c = record_flight(VEHICLE, (EffectSetting(effect, coefficients),), "excite", 12.0, 1)
    log = FlightLog(c["t"], c["position"], c["quaternion"], c["rotor_speeds"], c["voltage"])
    search = Search(Flights([log], VEHICLE), [effect])
    begun = FittedEffects({effect: dict(coefficients)})
    search.set_noise(begun, search.linearise(begun))
    found = carrying_channels(search, search.refit(begun), effect)
    assert carried <= set(found)
    assert not others & set(found)
    assert list(found) == [channel for channel in ORDER if channel in found]
