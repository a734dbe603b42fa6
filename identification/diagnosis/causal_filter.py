"""The causal filter of a flight: from the poses of the past to the state at each sample, and what a
coefficient changes in its innovations.

The state is position, velocity, attitude, angular velocity and the disturbance's force and torque
as accelerations: 18 numbers. Each axis has its own steady gain, so the filter is an observer of
fixed gains: what an innovation changes with a coefficient follows from linear recursions, exactly
but for second order. Rotor speeds move linearly between samples.
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ...dynamics.model import MODEL_FIELDS, apply_effects, drive, load_model
from ...dynamics.motion import acceleration_of, angular_acceleration_of, body_numbers
from ...dynamics.rotation import normalise, quaternion_to_matrix, turn_body
from ...dynamics.vehicle import Vehicle
from ...runtime.compiled import Record, compiled, compiled_for_vectors
from .axis_filter import AxisNoise

Array = NDArray[np.float64]
_MODEL = np.dtype(MODEL_FIELDS)


@dataclass(frozen=True, eq=False)
class Poses:
    """An unbroken piece of a flight as it was measured, evenly spaced (n samples)."""

    t: Array  # (n,) s
    period: float  # s
    position: Array  # (n, 3) m
    quaternion: Array  # (n, 4), of continuous sign
    rotor_speeds: Array  # (n, 4) rad/s, at the samples
    voltage: Array  # (n,) V; 0 where it is not known
    velocity: Array  # (3,) m/s, at the start
    angular_velocity: Array  # (3,) rad/s, body, at the start


@dataclass(frozen=True, eq=False)
class State:
    """A piece of flight (n samples)."""

    t: Array  # (n,) s
    position: Array  # (n, 3) m, world
    rotation: Array  # (n, 3, 3) body to world
    velocity: Array  # (n, 3) m/s, world
    angular_velocity: Array  # (n, 3) rad/s, body
    acceleration: Array  # (n, 3) m/s2, world; of a track (n, 6), and rad/s2, body
    rotors: Array  # (n, 4) what the rotors' thrust and torques accelerate: m/s2, rad/s2, body


@dataclass(frozen=True, eq=False)
class Track(State):
    """A piece of a flight as the filter saw it, half a step on from what is known at sample k. Row
    k is of the step from sample k to k + 1, but for the predictions, which are of sample k. The
    acceleration is that of the model and its disturbance.
    """

    model: Array  # (n, 6) acceleration of the model alone
    predicted: Array  # (n, 7) position and quaternion at sample k, from samples before it
    innovations: Array  # (n, 6) m, and rad in the body frame


@compiled
def _turn(q: Array, w: Array, out: Array) -> None:
    """Write the quaternion after a rotation vector in the body frame."""
    turn_body(q, w[0], w[1], w[2], 1.0, out)
    normalise(out)


@compiled
def _run(
    models: Record,
    period: float,
    speeds: Array,
    voltage: Array,
    position: Array,
    quaternion: Array,
    begun: Array,
    gain: Array,
    keep: Array,
    aside: Array,
    known: Array,
    at_position: Array,
    at_rotation: Array,
    at_velocity: Array,
    at_rate: Array,
    acting: Array,
    rotors: Array,
    model: Array,
    predicted: Array,
    innovations: Array,
) -> None:
    f = models[0]
    b, nothing = body_numbers(f.body), (0.0, 0.0, 0.0)
    p, v, w, d = position[0].copy(), begun[:3].copy(), begun[3:].copy(), np.zeros(6)
    q, q2, r = quaternion[0].copy(), np.empty(4), np.empty((3, 3))
    step, mid, both = np.empty(3), np.empty(3), np.empty(4)
    v2, w2, before = np.empty(3), np.empty(3), np.zeros(6)
    half = 0.5 * period
    for k in range(len(speeds)):
        # what the last sample's rotors said
        for i in range(3):
            p[i] += known[k, i, 0]
            v[i] += known[k, i, 1]
            d[i] += known[k, i, 2]
            step[i] = known[k, 3 + i, 0]
            w[i] += known[k, 3 + i, 1]
            d[3 + i] += known[k, 3 + i, 2]
        _turn(q, step, q2)
        for i in range(4):
            q[i] = q2[i]
        for i in range(3):
            predicted[k, i] = p[i]
        for i in range(4):
            predicted[k, 3 + i] = q[i]
        # what the pose of this sample says
        o, m = q, quaternion[k]
        sign = 1.0 if o[0] * m[0] + o[1] * m[1] + o[2] * m[2] + o[3] * m[3] > 0.0 else -1.0
        e0 = sign * (o[0] * m[1] - o[1] * m[0] - o[2] * m[3] + o[3] * m[2])
        e1 = sign * (o[0] * m[2] + o[1] * m[3] - o[2] * m[0] - o[3] * m[1])
        e2 = sign * (o[0] * m[3] - o[1] * m[2] + o[2] * m[1] - o[3] * m[0])
        innovations[k, 3], innovations[k, 4], innovations[k, 5] = 2 * e0, 2 * e1, 2 * e2
        for i in range(3):
            e = position[k, i] - p[i]
            innovations[k, i] = e
            p[i] += gain[i, 0] * e
            v[i] += gain[i, 1] * e
            d[i] += gain[i, 2] * e
            e = innovations[k, 3 + i]
            step[i] = gain[3 + i, 0] * e
            w[i] += gain[3 + i, 1] * e
            d[3 + i] += gain[3 + i, 2] * e
        _turn(q, step, q2)
        # half a step on, where the model is asked; the acceleration is that of the step before
        for i in range(3):
            v2[i], w2[i] = v[i] + half * before[i], w[i] + half * before[3 + i]
            mid[i] = p[i] + half * v[i]
            step[i] = half * w[i]
        _turn(q2, step, q)
        quaternion_to_matrix(q, r)
        for i in range(4):
            both[i] = 0.5 * (speeds[k, i] + speeds[min(k + 1, len(speeds) - 1), i])
        drive(f, both, period, voltage[k])
        apply_effects(f, mid, r, v2, w2)
        f.time += period
        u, g = f.rotor_wrench, f.effect_wrench
        turn = (r[0, 0], r[0, 1], r[0, 2], r[1, 0], r[1, 1], r[1, 2], r[2, 0], r[2, 1], r[2, 2])
        thrust, effects = (u[0], u[1], u[2], u[3]), (g[0], g[1], g[2], g[3], g[4], g[5])
        a = acting[k]
        x, y, z = angular_acceleration_of(b, turn, (w[0], w[1], w[2]), thrust, nothing, effects)
        # of gyroscopic torque the rate half a step on counts, of this step's own acceleration
        omega = (
            w[0] + half * (x + d[3]),
            w[1] + half * (y + d[4]),
            w[2] + half * (z + d[5]),
        )
        x, y, z = angular_acceleration_of(b, turn, omega, thrust, nothing, effects)
        model[k, 3], model[k, 4], model[k, 5] = x, y, z
        turning = (x + d[3], y + d[4], z + d[5])
        x, y, z = acceleration_of(b, turn, omega, turning, thrust, nothing, effects)
        model[k, 0], model[k, 1], model[k, 2] = x, y, z
        for i in range(6):
            a[i] = before[i] = model[k, i] + d[i]
        for i in range(3):
            at_position[k, i], at_velocity[k, i], at_rate[k, i] = mid[i], v2[i], omega[i]
            for j in range(3):
                at_rotation[k, i, j] = r[i, j]
        for i in range(4):
            rotors[k, i] = f.rotor_wrench[i]
        # on to the next sample
        for i in range(3):
            p[i] += period * (v[i] + half * acting[k, i])
            v[i] += period * acting[k, i]
            step[i] = period * (w[i] + half * acting[k, 3 + i])
            w[i] += period * acting[k, 3 + i]
            d[i] *= keep[i]
            d[3 + i] *= keep[3 + i]
        # what the attitude says of the motion aside, which a wrong tilt has pulled
        lift = u[0] * b[21]
        for i in range(2):
            e = lift * (r[i, 0] * innovations[k, 4] - r[i, 1] * innovations[k, 3])
            p[i] += aside[i, 0] * e
            v[i] += aside[i, 1] * e
            d[i] += aside[i, 2] * e
        _turn(q2, step, q)


def run(
    poses: Poses, vehicle: Vehicle, noise: tuple[AxisNoise, ...], aside: Array, known: Array
) -> Track:
    """Return a piece as the filter with a vehicle's model and six axes' noise sees it.

    Args:
        poses: the piece.
        vehicle: with the model.
        noise: of each axis.
        aside: (2, 3) gain of position, velocity and disturbance of both horizontal axes, per unit
            of what an attitude's innovation turns of the rotors' acceleration.
        known: (n, 6, 3) what is added to pose, rate and disturbance of each axis before the pose of
            sample k is read.
    """
    models = np.zeros(1, dtype=_MODEL)
    load_model(models[0], vehicle)
    n = len(poses.t)
    shapes = ((3,), (3, 3), (3,), (3,), (6,), (4,), (6,), (7,), (6,))
    out = Track(poses.t, *(np.empty((n, *shape)) for shape in shapes))
    measured = (poses.rotor_speeds, poses.voltage, poses.position, poses.quaternion)
    speeds, voltage, position, quaternion = map(np.ascontiguousarray, measured)
    _run(
        models,
        poses.period,
        speeds,
        voltage,
        position,
        quaternion,
        np.concatenate([poses.velocity, poses.angular_velocity]),
        np.array([x.gain for x in noise]),
        np.exp(-poses.period / np.array([x.time for x in noise], dtype=np.float64)),
        aside,
        known,
        *(getattr(out, field.name) for field in fields(out)[1:]),
    )
    np.divide(out.rotors, [vehicle.mass, *np.diagonal(vehicle.inertia)], out=out.rotors)
    return out


@compiled_for_vectors
def sensitivities(
    period: float,
    gain: Array,
    keep: Array,
    aside: Array,
    pull: Array,
    rate: Array,
    acting: Array,
    moved: Array,
    jumps: Array,
    jump_state: np.ndarray,
    state: Array,
    out: Array,
) -> None:
    """Write by how much the innovations' predictions (n, 6, c) change with a unit of each column.

    Args:
        period: s.
        gain: (6, 3) of the axes.
        keep: (6,) what is left of a disturbance after a period.
        aside: (2, 3) of ``run``.
        pull: (n, 3, 2) by how much the acceleration (world) grows with an error of the attitude
            about body x and y.
        rate: (n, 3) angular velocity.
        acting: (n, 6, a) what a unit of the first ``a`` columns adds to the model's acceleration.
        moved: (n, 6, b) by how much a unit of the last ``b`` of those moves the measured pose.
        jumps: (n, 6, e) what a unit of the columns behind them adds to one state of each axis,
            before the pose of sample k is read.
        jump_state: (e,) the state: 0 the pose, 1 its rate, 2 the disturbance.
        state: (6, 3, c) carried from one call to the next.
        out: (n, 6, c).
    """
    n, a, b, e = len(acting), acting.shape[2], moved.shape[2], jumps.shape[2]
    c = a + e
    half = 0.5 * period * period
    before = np.empty((3, c))
    for k in range(n):
        for m in range(e):
            for i in range(6):
                state[i, jump_state[m], a + m] += jumps[k, i, m]
        for i in range(6):
            for j in range(c):
                out[k, i, j] = state[i, 0, j]
            for j in range(b):
                out[k, i, a - b + j] -= moved[k, i, j]
            for j in range(c):
                x = out[k, i, j]
                state[i, 0, j] -= gain[i, 0] * x
                state[i, 1, j] -= gain[i, 1] * x
                state[i, 2, j] -= gain[i, 2] * x
        for i in range(3):
            for j in range(c):
                before[i, j] = state[3 + i, 0, j]
        for i in range(3):
            px, py = pull[k, i, 0], pull[k, i, 1]
            for j in range(c):
                g = state[i, 2, j] + px * before[0, j] + py * before[1, j]
                if j < a:
                    g += acting[k, i, j]
                state[i, 0, j] += period * state[i, 1, j] + half * g
                state[i, 1, j] += period * g
                state[i, 2, j] *= keep[i]
        for i in range(3):
            x, y = (i + 1) % 3, (i + 2) % 3
            wx, wy = rate[k, x], rate[k, y]
            for j in range(c):
                g = state[3 + i, 2, j]
                if j < a:
                    g += acting[k, 3 + i, j]
                # an error in body axes turns back as these turn on
                state[3 + i, 0, j] += (
                    period * state[3 + i, 1, j]
                    + half * g
                    - period * (wx * before[y, j] - wy * before[x, j])
                )
                state[3 + i, 1, j] += period * g
                state[3 + i, 2, j] *= keep[3 + i]
        for i in range(2):
            px, py = pull[k, i, 0], pull[k, i, 1]
            for j in range(c):
                x = px * out[k, 3, j] + py * out[k, 4, j]
                state[i, 0, j] -= aside[i, 0] * x
                state[i, 1, j] -= aside[i, 1] * x
                state[i, 2, j] -= aside[i, 2] * x
