"""The causal filter of a flight: the state at each sample from past poses, and the derivative of
its innovations by a coefficient.

The state is position, velocity, attitude, angular velocity and the disturbance's force and torque
as accelerations: 18 numbers. Rolls and pitches are about the world's x and y, turned with the
heading. There each axis has a steady gain, whatever the yaw. So the filter is an observer of fixed
gains, and linear recursions give the derivatives of its innovations, exactly but for second order.
Rotor speeds move linearly between samples.
"""

import math
from dataclasses import dataclass, fields

import numpy as np

from ...dynamics.model import apply_effects, drive
from ...dynamics.motion import acceleration_of, angular_acceleration_of, body_numbers
from ...dynamics.rotation import normalise, quaternion_to_matrix, turn_body
from ...dynamics.vehicle import Vehicle
from ...runtime.compiled import Record, compiled, compiled_for_vectors, compiled_inline
from ..logs.table import Array
from ..motion.residual import loaded_model, model_numbers
from .steady_filter import PARTNER, SteadyFilter

STRAIGHT = (0, 1, 2, 5)  # axes not turned by the heading


@dataclass(frozen=True, eq=False)
class Poses:
    """An unbroken piece of a flight as measured, evenly spaced (n samples)."""

    t: Array  # (n,) s
    period: float  # s
    position: Array  # (n, 3) m
    quaternion: Array  # (n, 4), of continuous sign
    rotor_speeds: Array  # (n, 4) rad/s, at the samples
    voltage: Array  # (n,) V; 0 where unknown
    velocity: Array  # (3,) m/s, at the start
    angular_velocity: Array  # (3,) rad/s, body, at the start


@dataclass(frozen=True, eq=False)
class FlightState:
    """A piece of flight (n samples)."""

    t: Array  # (n,) s
    position: Array  # (n, 3) m, world
    rotation: Array  # (n, 3, 3) body to world
    velocity: Array  # (n, 3) m/s, world
    angular_velocity: Array  # (n, 3) rad/s, body
    acceleration: Array  # (n, 3) m/s2, world; of a track (n, 6), and rad/s2, body
    rotors: Array  # (n, 4) accelerations by the rotors' thrust and torques: m/s2, rad/s2, body


@dataclass(frozen=True, eq=False)
class Track(FlightState):
    """A piece of a flight as the filter saw it, half a step on from sample k.

    Row k describes the step from sample k to k + 1; its predictions are of sample k. The
    acceleration includes the disturbance.
    """

    model: Array  # (n, 6) acceleration of the model alone
    predicted: Array  # (n, 7) position and quaternion at sample k, from the samples before
    heading: Array  # (n, 2) cosine and sine, at sample k
    innovations: Array  # (n, 6) m, world; rad, as ``level`` returns them
    disturbance: Array  # (n, 6) m/s2, world; rad/s2


def level(heading: Array, x: Array) -> Array:
    """Return vectors (n, 3) in body axes about three others: the world's x and y, turned with the
    heading (n, 2), and body z.
    """
    (c, s), out = heading.T, x.copy()
    out[:, 0], out[:, 1] = c * x[:, 0] - s * x[:, 1], s * x[:, 0] + c * x[:, 1]
    return out


@compiled_inline
def _turned(ahead: float, left: float, x: float, y: float) -> tuple[float, float]:
    """Return a vector about axes turned by a heading, with cosine ``ahead`` and sine ``left``."""
    return ahead * x + left * y, ahead * y - left * x


@compiled
def _turn(q: Array, w: Array, out: Array) -> None:
    """Write the quaternion after a rotation vector in the body frame."""
    turn_body(q, w[0], w[1], w[2], 1.0, out)
    normalise(out)


