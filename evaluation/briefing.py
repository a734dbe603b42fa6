"""What an environment lets a designed controller know of itself before it flies."""

from dataclasses import replace
from typing import Any

from ..controllers.briefing import Air, Briefing, FilterNoise, Jet, Motions
from ..dynamics.vehicle import Mocap
from ..envs.fan_tracking import DISTANCE, FanTask
from ..envs.plant import TICK, PlantSettings
from ..estimator.tuning import UKFTuning


def briefing_of(env: Any) -> Briefing:
    """Return the briefing of an environment that has been reset: the declared vehicle, and in front
    of a fan the standard one, the noise of the pose, the tuning of the filter, the scenario's
    motions and its air. Of what is drawn anew in an episode, and of undeclared effects, it says
    nothing.
    """
    inner = env.unwrapped
    world = getattr(inner, "current", inner)  # one that mixes scenarios has one now
    if not isinstance(world, FanTask):
        return Briefing(world.vehicle)
    scenario, vehicle, fan = world.scenario, world.vehicle, world.fan
    pose = Mocap(1.0 / TICK, scenario.sigma_position, scenario.sigma_attitude)
    tuning = UKFTuning.for_vehicle(replace(vehicle, mocap=pose), TICK, scenario.rise_time)

    settings = world.settings or PlantSettings.for_vehicle(vehicle)
    return Briefing(
        vehicle,
        FilterNoise.of(tuning, TICK),
        Air(
            settings.disturbance_force,
            settings.disturbance_torque,
            settings.disturbance_time,
            fan.turbulence,
            fan.gust_length,
            fan.gust_time,
        ),
        Jet(fan.speed, fan.rotor_drag, fan.hull_area, DISTANCE),
        Motions(scenario.motions, scenario.speed, offset=scenario.offset),
    )
