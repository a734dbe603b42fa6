"""A figure of eight in five winds, flown by PD, INDI and L1 with gains fitted without wind."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from windwrench.controllers.flight import FlightGains
from windwrench.controllers.wind_laws import INDI, FlightLoopAlone, L1Adaptive, WindLaw
from windwrench.controllers.wind_observation import (
    FORCE,
    LAST_ACTION,
    POSITION_ERROR,
    REFERENCE_ACCELERATION,
    REFERENCE_VELOCITY,
    ROTOR_FORCE,
    SPECIFIC_FORCE,
    VELOCITY,
    WIND_OBSERVATION_SIZE,
    WIND_PERIOD,
)
from windwrench.dynamics import load_vehicle
from windwrench.dynamics.effects import parse_setting
from windwrench.dynamics.motion import Array
from windwrench.envs.fan import Fan
from windwrench.envs.plant import TICK, PlantSettings
from windwrench.envs.references import REFERENCE_FADE
from windwrench.envs.wind import CompiledWind, GridWind, Turbulence
from windwrench.envs.wind_tasks import ACCELEROMETER, WIND_DECISION_TICKS
from windwrench.envs.windy_flight import WINDY_NOISE, WindyFlight

WINDS = ("0", "4.2", "8.5", "8.5 + 2.4 sin t", "12.1")
PUBLISHED = {  # tracking RMSE, m
    "PD": (0.112, 0.127, 0.243, 0.357, 0.457),
    "INDI": (0.080, 0.086, 0.169, 0.123, 0.281),
}
LAP = 2.0 * math.pi  # s
SECONDS = 3.0 * LAP + REFERENCE_FADE  # the first lap is not counted
SETTLE = 20.0  # s of hover in the wind before it, in which integrals take up what is steady
SEEDS = 8
_FILE = Path(__file__).with_name("vehicle.yaml")


@dataclass(frozen=True)
class Assumed:
    """What the publication's table does not state; where from, the page says."""

    # control law of the published flights, by the log of one without wind; x, y, z
    position_gain: tuple[float, float, float] = (2.60, 2.60, 2.98)  # 1/s2
    velocity_gain: tuple[float, float, float] = (3.96, 3.96, 2.65)  # 1/s
    integral_gain: float = 1.07  # 1/s3
    l1_bandwidth: float = 10.0  # rad/s
    disturbance: float = (
        0.1  # of what a vehicle of this size has in the tasks, by its lateral error
    )
    # what rotors deliver beyond what is commanded, over the relative change of thrust about hover
    thrust_curvature: float = 0.41
    # drag, by the residual force of published flights in three winds
    rotor_drag: float = 0.13  # N/(m/s), each rotor
    hull_area: float = 0.15  # m2, drag area
    turbulence: float = 0.05  # of the mean wind; a wall of many small fans is smooth
    length: float = 0.5  # m, of its eddies


def wind_of(name: str, seed: int, assumed: Assumed) -> list[CompiledWind]:
    """Return what blows along x in one of ``WINDS``."""
    if name == "0":
        return []
    mean = float(name.split()[0])
    t = 0.02 * np.arange(round((SETTLE + SECONDS) / 0.02) + 1)
    speed = mean + (2.4 * np.sin(t) if "sin" in name else 0.0 * t)
    table = np.zeros((len(t), 1, 1, 1, 3))
    table[:, 0, 0, 0, 0] = speed
    gusts = Turbulence(seed, assumed.turbulence * mean, assumed.length, (mean, 0.0, 0.0), modes=32)
    return [GridWind((t, [0.0], [0.0], [0.0]), table), gusts]


def reference() -> Array:
    """Return an upright figure of eight, 2.5 m wide along x and 1.5 m high, in 2 pi seconds."""
    t = TICK * np.arange(round(SECONDS / TICK) + 1)
    u = np.clip(t / REFERENCE_FADE, 0.0, 1.0)
    phase = REFERENCE_FADE * (2.5 * u**4 - 3.0 * u**5 + u**6) + np.maximum(t - REFERENCE_FADE, 0.0)
    rows = np.zeros((len(t), 10))
    rows[:, 0] = 1.25 * np.sin(phase)
    rows[:, 2] = 2.0 + 0.75 * np.sin(2.0 * phase)
    rows[:, 3:6] = np.gradient(rows[:, :3], TICK, axis=0)
    rows[:, 6:9] = np.gradient(rows[:, 3:6], TICK, axis=0)
    return rows