@compiled
def _add(
    said: Array, ahead: float, left: float, moving: Array, turning: Array, turn: Array
) -> None:
    """Add corrections (6, 3) of pose, rate and disturbance, in the directions of
    ``Track.innovations``, to the states of position (3, 3) and to the attitude's rate and
    disturbance (2, 3); write the attitude's turn (3,).
    """
    for s in range(3):
        for i in range(3):
            moving[s, i] += said[i, s]
        x, y = _turned(ahead, left, said[3, s], said[4, s])
        if s == 0:
            turn[0], turn[1], turn[2] = x, y, said[5, s]
        else:
            turning[s - 1, 0] += x
            turning[s - 1, 1] += y
            turning[s - 1, 2] += said[5, s]


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
    known: Array,
    at_position: Array,
    at_rotation: Array,
    at_velocity: Array,
    at_rate: Array,
    acting: Array,
    rotors: Array,
    model: Array,
    predicted: Array,
    heading: Array,
    innovations: Array,
    disturbance: Array,
) -> None:
    f = models[0]
    b, nothing = body_numbers(f.body), (0.0, 0.0, 0.0)
    moving, turning = np.zeros((3, 3)), np.zeros((2, 3))
    moving[0], moving[1], turning[0] = position[0], begun[:3], begun[3:]
    p, v, d, w, torque = moving[0], moving[1], moving[2], turning[0], turning[1]
    q, q2, r = quaternion[0].copy(), np.empty(4), np.empty((3, 3))
    step, mid, both = np.empty(3), np.empty(3), np.empty(4)
    v2, w2, before = np.empty(3), np.empty(3), np.zeros(6)
    half, say = 0.5 * period, np.empty((6, 3))
    quaternion_to_matrix(q, r)
    ahead, left = 1.0, 0.0
    for k in range(len(speeds)):
        size = math.hypot(r[0, 0], r[1, 0])
        if size > 0.0:
            ahead, left = r[0, 0] / size, r[1, 0] / size
        heading[k, 0], heading[k, 1] = ahead, left
        # the correction by the last sample's rotors
        _add(known[k], ahead, left, moving, turning, step)
        _turn(q, step, q2)
        q[:] = q2
        predicted[k, :3], predicted[k, 3:] = p, q
        # the correction by this sample's pose
        o, m = q, quaternion[k]
        sign = 1.0 if o[0] * m[0] + o[1] * m[1] + o[2] * m[2] + o[3] * m[3] > 0.0 else -1.0
        e0 = sign * (o[0] * m[1] - o[1] * m[0] - o[2] * m[3] + o[3] * m[2])
        e1 = sign * (o[0] * m[2] + o[1] * m[3] - o[2] * m[0] - o[3] * m[1])
        e2 = sign * (o[0] * m[3] - o[1] * m[2] + o[2] * m[1] - o[3] * m[0])
        e = innovations[k]
        x, y = _turned(ahead, -left, e0, e1)
        e[3], e[4], e[5] = 2 * x, 2 * y, 2 * e2
        for i in range(3):
            e[i] = position[k, i] - p[i]
        for i in range(6):
            for s in range(3):
                say[i, s] = gain[i, s, 0] * e[i] + gain[i, s, 1] * e[PARTNER[i]]
        _add(say, ahead, left, moving, turning, step)
        _turn(q, step, q2)
        # half a step on, for the model; the acceleration is the last step's
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
        turn, thrust, effects = model_numbers(f, r)
        a = acting[k]
        x, y, z = angular_acceleration_of(b, turn, (w[0], w[1], w[2]), thrust, nothing, effects)
        # gyroscopic torque is by the rate half a step on, with this step's own acceleration
        omega = (
            w[0] + half * (x + torque[0]),
            w[1] + half * (y + torque[1]),
            w[2] + half * (z + torque[2]),
        )
        x, y, z = angular_acceleration_of(b, turn, omega, thrust, nothing, effects)
        model[k, 3], model[k, 4], model[k, 5] = x, y, z
        spin = (x + torque[0], y + torque[1], z + torque[2])
        x, y, z = acceleration_of(b, turn, omega, spin, thrust, nothing, effects)
        model[k, 0], model[k, 1], model[k, 2] = x, y, z
        disturbance[k, :3], disturbance[k, 3:] = d, torque
        for i in range(3):
            a[i] = before[i] = model[k, i] + d[i]
            a[3 + i] = before[3 + i] = model[k, 3 + i] + torque[i]
            at_rate[k, i] = omega[i]
        at_position[k], at_velocity[k], at_rotation[k] = mid, v2, r
        rotors[k] = f.rotor_wrench
        # on to the next sample
        for i in range(3):
            p[i] += period * (v[i] + half * acting[k, i])
            v[i] += period * acting[k, i]
            step[i] = period * (w[i] + half * acting[k, 3 + i])
            w[i] += period * acting[k, 3 + i]
            d[i] *= keep[i]
        x, y = _turned(ahead, -left, torque[0], torque[1])
        torque[0], torque[1] = _turned(ahead, left, keep[3] * x, keep[4] * y)
        torque[2] *= keep[5]
        _turn(q2, step, q)


