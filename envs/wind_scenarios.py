"""The scenarios of the tasks in the wind, and draws of their winds and references."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..dynamics.vehicle import NotNegative
from ..runtime.arrays import Array
from .references import figure_of_eight, hold, random_spline
from .scenarios import Drawn, Factors, Range, ScenarioBase, kept_scenarios
from .wind import (
    CompiledWind,
    FanWall,
    Gust,
    Shear,
    Turbulence,
    VehicleWash,
    low_altitude,
    switching,
)
from .wind.jets import TABLE_PERIOD


@dataclass(frozen=True)
class WindVariation(Drawn):
    """Domain randomisation of the tasks in the wind: factors on vehicle file and drag."""

    mass: Factors = (0.93, 1.07)  # the true vehicle's; filter and flight loop keep the declared
    inertia: Factors = (0.9, 1.1)
    rotor_drag: Range = (0.8, 1.2)
    hull_area: Range = (0.8, 1.2)


@dataclass(frozen=True)
class WindScenario(ScenarioBase):
    """Winds. A range is drawn from evenly, once an episode."""

    mean: Range = (0.0, 0.0)  # m/s at the vehicle's height, from any side; sheared by the log law
    # "", or the spectrum of turbulence: strengths, times ``strength``, and lengths are those of
    # MIL-F-8785C near the ground in the mean wind
    turbulence: Literal["", "dryden", "von-karman"] = ""
    strength: NotNegative = 1.0
    gusts: Range = (0.0, 0.0)  # m/s, of gusts 1 - cos of 1-3 m that pass every 3-6 s
    wall: Range = (0.0, 0.0)  # m/s, jets of a wall of 3 x 3 fans that switch by themselves
    wash: bool = False  # another vehicle crosses 1.0-1.6 m above, to and fro
    variation: WindVariation = WindVariation()


WIND_SCENARIOS = kept_scenarios("wind", WindScenario)

HEIGHT = 1.5  # m, of the vehicle
DISTANCE = 2.3  # m, from the wall of fans
START = np.array([DISTANCE, 0.0, HEIGHT])


def draw_winds(
    scenario: WindScenario, rng: np.random.Generator, seconds: float
) -> list[CompiledWind]:
    """Draw an episode's winds over ``seconds``; the same generator draws the same."""
    winds: list[CompiledWind] = []
    heading = rng.uniform(-math.pi, math.pi)
    mean = rng.uniform(*scenario.mean)
    wind = mean * np.array([math.cos(heading), math.sin(heading), 0.0])
    if mean > 0.0:
        winds.append(Shear(wind, reference=HEIGHT))
        if scenario.turbulence:
            # the log law of the terminal flight phase, from the vehicle's height up to 20 ft
            rough = 0.0457
            wind_20ft = mean * math.log(6.096 / rough) / math.log(HEIGHT / rough)
            sigma, length = low_altitude(HEIGHT, wind_20ft)
            strength, form = scenario.strength * sigma, scenario.turbulence
            winds.append(Turbulence(rng, strength, length, wind, form, modes=24))
    if scenario.wall[1] > 0.0:
        speeds = switching(rng, 9, seconds, scenario.wall)
        winds.append(FanWall(speeds, centre=(0.0, 0.0, HEIGHT), seed=rng))
    if scenario.gusts[1] > 0.0:
        at = rng.uniform(1.0, 3.0)
        while at < seconds:
            turn = rng.uniform(-math.pi, math.pi)
            size, rise = rng.uniform(*scenario.gusts), rng.uniform(1.0, 3.0)
            along = np.array([math.cos(turn), math.sin(turn), 0.0])
            winds.append(Gust(size * along, rise, start=at, speed=max(mean, size), front=START))
            at += rng.uniform(3.0, 6.0)
    if scenario.wash:
        period, turn = rng.uniform(4.0, 8.0), rng.uniform(-math.pi, math.pi)
        above, phase = rng.uniform(1.0, 1.6), rng.uniform(0.0, 2.0 * math.pi)
        t = TABLE_PERIOD * np.arange(math.ceil(seconds / TABLE_PERIOD) + 1)
        swing = 1.5 * np.sin(2.0 * math.pi * t / period + phase)
        path = START + np.column_stack(
            [swing * math.cos(turn), swing * math.sin(turn), np.full_like(t, above)]
        )
        winds.append(VehicleWash(path, seed=rng))
    return winds


def draw_reference(
    rng: np.random.Generator, yaw: float, seconds: float, moving: bool
) -> tuple[str, Array]:
    """Draw a reference: its name and its rows (n, 10), one a tick.

    Moving: a figure of eight or a spline. The former is 1.0-1.4 m along, 0.4-0.6 m across, in
    6-9 s, turned by any angle. The latter has a random point of a box of 2.4 x 2.4 x 0.8 m every
    1.5-2.2 s.
    """
    if not moving:
        return "hold", hold(START, yaw, seconds)
    if rng.random() < 0.5:
        size = rng.uniform(1.0, 1.4), rng.uniform(0.4, 0.6)
        period, turn = rng.uniform(6.0, 9.0), rng.uniform(-math.pi, math.pi)
        return "figure of eight", figure_of_eight(START, yaw, seconds, size, period, turn)
    every = rng.uniform(1.5, 2.2)
    box = np.array([1.2, 1.2, 0.4])
    return "spline", random_spline(rng, START, yaw, seconds, box, every)