class Unlimited:
    """A position loop with what a law adds to it, without the tasks' limit on that: the drag of the
    strongest wind is more.
    """

    def __init__(self, law: WindLaw, assumed: Assumed, integral: float) -> None:
        self._law, self._integral, self._sum = law, integral, np.zeros(3)
        self._more = [
            np.array(gain) - gain[0] for gain in (assumed.position_gain, assumed.velocity_gain)
        ]
        law.reset()

    def __call__(self, observation: Array) -> Array:
        """Return the acceleration (3,) m/s2 beside the flight loop's own."""
        error = observation[POSITION_ERROR]
        rate = observation[REFERENCE_VELOCITY] - observation[VELOCITY]
        self._sum = self._sum + WIND_PERIOD * error
        feedback = self._more[0] * error + self._more[1] * rate + self._integral * self._sum
        action: Array = feedback + self._law.against_the_wind(observation, None)
        return action


def pilot_of(law: str, cutoff: float, assumed: Assumed) -> Unlimited:
    """Return the position loop of a law; ``cutoff`` is INDI's, Hz."""
    if law == "INDI":
        return Unlimited(INDI(cutoff=cutoff), assumed, 0.0)
    if law == "L1":
        return Unlimited(L1Adaptive(pole=2.0, bandwidth=assumed.l1_bandwidth), assumed, 0.0)
    return Unlimited(FlightLoopAlone(), assumed, assumed.integral_gain)


LAWS = ("PD", "INDI", "L1")


def fly(law: str, cutoff: float, wind: str, seed: int, assumed: Assumed) -> float:
    """Return the RMSE of position, m, after the first lap; infinite where the vehicle is lost."""
    declared, rows = load_vehicle(str(_FILE)), reference()
    pilot = pilot_of(law, cutoff, assumed)
    curve = f"thrust_curvature:a={assumed.thrust_curvature}"
    true = declared.with_effects(parse_setting(curve))
    settings = PlantSettings.for_vehicle(declared)
    gains = FlightGains(
        position=assumed.position_gain[0],
        velocity=assumed.velocity_gain[0],
        integral=0.0,
        tilt_limit=0.9,
    )
    flight = WindyFlight(
        declared,
        true,
        fan=Fan(speed=0.0, rotor_drag=assumed.rotor_drag, hull_area=assumed.hull_area),
        settings=replace(
            settings,
            disturbance_force=assumed.disturbance * settings.disturbance_force,
            disturbance_torque=assumed.disturbance * settings.disturbance_torque,
        ),
        gains=gains,
        accelerometer=ACCELEROMETER,
    )
    rng = np.random.default_rng(seed)
    waiting = round(SETTLE / TICK)
    rows = np.vstack([np.repeat(rows[:1], waiting, axis=0), rows])
    flight.reset(rng, rows[0, :3], 0.0, wind_of(wind, seed, assumed), rows, settle=300)
    errors = []
    for _ in range((len(rows) - 1) // WIND_DECISION_TICKS):
        flight.action[:] = pilot(_observation(flight, rows[min(flight.ticks, len(rows) - 1)]))
        flight.run(rng.standard_normal((WIND_DECISION_TICKS, WINDY_NOISE)))
        if not flight.healthy():
            return math.inf
        row = rows[min(flight.ticks, len(rows) - 1)]
        if flight.ticks * TICK > SETTLE + LAP + REFERENCE_FADE:
            errors.append(float(np.sum((flight.loop.position - row[:3]) ** 2)))
    return math.sqrt(float(np.mean(errors)))


def _observation(flight: WindyFlight, row: Array) -> Array:
    x, o = flight.loop.state, np.zeros(WIND_OBSERVATION_SIZE)
    o[POSITION_ERROR], o[VELOCITY], o[FORCE] = row[:3] - x[:3], x[7:10], x[16:19]
    o[REFERENCE_VELOCITY], o[REFERENCE_ACCELERATION] = row[3:6], row[6:9]
    ready = flight.ticks > 0  # nothing was measured before
    o[SPECIFIC_FORCE] = flight.specific if ready else (0.0, 0.0, 9.81)
    o[ROTOR_FORCE] = flight.thrust if ready else (0.0, 0.0, 9.81)
    o[LAST_ACTION:] = flight.action
    return o


def fit(target: float, assumed: Assumed) -> float:
    """Return the cut-off (Hz) with which INDI's RMSE without wind is the published one, or the end
    of 0.05-10 that comes closest.
    """

    def over(log_cutoff: float) -> float:
        some = [fly("INDI", math.exp(log_cutoff), "0", 1000 + k, assumed) for k in range(2)]
        return math.log(float(np.mean(some)) / target)

    low, high = math.log(0.05), math.log(10.0)
    if over(low) <= 0.0:
        return math.exp(low)
    if over(high) >= 0.0:
        return math.exp(high)
    return math.exp(float(brentq(over, low, high, xtol=0.05)))
