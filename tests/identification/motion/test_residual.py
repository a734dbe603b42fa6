"""The residual wrench of a log: nothing where the model is whole, the effect where it is not."""

from dataclasses import replace

import numpy as np
import pytest

from windwrench.dynamics import InputError, load_vehicle
from windwrench.envs.plant import PlantSettings
from windwrench.envs.recording import record_flight
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.motion.signals import log_signals

VEHICLE = load_vehicle("ardrone2")
QUIET = PlantSettings(disturbance_force=0.0, disturbance_torque=0.0)


def fly(*effects, trajectory="excite", seconds=15.0, settings=QUIET, vehicle=VEHICLE):
    return FlightLog(
        **record_flight(vehicle, effects, trajectory, seconds, 3, settings), name="flight"
    )


def test_a_gap_ends_a_piece_and_a_lost_sample_does_not():
    log = fly(seconds=12.0)
    valid = np.ones(len(log.t), dtype=bool)
    valid[500:503] = False
    valid[1200:1300] = False
    pieces = log_signals(replace(log, valid=valid))
    assert [round(piece.t[-1] - piece.t[0], 1) for piece in pieces] == [6.0, 5.5]
    with pytest.raises(InputError, match="3 s"):
        log_signals(replace(log, valid=np.arange(len(log.t)) < 300))
