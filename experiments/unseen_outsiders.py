"""Disturbances that no rule of the diagnosis has seen: none was diagnosed before it was flown for the score.

That was on seed 26 for spinning_lidar, and on seed 20 for the others. They are of other kinds than ``outsiders.OUTSIDERS``, and
than those that were held back before.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ..dynamics.vehicle import Vehicle
from ..envs.plant import TICK
from .outsiders import Law, Maker, Moment

Array = NDArray[np.float64]


def _wrench(force: Array, torque: Array) -> Array:
    return np.concatenate([force, torque])


def passing_wash(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> Law:
    """Another vehicle crosses above, every 6 s in the mean, at 1 m/s: its wash, 0.3 m in radius, weighs up to 0.15 weights.

    Each rotor is in a draught of its own. The other one passes within 0.3 m of where this one ought to be by then.
    """
    rotors, speed = vehicle.positions - vehicle.com, 1.0
    when, through, along = -10.0, np.zeros(2), np.array([1.0, 0.0])

    def law(m: Moment) -> Array:
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

    return law


def counterweight(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> Law:
    """A safety line runs over a pulley 1 m above the flight to a counterweight: it always pulls there with 0.08 weights."""
    pulley = np.array([*path[:, :2].mean(axis=0), float(path[:, 2].max()) + 1.0])

    def law(m: Moment) -> Array:
        line = pulley - m.position
        return _wrench(0.08 * vehicle.weight / max(math.sqrt(line @ line), 1e-6) * line, np.zeros(3))

    return law


def room_swirl(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> Law:
    """The room's air turns about its middle, fastest 0.5 m from there, and takes the vehicle along with up to 0.05 weights."""
    middle, sense = path[:, :2].mean(axis=0), rng.choice([-1.0, 1.0])

    def law(m: Moment) -> Array:
        x, y = (m.position[:2] - middle).tolist()
        swirl = sense * 0.05 * vehicle.weight * 2.0 * 0.5 / (x * x + y * y + 0.5**2)  # Scully's vortex
        return _wrench(swirl * np.array([-y, x, 0.0]), np.zeros(3))

    return law


def beating_rotors(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> Law:
    """Two rotors that are out of balance beat: 0.04 weights along body z at the difference of the turn rates of 1 and 3."""
    phase = rng.uniform(-math.pi, math.pi)

    def law(m: Moment) -> Array:
        nonlocal phase
        phase += TICK * float(m.speeds[0] - m.speeds[2])
        return _wrench(0.04 * vehicle.weight * math.cos(phase) * m.rotation[:, 2], np.zeros(3))

    return law


def spinning_lidar(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> Law:
    """A lidar spins about body z: its angular momentum h turns along, which takes 0.01 weights times the arm at 1 rad/s.

    The body feels -w x h, h along body z; the sense is drawn. The bearing's friction is the vehicle's own.
    """
    momentum = rng.choice([-1.0, 1.0]) * 0.01 * vehicle.weight * vehicle.arm_l * np.array([0.0, 0.0, 1.0])

    def law(m: Moment) -> Array:
        return _wrench(np.zeros(3), m.rotation @ np.cross(momentum, m.rate))

    return law


UNSEEN: dict[str, Maker] = {
    law.__name__: law for law in (passing_wash, counterweight, room_swirl, beating_rotors, spinning_lidar)
}
