"""Disturbances outside the effect library that are drawn for no study: each led to a rule of the
diagnosis, which a test flies again. ``docs/diagnosis-trials.md`` names the commit that has the
eleven others, and what the diagnosis makes of all.
"""

import math

import numpy as np
from numpy.typing import NDArray

from windwrench.dynamics.vehicle import Vehicle
from windwrench.envs.plant import TICK
from windwrench.studies.trials.outsiders import ModelMaker, Moment, WrenchModel

Array = NDArray[np.float64]


def _wrench(force: Array, torque: Array) -> Array:
    return np.concatenate([force, torque])


def failing_cell(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> WrenchModel:
    """A battery cell fails and comes back: every rotor loses 6 % of its thrust for 2 to 6 s,
    several times.
    """
    change, weak = 0.0, False

    def model(m: Moment) -> Array:
        nonlocal change, weak
        if m.t >= change:
            weak, change = not weak, m.t + rng.uniform(2.0, 6.0)
        if not weak:
            return np.zeros(6)
        thrust = -0.06 * vehicle.k * m.speeds**2
        torque = np.array([0.0, 0.0, -(vehicle.spin * vehicle.p / vehicle.k) @ thrust])
        return _wrench(m.rotation[:, 2] * thrust.sum(), m.rotation @ torque)

    return model


def loose_gimbal(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> WrenchModel:
    """A camera turns about the pitch axis on a soft mount of 2 Hz; it adds 0.3 of the vehicle's
    inertia there.

    With s its angle to the body and a the body's angular acceleration, s'' = -a - w^2 s - 2 zeta w
    s', and the body feels the mount's torque, inertia (w^2 s + 2 zeta w s'); zeta is 0.05.
    """
    inertia, w, zeta = 0.3 * float(vehicle.inertia[1, 1]), 2.0 * math.pi * 2.0, 0.05
    angle, speed, last = 0.0, 0.0, 0.0

    def model(m: Moment) -> Array:
        nonlocal angle, speed, last
        turning, last = (float(m.rate[1]) - last) / TICK, float(m.rate[1])
        spring = w * w * angle + 2.0 * zeta * w * speed
        speed -= TICK * (spring + turning)
        angle += TICK * speed
        return _wrench(np.zeros(3), inertia * spring * m.rotation[:, 1])

    return model


def winding_cord(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> WrenchModel:
    """A cord winds up as the nose turns, and turns it back: 0.02 weights times the arm for each
    radian from the start.
    """
    turned, last = 0.0, math.nan

    def model(m: Moment) -> Array:
        nonlocal turned, last
        heading = math.atan2(m.rotation[1, 0], m.rotation[0, 0])
        if not math.isnan(last):
            turned += math.remainder(heading - last, 2.0 * math.pi)
        last = heading
        return _wrench(
            np.zeros(3), np.array([0.0, 0.0, -0.02 * vehicle.weight * vehicle.arm_l * turned])
        )

    return model


def passing_wash(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> WrenchModel:
    """Another vehicle crosses above, every 6 s in the mean, at 1 m/s: its wash, 0.3 m in radius,
    weighs up to 0.15 weights.

    Each rotor is in a draught of its own. The other one passes within 0.3 m of where this one ought
    to be by then.
    """
    rotors, speed = vehicle.positions - vehicle.com, 1.0
    when, through, along = -10.0, np.zeros(2), np.array([1.0, 0.0])

    def model(m: Moment) -> Array:
        nonlocal when, through, along
        if m.t > when + 2.0:
            when = m.t + 2.0 + rng.exponential(2.0)
            at = min(round(when / TICK), len(path) - 1)
            through = path[at, :2] + rng.uniform(-0.3, 0.3, 2)
            heading = rng.uniform(-math.pi, math.pi)
            along = np.array([math.cos(heading), math.sin(heading)])
        centre = through + speed * (m.t - when) * along
        arms = rotors @ m.rotation.T
        away = m.position[:2] + arms[:, :2] - centre
        push = -0.15 / 4.0 * vehicle.weight * np.exp(-0.5 / 0.3**2 * (away * away).sum(axis=1))
        return np.array([0.0, 0.0, push.sum(), arms[:, 1] @ push, -(arms[:, 0] @ push), 0.0])

    return model


HELD_BACK: dict[str, ModelMaker] = {
    model.__name__: model for model in (failing_cell, loose_gimbal, winding_cord, passing_wash)
}
