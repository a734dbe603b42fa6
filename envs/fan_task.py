"""The base of the tasks in front of a fan."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from ..controllers.briefing import Air, Briefing, FilterNoise, Jet, Motions
from ..controllers.observation import MAX_COMMAND
from ..runtime.arrays import Array
from .fan import Fan
from .plant import TICK, PlantSettings
from .scenarios import SCENARIOS
from .state import Start, State
from .task import Task

DISTANCE = 2.3  # m, from the fan
TRACKING_WIDTH = 0.3  # m, offset at which the tracking reward is a half
CHANGE_COST = 0.05  # a change of an action from 0 to 1
AWAY = 1.0  # m, off its height or its distance, at which a vehicle is lost
# largest size of a frame's numbers: N, Nm, m/s and m/s
LIMITS = (10.0, 10.0, 10.0, 1.0, 1.0, 1.0, 5.0, MAX_COMMAND)
# divisors: N, Nm, m/s and m/s; the jet's effect on the standard vehicle
SCALES = (0.5, 0.5, 0.5, 0.03, 0.03, 0.03, 0.5, 1.0)


class FanTask(Task):
    """Base of the tasks in front of a fan: the fan moves along a path of y and height, and the
    agent moves across its jet along ``axes``.
    """

    scenarios: ClassVar[Mapping[str, Any]] = SCENARIOS
    action, observation, decision_hz, normalize = "velocity", "own", 12.5, False
    follows, model_in_loop = False, False
    accelerometer: ClassVar[tuple[float, float] | None] = None
    label, draws = "fan_motion", 1
    largest_action = MAX_COMMAND
    standard: ClassVar[Fan]

    def __init__(self, *shared: Any, fan: Fan | None = None, **named: Any) -> None:
        super().__init__(*shared, **named)
        fan = fan or self.standard.sized(self.truth)
        self.fan = replace(fan, turbulence=self.scenario.turbulence)

    @property
    def times(self) -> Array:
        """Times (n,) s of the ticks of an episode."""
        return TICK * np.arange(round(self.episode_s / TICK) + 2, dtype=np.float64)

    def start(self, rng: np.random.Generator, n: int) -> Start:
        """Draw paths of the fan; hover beside their starts, facing the fan."""
        drawn = [self.draw_path(rng) for _ in range(n)]
        distance = self.drawn.get("distance", DISTANCE)
        places = [[distance, *(path[0] + beside), math.pi] for _, path, beside in drawn]
        labels, paths, _ = zip(*drawn, strict=True)
        return Start(np.array(places), paths=paths, labels=labels)

    def draw_path(self, rng: np.random.Generator) -> tuple[str, Array, Array]:
        """Return the motion's name, the fan's path (m, 2) m, and the vehicle's start (2,) m beside
        the fan's axis.
        """
        raise NotImplementedError

    def off_axis(self, s: State) -> Array:
        """Return the vehicles' offsets (n, axes) m from the fan's axis."""
        raise NotImplementedError

    def observe(self, s: State) -> Array:
        """Return the task's own observation (n, 6 + 2 axes)."""
        e, axes = s.estimate, self.axes
        velocity = e.velocity[:, axes[0] : axes[-1] + 1]
        return np.concatenate([e.force, e.torque, velocity, s.command], axis=1)

    def reward_terms(self, s: State) -> dict[str, Any]:
        """Return ``tracking`` and ``change``."""
        ratio = self.off_axis(s) / TRACKING_WIDTH
        return {
            "tracking": 1.0 / (1.0 + (ratio * ratio).sum(axis=1)),
            "change": -CHANGE_COST * s.change,
        }

    def briefing(self) -> Briefing:
        """Return the declared vehicle, the standard fan, the tuning of the filter, the scenario's
        motions and its air.
        """
        fan, scenario = self.fan, self.scenario
        plant = self.settings or PlantSettings.for_vehicle(self.vehicle)
        air = Air(
            plant.disturbance_force,
            plant.disturbance_torque,
            plant.disturbance_time,
            fan.turbulence,
            fan.gust_length,
            fan.gust_time,
        )
        jet = Jet(fan.speed, fan.rotor_drag, fan.hull_area, DISTANCE)
        motions = Motions(scenario.motions, scenario.speed, offset=scenario.offset)
        return Briefing(self.vehicle, FilterNoise.of(self.tuning, TICK), air, jet, motions)

    def _truth(self) -> dict[str, Any]:
        """Return ``Task._truth``, the places (3,) m of vehicle and set point, and the fan's axis
        now and after each decision to come, (foresight + 1, 2) m.
        """
        loop, path = self.loop, self.path
        rows = loop.ticks - 1 + self.decision_ticks * np.arange(self.foresight + 1)
        return super()._truth() | {
            "place": loop.position.copy(),
            "setpoint": loop.setpoint[:3].copy(),
            "fan_ahead": path[np.clip(rows, 0, len(path) - 1)],
        }
