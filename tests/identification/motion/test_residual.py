"""The residual wrench of a log: nothing where the model is whole, the effect where it is not."""

from dataclasses import replace

import numpy as np
import pytest

from windwrench.dynamics import EffectSetting, InputError, load_vehicle
from windwrench.envs.plant import PlantSettings
from windwrench.envs.recording import record_flight
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.motion.residual import residual_wrench
from windwrench.identification.motion.signals import log_signals
from windwrench.identification.motion.smoothing import low_pass

VEHICLE = load_vehicle("ardrone2")
QUIET = PlantSettings(disturbance_force=0.0, disturbance_torque=0.0)
CUTOFF = 4.0


def fly(*effects, trajectory="excite", seconds=15.0, settings=QUIET, vehicle=VEHICLE):
    return FlightLog(
        **record_flight(vehicle, effects, trajectory, seconds, 3, settings), name="flight"
    )


def residual(log, vehicle=VEHICLE):
    (signals,) = log_signals(log)
    edge = round(0.6 / signals.period)
    return (
        low_pass(residual_wrench(signals, vehicle), CUTOFF, signals.period)[edge:-edge],
        signals,
        edge,
    )


@pytest.mark.parametrize(
    "effect",
    [
        EffectSetting("rotor_drag", {"kdx": 2e-4, "kdy": 1e-4}),
        EffectSetting("mass", {"dm": 0.04}),
        EffectSetting("com_offset", {"cx": 0.006, "cy": -0.004, "cz": 0.01}),
        EffectSetting("battery_sag", {"n": 1.0}),
        EffectSetting("motor_lag", {"tau": 0.035}),
    ],
)
def test_with_the_effect_declared_the_noise_is_left(effect):
    floor = np.sqrt(np.mean(residual(fly())[0] ** 2, axis=0))
    log = fly(effect)
    without = np.sqrt(np.mean(residual(log)[0] ** 2, axis=0))
    with_it = np.sqrt(np.mean(residual(log, VEHICLE.with_effects(effect))[0] ** 2, axis=0))
    assert np.max(without / floor) > 1.8
    assert np.max(with_it / floor) < 1.3


def test_a_gap_ends_a_piece_and_a_lost_sample_does_not():
    log = fly(seconds=12.0)
    valid = np.ones(len(log.t), dtype=bool)
    valid[500:503] = False
    valid[1200:1300] = False
    pieces = log_signals(replace(log, valid=valid))
    assert [round(piece.t[-1] - piece.t[0], 1) for piece in pieces] == [6.0, 5.5]
    with pytest.raises(InputError, match="3 s"):
        log_signals(replace(log, valid=np.arange(len(log.t)) < 300))
