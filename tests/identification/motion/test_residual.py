"""The motion that a log shows, and the residual, which is Newton's and Euler's balance."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.flown import recorded
from windwrench.dynamics import EffectSetting, InputError, load_vehicle
from windwrench.dynamics.effects import compile_effects
from windwrench.identification.motion.residual import residual_wrench
from windwrench.identification.motion.signals import log_signals
from windwrench.studies.trials.practice_flights import fly_practice

DECLARED = load_vehicle("ardrone2")
VEHICLE = DECLARED.with_effects(
    EffectSetting("mass", {"dm": 0.05}),
    EffectSetting("inertia", {"jx": 0.1, "jy": -0.2, "jz": 0.3}),
    EffectSetting("com_offset", {"cx": 0.01, "cy": 0.003, "cz": -0.02}),
)


@pytest.fixture(scope="module")
def flown():
    (signals,) = log_signals(fly_practice(DECLARED, seconds=6.0, seed=1))
    return signals


def test_the_residual_is_newton_and_euler(flown):
    body = compile_effects(VEHICLE).vehicle
    rotors = body.rotor_wrench(flown.rotor_speeds)
    R, omega, alpha = flown.rotation, flown.angular_velocity, flown.angular_acceleration
    centre = np.cross(alpha, body.com) + np.cross(omega, np.cross(omega, body.com))
    acceleration = (
        flown.acceleration
        + np.array([0.0, 0.0, VEHICLE.gravity])
        + np.einsum("nij,nj->ni", R, centre)
    )
    force = body.mass * acceleration - R[:, :, 2] * rotors[:, :1]
    momentum = omega @ body.inertia.T
    thrust = rotors[:, :1] * [0.0, 0.0, 1.0]
    torque = alpha @ body.inertia.T + np.cross(omega, momentum)
    torque -= rotors[:, 1:] - np.cross(body.com, thrust)
    np.testing.assert_allclose(
        residual_wrench(flown, VEHICLE), np.column_stack([force, torque]), atol=1e-10
    )


def test_a_gap_ends_a_piece_and_a_lost_sample_does_not():
    log = recorded(seconds=12.0)
    valid = np.ones(len(log.t), dtype=bool)
    valid[500:503] = False
    valid[1200:1300] = False
    pieces = log_signals(replace(log, valid=valid))
    assert [round(piece.t[-1] - piece.t[0], 1) for piece in pieces] == [6.0, 5.5]
    with pytest.raises(InputError, match="3 s"):
        log_signals(replace(log, valid=np.arange(len(log.t)) < 300))
