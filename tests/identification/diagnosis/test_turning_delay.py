"""The delay between commands and rotors, from how a vehicle turns."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.flown import recorded
from windwrench.dynamics import load_vehicle
from windwrench.identification.diagnosis.turning_delay import turning_delay
from windwrench.identification.motion.signals import log_signals


def flown(vehicle, **effects):
    return log_signals(recorded(seed=3, vehicle=vehicle, **effects))


@pytest.mark.parametrize("vehicle", ["ardrone2", "crazyflie"])
def test_the_delay_that_was_flown(vehicle):
    model = load_vehicle(vehicle)
    found = turning_delay(flown(model, latency={"d": 0.035}), model)
    assert found is not None
    assert found.seconds == pytest.approx(0.035, abs=0.004)
    assert found.std < 0.004


def test_moments_of_another_flight_show_no_delay():
    model = load_vehicle("ardrone2")
    pieces = [
        replace(s, rotor_speeds=np.ascontiguousarray(s.rotor_speeds[::-1])) for s in flown(model)
    ]
    assert turning_delay(pieces, model) is None
    assert turning_delay([], model) is None
