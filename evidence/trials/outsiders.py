"""Disturbances outside the effect library: what a diagnosis must not blame on a named effect.

Each is a small model of time, state and rotors that gives a force and a torque. Sizes are in
proportion to the vehicle: a force in its weight, a torque in its weight times the arm. Where a
model has a place (a wall, a column of rising air), the place is chosen from the set points of the
flight, so that the vehicle comes there.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from windwrench.dynamics.rotation import matrix_of
from windwrench.dynamics.vehicle import Vehicle
from windwrench.envs.closed_loop import ClosedLoop
from windwrench.envs.plant import TICK

Array = NDArray[np.float64]


class Moment(NamedTuple):
    """The true state at which a model is asked."""

    t: float  # s
    position: Array  # (3,) m, world, of the geometric centre
    velocity: Array  # (3,) m/s, world
    rotation: Array  # (3, 3) body to world
    rate: Array  # (3,) rad/s, body
    speeds: Array  # (4,) rad/s, of the rotors


# a wrench (6,): force in N and torque in Nm about the centre of mass, world frame
WrenchModel = Callable[[Moment], Array]
ModelMaker = Callable[[Vehicle, np.random.Generator, Array], WrenchModel]


def _at(force: Array, arm: Array) -> Array:
    """Return the wrench (6,) of a force (3,) at ``arm`` (3,) m from the centre of mass, both in the
    world frame.
    """
    (fx, fy, fz), (x, y, z) = force.tolist(), arm.tolist()
    return np.array([fx, fy, fz, y * fz - z * fy, z * fx - x * fz, x * fy - y * fx])


def _force(force: Array) -> Array:
    """Return the wrench (6,) of a force (3,) N at the centre of mass."""
    wrench = np.zeros(6)
    wrench[:3] = force
    return wrench


def _thrust_change(vehicle: Vehicle, m: Moment, change: Array) -> Array:
    """Return the wrench (6,) of rotors whose thrust changes by ``change`` (4,) N, and their drag
    torque in proportion.
    """
    arms = vehicle.positions - vehicle.com
    torque = np.array(
        [
            arms[:, 1] @ change,
            -arms[:, 0] @ change,
            -(vehicle.spin * vehicle.p / vehicle.k) @ change,
        ]
    )
    return np.concatenate([m.rotation[:, 2] * change.sum(), m.rotation @ torque])


def _draught(vehicle: Vehicle, m: Moment, centre: Array, radius: float, most: float) -> Array:
    """Return the wrench (6,) of a column of moving air about ``centre`` (2,) m, each rotor in its
    own draught: ``most`` N on a rotor at the centre, positive up; the radius (m) is one sigma.
    """
    arms = (vehicle.positions - vehicle.com) @ m.rotation.T
    away = m.position[:2] + arms[:, :2] - centre
    lift = most * np.exp(-0.5 / radius**2 * (away * away).sum(axis=1))
    return np.array([0.0, 0.0, lift.sum(), arms[:, 1] @ lift, -(arms[:, 0] @ lift), 0.0])


def _resonance(frequency_hz: float) -> Callable[[float], float]:
    """Return what a mass on a soft mount, s'' = -a - w^2 s - 2 zeta w s', pulls at its mount at
    each tick, w^2 s + 2 zeta w s', where the mount accelerates by a; zeta is 0.05.
    """
    w, zeta, place, speed = 2.0 * math.pi * frequency_hz, 0.05, 0.0, 0.0

    def pull(acceleration: float) -> float:
        nonlocal place, speed
        spring = w * w * place + 2.0 * zeta * w * speed
        speed -= TICK * (spring + acceleration)
        place += TICK * speed
        return spring

    return pull


def contact_pushes(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> WrenchModel:
    """Irregular transient disturbances of 0.05 to 0.13 weights, 0.2 to 1 s long and 1.5 s apart in
    the mean, anywhere on the hull.
    """
    start, end, force, point = 0.0, 0.0, np.zeros(3), np.zeros(3)

    def model(m: Moment) -> Array:
        nonlocal start, end, force, point
        if m.t >= end:
            start = m.t + rng.exponential(1.5)
            end = start + rng.uniform(0.2, 1.0)
            direction = rng.standard_normal(3)
            force = rng.uniform(0.05, 0.13) * vehicle.weight * direction / np.linalg.norm(direction)
            point = rng.uniform(-0.3, 0.3, 3) * vehicle.arm_l
        return _at(force, m.rotation @ point) if m.t >= start else np.zeros(6)

    return model


def tether(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> WrenchModel:
    """An elastic tether from a point on the floor to a leg: slack up to a length, then 0.25 weights
    a metre, 0.25 at most.
    """
    anchor = np.array([*path[:, :2].mean(axis=0), 0.0])
    slack = float(np.quantile(np.linalg.norm(path - anchor, axis=1), 0.3))
    leg = np.array([-0.3, 0.3, 0.0]) * vehicle.arm_l

    def model(m: Moment) -> Array:
        reach = anchor - m.position
        length = math.sqrt(reach @ reach)
        pull = vehicle.weight * min(max(0.25 * (length - slack), 0.0), 0.25)
        return _at(pull / max(length, 1e-6) * reach, m.rotation @ leg)

    return model


def wall_attraction(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> WrenchModel:
    """A wall across x just beyond the flight draws the vehicle on with 0.02 weights m2 / d^2, as
    from d = 0.4 m within it.
    """
    wall = float(path[:, 0].max()) + 0.4

    def model(m: Moment) -> Array:
        away = wall - m.position[0]
        return _force(
            np.array(
                [math.copysign(0.02 * vehicle.weight / max(abs(away), 0.4) ** 2, away), 0.0, 0.0]
            )
        )

    return model


def dry_friction(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> WrenchModel:
    """A force of 0.04 weights against the direction of travel, whatever the speed; it fades in up
    to 5 cm/s.
    """

    def model(m: Moment) -> Array:
        return _force(
            -0.04 * vehicle.weight / math.sqrt(m.velocity @ m.velocity + 0.05**2) * m.velocity
        )

    return model


def cubic_drag(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> WrenchModel:
    """A drag that grows with the cube of the speed: 0.006 weights at 1 m/s, a quarter of the weight
    at most.
    """

    def model(m: Moment) -> Array:
        square = float(m.velocity @ m.velocity)
        scale = min(0.006 * square, 0.25 / max(math.sqrt(square), 1e-6))
        return _force(-scale * vehicle.weight * m.velocity)

    return model


def magnus_force(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> WrenchModel:
    """A side force on a body that turns in yaw as it moves: 0.02 weights at 1 rad/s and 1 m/s,
    along yaw rate x velocity.
    """

    def model(m: Moment) -> Array:
        turn = 0.02 * vehicle.weight * float(m.rotation[2] @ m.rate)
        return _force(np.array([-turn * m.velocity[1], turn * m.velocity[0], 0.0]))

    return model


def patchy_drag(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> WrenchModel:
    """A linear drag in one half of the room only, and most with the nose along one wall: 0.08
    weights at 1 m/s at most.
    """
    middle, heading = float(np.median(path[:, 0])), rng.uniform(-math.pi, math.pi)

    def model(m: Moment) -> Array:
        yaw = math.atan2(m.rotation[1, 0], m.rotation[0, 0])
        share = (
            0.25
            * (1.0 + math.cos(yaw - heading))
            * (1.0 + math.tanh((m.position[0] - middle) / 0.2))
        )
        return _force(-0.08 * vehicle.weight * share * m.velocity)

    return model


def thermal_column(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> WrenchModel:
    """A column of rising air, 0.35 m in radius (one sigma), lifts with up to 0.12 weights, each
    rotor in its own draught.
    """
    centre = path[rng.integers(len(path)), :2]
    return lambda m: _draught(vehicle, m, centre, 0.35, 0.03 * vehicle.weight)


def flywheel(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> WrenchModel:
    """A flywheel about body z: the torque -omega x h of its precession, 0.015 weights times the arm
    at 1 rad/s of roll.
    """
    spin = 0.015 * vehicle.weight * vehicle.arm_l * rng.choice([-1.0, 1.0])

    def model(m: Moment) -> Array:
        torque = np.array([-m.rate[1] * spin, m.rate[0] * spin, 0.0])
        return np.concatenate([np.zeros(3), m.rotation @ torque])

    return model


def sloshing(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> WrenchModel:
    """A long level tank along the nose holds a tenth of the mass in liquid, already weighed, that
    sloshes at 1.2 Hz.

    The liquid accelerates with the vehicle along the tank, which feels its pull a third of an arm
    below the centre.
    """
    mass, last, liquid = 0.1 * vehicle.mass, np.zeros(3), _resonance(1.2)

    def model(m: Moment) -> Array:
        nonlocal last
        ahead = np.array([m.rotation[0, 0], m.rotation[1, 0], 0.0])
        ahead /= max(math.hypot(ahead[0], ahead[1]), 1e-6)
        pull = liquid(float((m.velocity - last) @ ahead) / TICK)
        last = m.velocity
        return _at(mass * pull * ahead, m.rotation @ np.array([0.0, 0.0, -0.3 * vehicle.arm_l]))

    return model


def rotor_dropouts(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> WrenchModel:
    """Rotor 2 now and then loses a tenth of its thrust for 0.3 s, 0.8 s apart in the mean."""
    start = rng.exponential(0.8)

    def model(m: Moment) -> Array:
        nonlocal start
        if m.t >= start + 0.3:
            start = m.t + rng.exponential(0.8)
        if m.t < start:
            return np.zeros(6)
        return _thrust_change(
            vehicle, m, np.array([0.0, -0.1 * vehicle.k[1] * m.speeds[1] ** 2, 0.0, 0.0])
        )

    return model


def vortex_ring(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> WrenchModel:
    """A descent faster than 0.3 m/s into the own wash costs thrust, 15 % for each m/s beyond, up to
    10 %, and buffets.
    """
    buffet = np.zeros(4)
    keep = math.exp(-TICK / 0.1)

    def model(m: Moment) -> Array:
        nonlocal buffet
        buffet = keep * buffet + math.sqrt(1.0 - keep * keep) * 0.4 * rng.standard_normal(4)
        loss = min(max(0.15 * (-m.velocity[2] - 0.3), 0.0), 0.1)
        return _thrust_change(vehicle, m, -loss * (1.0 + buffet) * vehicle.k * m.speeds**2)

    return model


def periodic_force(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> WrenchModel:
    """A sine of 0.5 Hz and 0.05 weights along one direction of the world."""
    direction, phase = rng.standard_normal(3), rng.uniform(0.0, 2.0 * math.pi)
    force = 0.05 * vehicle.weight * direction / np.linalg.norm(direction)

    def model(m: Moment) -> Array:
        return _force(math.sin(math.pi * m.t + phase) * force)

    return model


def thrust_saturation(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> WrenchModel:
    """Beyond 1.1 of its share of the weight a rotor delivers 30 % less of what its rotor speed
    promises.
    """
    knee = 1.1 * vehicle.weight / 4.0

    def model(m: Moment) -> Array:
        return _thrust_change(vehicle, m, -0.3 * np.maximum(vehicle.k * m.speeds**2 - knee, 0.0))

    return model


def torque_drift(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> WrenchModel:
    """The trim walks at random as things warm up: in 20 s by 0.02 weights times the arm in roll and
    pitch, a third in yaw.
    """
    step = (
        0.02 * vehicle.weight * vehicle.arm_l * math.sqrt(TICK / 20.0) * np.array([1.0, 1.0, 0.3])
    )
    torque = np.zeros(3)

    def model(m: Moment) -> Array:
        nonlocal torque
        torque = torque + step * rng.standard_normal(3)
        return np.concatenate([np.zeros(3), m.rotation @ torque])

    return model


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
        return np.concatenate([m.rotation[:, 2] * thrust.sum(), m.rotation @ torque])

    return model


def loose_gimbal(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> WrenchModel:
    """A camera turns about the pitch axis on a soft mount of 2 Hz; it adds 0.3 of the vehicle's
    inertia there, and the body feels the mount's torque.
    """
    inertia, last, camera = 0.3 * float(vehicle.inertia[1, 1]), 0.0, _resonance(2.0)

    def model(m: Moment) -> Array:
        nonlocal last
        turning, last = (float(m.rate[1]) - last) / TICK, float(m.rate[1])
        return np.concatenate([np.zeros(3), inertia * camera(turning) * m.rotation[:, 1]])

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
        return np.array([0.0] * 5 + [-0.02 * vehicle.weight * vehicle.arm_l * turned])

    return model


def passing_wash(vehicle: Vehicle, rng: np.random.Generator, path: Array) -> WrenchModel:
    """Another vehicle crosses above, every 6 s in the mean, at 1 m/s: its wash, 0.3 m in radius,
    weighs up to 0.15 weights.

    Each rotor is in a draught of its own. The other one passes within 0.3 m of where this one ought
    to be by then.
    """
    speed = 1.0
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
        return _draught(vehicle, m, centre, 0.3, -0.15 / 4.0 * vehicle.weight)

    return model


OUTSIDERS: dict[str, ModelMaker] = {
    model.__name__: model
    for model in (
        contact_pushes,
        tether,
        wall_attraction,
        dry_friction,
        cubic_drag,
        magnus_force,
        patchy_drag,
        thermal_column,
        flywheel,
        sloshing,
        rotor_dropouts,
        vortex_ring,
        periodic_force,
        thrust_saturation,
        torque_drift,
    )
}
# Drawn for no study: each led to a rule of the diagnosis, which a test flies again.
HELD_BACK: dict[str, ModelMaker] = {
    model.__name__: model for model in (failing_cell, loose_gimbal, winding_cord, passing_wash)
}


def wrench_input(model: WrenchModel, size: float = 1.0) -> Callable[[ClosedLoop], Array]:
    """Return what gives a loop its wrench (6,) of a model at each tick, times ``size``."""

    def wrench_of(loop: ClosedLoop) -> Array:
        return size * model(
            Moment(
                loop.time,
                loop.position,
                loop.velocity.copy(),
                matrix_of(loop.quaternion),
                loop.data.qvel[3:6],
                loop.record[0]["plant"]["speeds"],
            )
        )

    return wrench_of
