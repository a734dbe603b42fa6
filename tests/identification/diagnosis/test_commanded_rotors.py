"""What a regression allows for where rotor speeds are worked out from commands."""

import numpy as np
import pytest

from windwrench.dynamics import load_vehicle
from windwrench.identification.diagnosis.commanded_rotors import COMMANDED, in_flight_by_thrust
from windwrench.identification.logs.flight_log import FlightLog

VEHICLE = load_vehicle("ardrone2")


def still(seconds=10.0, rate=200.0, speeds=None):
    n = round(seconds * rate) + 1
    return FlightLog(
        np.arange(n) / rate,
        np.tile([0.0, 0.0, 1.0], (n, 1)),
        np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
        np.full((n, 4), VEHICLE.hover_rate) if speeds is None else speeds,
    )


def test_only_the_time_in_the_air_counts():
    log = still(20.0)
    speeds = log.rotor_speeds.copy()
    speeds[(log.t < 4.0) | (log.t > 15.0)] *= 0.3
    found = in_flight_by_thrust(still(20.0, speeds=speeds), VEHICLE)
    # taking off and landing last beyond
    assert found.t[0] == pytest.approx(4.0 + COMMANDED.take_off, abs=0.5)
    assert found.t[-1] == pytest.approx(15.0 - COMMANDED.take_off, abs=0.5)
    whole = in_flight_by_thrust(log, VEHICLE)
    assert len(whole.t) == len(log.t)
