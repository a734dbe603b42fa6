"""What filter and flight loop know of a vehicle, and what the vehicle truly is."""

import numpy as np
import pytest

from windwrench.controllers import Admittance
from windwrench.dynamics import load_vehicle
from windwrench.dynamics.vehicle import EffectSetting
from windwrench.envs.fan_tracking import FanTrackingEnv
from windwrench.evaluation.episodes import fly_episode

VEHICLE = load_vehicle("ardrone2")
HEAVY = EffectSetting("mass", {"dm": 0.06})


def test_a_declared_effect_does_not_come_into_the_world_twice():
    for model in (VEHICLE, VEHICLE.with_effects(HEAVY)):
        env = FanTrackingEnv("base", vehicle=model, truth=VEHICLE, effects=(HEAVY,))
        env.reset(seed=0)
        body = env.loop.model.body("vehicle").id
        assert env.loop.model.body_mass[body] == pytest.approx(0.525)


def test_without_a_truth_the_true_vehicle_is_as_declared():
    vehicle = VEHICLE.with_effects(EffectSetting("rotor_drag", {"kdx": 1e-4, "kdy": 1e-4}))
    flown = [
        fly_episode(FanTrackingEnv("varied", vehicle=vehicle, truth=truth), Admittance(), 5)
        for truth in (None, vehicle, VEHICLE)
    ]
    assert np.array_equal(flown[0].observation, flown[1].observation)
    assert not np.array_equal(flown[0].observation, flown[2].observation)


def test_the_flight_loop_knows_a_declared_mass():
    """The flight loop commands the thrust that the true weight needs: the height does not sag."""
    heights = []
    for model in (VEHICLE, VEHICLE.with_effects(HEAVY)):
        env = FanTrackingEnv("static", vehicle=model, truth=VEHICLE, effects=(HEAVY,))
        env.reset(seed=0)  # it settles for 1.5 s
        heights.append(float(env.loop.position[2] - env.fan.height))
    assert heights[0] < -0.05
    assert abs(heights[1]) < 0.3 * abs(heights[0])
