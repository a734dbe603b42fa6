"""Channels that stand still or repeat another are noted; a rotor at its limit is not.

``tests/fuzz/test_answers.py`` holds what an estimate makes of such logs.
"""

from dataclasses import replace
from functools import cache

import numpy as np

from windwrench.dynamics import load_vehicle
from windwrench.envs.recording import record_flight
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.logs.screening import stuck_channels

VEHICLE = load_vehicle("ardrone2")


@cache
def flight():
    return FlightLog(
        **record_flight(VEHICLE, trajectory="excite", seconds=14.0, seed=3), name="flight.csv"
    )


def test_rotors_that_are_alike_in_pairs_are_a_flight_in_a_plane():
    log = flight()
    pairs = replace(log, rotor_speeds=log.rotor_speeds[:, [0, 1, 1, 0]])
    assert not [note for note in stuck_channels(pairs, VEHICLE) if "same in every row" in note]
    twice = replace(log, rotor_speeds=log.rotor_speeds[:, [0, 1, 2, 1]])
    (note,) = [note for note in stuck_channels(twice, VEHICLE) if "same in every row" in note]
    assert "omega2 and omega4" in note


def test_a_clean_flight_and_a_rotor_at_its_limit_are_not_noted():
    log = flight()
    assert not [*stuck_channels(log, VEHICLE)]
    limited = replace(VEHICLE, omega_max=float(np.quantile(log.rotor_speeds, 0.3)))
    clipped = np.minimum(log.rotor_speeds, limited.omega_max)
    clipped[:, 0] = limited.omega_max
    assert not [*stuck_channels(replace(log, rotor_speeds=clipped), limited)]
