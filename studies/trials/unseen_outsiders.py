"""Disturbances that no rule of the diagnosis has seen: none was diagnosed before it was flown for
the score.

That was on seed 44 for tail_fin and panning_camera, on seed 26 for spinning_lidar, and on seed 20
for the others. They are of other kinds than ``outsiders.OUTSIDERS``, and than those that were held
back before.
"""

import math

import numpy as np
from numpy.typing import NDArray

from windwrench.dynamics.vehicle import Vehicle
from windwrench.envs.plant import TICK
from windwrench.studies.trials.outsiders import Law, Maker, Moment

Array = NDArray[np.float64]


def _wrench(force: Array, torque: Array) -> Array:
    return np.concatenate([force, torque])


def counterweight(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> Law:
    """A safety line runs over a pulley 1 m above the flight to a counterweight: it always pulls
    there with 0.08 weights.
    """
    pulley = np.array([*path[:, :2].mean(axis=0), float(path[:, 2].max()) + 1.0])

    def law(m: Moment) -> Array:
        line = pulley - m.position
        return _wrench(
            0.08 * vehicle.weight / max(math.sqrt(line @ line), 1e-6) * line, np.zeros(3)
        )

    return law


def room_swirl(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> Law:
    """The room's air turns about its middle, fastest 0.5 m from there, and takes the vehicle along
    with up to 0.05 weights.
    """
    middle, sense = path[:, :2].mean(axis=0), rng.choice([-1.0, 1.0])

    def law(m: Moment) -> Array:
        x, y = (m.position[:2] - middle).tolist()
        swirl = (
            sense * 0.05 * vehicle.weight * 2.0 * 0.5 / (x * x + y * y + 0.5**2)
        )  # Scully's vortex
        return _wrench(swirl * np.array([-y, x, 0.0]), np.zeros(3))

    return law


def beating_rotors(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> Law:
    """Two rotors that are out of balance beat: 0.04 weights along body z at the difference of the
    rotor speeds of 1 and 3.
    """
    phase = rng.uniform(-math.pi, math.pi)

    def law(m: Moment) -> Array:
        nonlocal phase
        phase += TICK * float(m.speeds[0] - m.speeds[2])
        return _wrench(0.04 * vehicle.weight * math.cos(phase) * m.rotation[:, 2], np.zeros(3))

    return law


def spinning_lidar(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> Law:
    """A lidar spins about body z: its angular momentum h turns along, which takes 0.01 weights
    times the arm at 1 rad/s.

    The body feels -w x h, h along body z; the sense is drawn. The bearing's friction is the
    vehicle's own.
    """
    momentum = (
        rng.choice([-1.0, 1.0]) * 0.01 * vehicle.weight * vehicle.arm_l * np.array([0.0, 0.0, 1.0])
    )

    def law(m: Moment) -> Array:
        return _wrench(np.zeros(3), m.rotation @ np.cross(momentum, m.rate))

    return law


def tail_fin(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> Law:
    """A fin on a boom, an arm behind the centre: 0.04 weights at 1 m/s of air from the side."""
    boom = np.array([-vehicle.arm_l, 0.0, 0.0])

    def law(m: Moment) -> Array:
        air = m.velocity @ m.rotation + np.cross(m.rate, boom)
        force = np.array([0.0, -0.04 * vehicle.weight * air[1], 0.0])
        return _wrench(m.rotation @ force, m.rotation @ np.cross(boom, force))

    return law


def panning_camera(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> Law:
    """A camera of 0.05 weights, already weighed, slides to and fro on a rail along body y, 0.3 arms
    to either side in 5 s.

    With s its place and m its share of the mass, the body feels -m s'' along the rail, and at s the
    load -m times the rotors' thrust, which is all but the weight that a vehicle is moved by.
    """
    share, reach, w, phase = (
        0.05,
        0.3 * vehicle.arm_l,
        2.0 * math.pi / 5.0,
        rng.uniform(-math.pi, math.pi),
    )

    def law(m: Moment) -> Array:
        place = reach * math.sin(w * m.t + phase)
        force = np.array([0.0, share * vehicle.mass * w * w * place, 0.0])
        load = np.array([0.0, 0.0, -share * float(vehicle.k @ m.speeds**2)])
        return _wrench(m.rotation @ force, m.rotation @ np.cross([0.0, place, 0.0], load))

    return law


UNSEEN: dict[str, Maker] = {
    law.__name__: law
    for law in (counterweight, room_swirl, beating_rotors, spinning_lidar, tail_fin, panning_camera)
}