def run(poses: Poses, vehicle: Vehicle, steady: SteadyFilter, known: Array) -> Track:
    """Return a piece as the filter with a vehicle's model sees it.

    Args:
        poses: the piece.
        vehicle: the model.
        steady: the filter's gains.
        known: (n, 6, 3) corrections of pose, rate and disturbance of each axis before the pose of
            sample k is read, in the directions of ``Track.innovations``.
    """
    n = len(poses.t)
    shapes = ((3,), (3, 3), (3,), (3,), (6,), (4,), (6,), (7,), (2,), (6,), (6,))
    out = Track(poses.t, *(np.empty((n, *shape)) for shape in shapes))
    measured = (poses.rotor_speeds, poses.voltage, poses.position, poses.quaternion)
    speeds, voltage, position, quaternion = map(np.ascontiguousarray, measured)
    _run(
        loaded_model(vehicle)[0].copy(),
        poses.period,
        speeds,
        voltage,
        position,
        quaternion,
        np.concatenate([poses.velocity, poses.angular_velocity]),
        steady.gain,
        steady.keep,
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
    heading: Array,
    pull: Array,
    rate: Array,
    gyration: Array,
    acting: Array,
    moved: Array,
    jumps: Array,
    jump_state: np.ndarray,
    slopes: Array,
    innovations: Array,
    disturbance: Array,
    state: Array,
    out: Array,
) -> None:
    """Write by how much the innovations' predictions (n, 6, c) change with a unit of each column;
    in the directions of ``Track.innovations``, and so are jumps, innovations and disturbances.

    Args:
        period: s.
        gain: (6, 3, 2) of the axes, of ``SteadyFilter``.
        keep: (6,) share of a disturbance left after a period.
        heading: (n, 2) of the track.
        pull: (n, 3, 2) derivative of the acceleration (world) by an error of the attitude about
            body x and y.
        rate: (n, 3) angular velocity.
        gyration: (n, 3, 3) derivative of the angular acceleration by the angular velocity.
        acting: (n, 6, a) acceleration of the model by a unit of the first ``a`` columns.
        moved: (n, 6, b) shift of the measured pose by a unit of the last ``b`` of these.
        jumps: (n, 6, e) jump of one state of each axis by a unit of the next columns, before the
            pose of sample k is read.
        jump_state: (e,) the state: 0 the pose, 1 its rate, 2 the disturbance.
        slopes: (6, 7, m) change of the gains of each axis, in the order of ``gain``, and of
            ``keep``, by a unit of the last columns.
        innovations: (n, 6) of the filter.
        disturbance: (n, 6) of the filter, after a pose is read.
        state: (6, 3, c) carried from one call to the next.
        out: (n, 6, c).
    """
    n, a, b, e = len(acting), acting.shape[2], moved.shape[2], jumps.shape[2]
    m = slopes.shape[2]
    c, f = a + e + m, a + e
    half = 0.5 * period * period
    mid, turned, say = np.empty((3, c)), np.empty((3, c)), np.empty((6, 3, c))
    for k in range(n):
        ahead, left = heading[k, 0], heading[k, 1]
        for j in range(e):
            s = jump_state[j]
            for i in STRAIGHT:
                state[i, s, a + j] += jumps[k, i, j]
            x, y = _turned(ahead, left, jumps[k, 3, j], jumps[k, 4, j])
            state[3, s, a + j] += x
            state[4, s, a + j] += y
        for i in range(6):
            for j in range(c):
                out[k, i, j] = state[i, 0, j]
            for j in range(b):
                out[k, i, a - b + j] -= moved[k, i, j]
        for j in range(c):
            out[k, 3, j], out[k, 4, j] = _turned(ahead, -left, out[k, 3, j], out[k, 4, j])
        for i in range(6):
            o = PARTNER[i]
            for s in range(3):
                own, other = gain[i, s, 0], gain[i, s, 1]
                for j in range(c):
                    say[i, s, j] = -own * out[k, i, j] - other * out[k, o, j]
                x, y = innovations[k, i], innovations[k, o]
                for j in range(m):
                    say[i, s, f + j] += slopes[i, 2 * s, j] * x + slopes[i, 2 * s + 1, j] * y
        for s in range(3):
            for i in STRAIGHT:
                for j in range(c):
                    state[i, s, j] += say[i, s, j]
            for j in range(c):
                x, y = _turned(ahead, left, say[3, s, j], say[4, s, j])
                state[3, s, j] += x
                state[4, s, j] += y
        for i in range(3):
            for j in range(c):
                mid[i, j] = state[3 + i, 0, j] + 0.5 * period * state[3 + i, 1, j]
        for i in range(3):
            px, py = pull[k, i, 0], pull[k, i, 1]
            for j in range(c):
                g = state[i, 2, j] + px * mid[0, j] + py * mid[1, j]
                if j < a:
                    g += acting[k, i, j]
                state[i, 0, j] += period * state[i, 1, j] + half * g
                state[i, 1, j] += period * g
        for i in range(3):
            gx, gy, gz = gyration[k, i, 0], gyration[k, i, 1], gyration[k, i, 2]
            for j in range(c):
                g = state[3 + i, 2, j]
                turned[i, j] = g + gx * state[3, 1, j] + gy * state[4, 1, j] + gz * state[5, 1, j]
        for i in range(3):
            x, y = (i + 1) % 3, (i + 2) % 3
            wx, wy = rate[k, x], rate[k, y]
            for j in range(c):
                g = turned[i, j]
                if j < a:
                    g += acting[k, 3 + i, j]
                # an error in body axes turns back as these turn on
                state[3 + i, 0, j] += (
                    period * state[3 + i, 1, j]
                    + half * g
                    - period * (wx * mid[y, j] - wy * mid[x, j])
                )
                state[3 + i, 1, j] += period * g
        for j in range(c):
            x, y = _turned(ahead, -left, state[3, 2, j], state[4, 2, j])
            mid[0, j], mid[1, j] = keep[3] * x, keep[4] * y
        x, y = disturbance[k, 3], disturbance[k, 4]
        for j in range(m):
            mid[0, f + j] += slopes[3, 6, j] * x
            mid[1, f + j] += slopes[4, 6, j] * y
        for j in range(c):
            state[3, 2, j], state[4, 2, j] = _turned(ahead, left, mid[0, j], mid[1, j])
        for i in STRAIGHT:
            for j in range(c):
                state[i, 2, j] *= keep[i]
            for j in range(m):
                state[i, 2, f + j] += slopes[i, 6, j] * disturbance[k, i]
