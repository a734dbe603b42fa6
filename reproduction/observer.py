"""The classical alternative to the wrench filter: a nonlinear force and torque observer on a
low-pass-filtered pose.

Yuksel, Secchi, Buelthoff and Franchi, *A nonlinear force observer for quadrotors and application to
physical interactive tasks*, AIM 2014, with the pose filtered and differentiated as in Tomic and
Haddadin, *A unified framework for external wrench estimation, interaction control and collision
reflexes for flying robots*, IROS 2014.

The wrench estimate w^ is driven through a gain L so that its error decays exponentially::

    w^' = L (w - w^),    w = p' - u

where p is the momentum (linear of the centre of mass, angular in world axes, so that no gyroscopic
term is left) and u what the model says that rotors, gravity and declared effects add to it. Only
differences of p enter (the auxiliary variable of the paper), never an acceleration. Over a step at
constant w the solution is exact::

    w^[k] = exp(-L T) w^[k-1] + (1 - exp(-L T)) / T * (p[k] - p[k-1] - integral of u)

p comes from the low-pass-filtered pose and is late by the filter's delay. u goes through the same
filter: the vehicle's own manoeuvres cancel. Both filters are discretised exactly (the pose as a
straight line between samples, u as constant over a step): any cutoff at any period is stable.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from ..dynamics.model import apply_effects
from ..dynamics.rotation import normalise, quaternion_to_matrix, turn_body
from ..dynamics.vehicle import Vehicle
from ..estimator.estimate import COASTING, NIS, TRACKING, Array, WrenchEstimate
from ..estimator.filter_record import drive
from ..estimator.sample import check_sample, undo_sensing
from ..estimator.ukf import WrenchUKF
from ..runtime.arguments import check_positive
from ..runtime.compiled import Record, compiled
from ..runtime.errors import InputError

_DAMPING = math.sqrt(0.5)  # Butterworth
_FORGOTTEN = 4.0  # delays of a filter after which exp(-4) of its past is left

_LOW_PASS = np.dtype(
    [
        ("frequency", "f8"),  # rad/s
        ("delay", "f8"),  # s, of a slow signal
        ("transition", "f8", (2, 2)),  # of output and its rate over a step
        ("old", "f8", (2,)),  # what the sample before adds, the input being a straight line
        ("new", "f8", (2,)),  # and the present one
    ]
)

OBSERVER = np.dtype(
    [
        ("translation", _LOW_PASS),
        ("rotation", _LOW_PASS),
        ("force_decay", "f8", (3,)),
        ("torque_decay", "f8", (3,)),
        # the filtered pose: centre of mass, quaternion, and their rates
        ("p", "f8", (3,)),
        ("v", "f8", (3,)),
        ("q", "f8", (4,)),
        ("dq", "f8", (4,)),
        # force and torque (world) of the model, filtered, and their rates
        ("force", "f8", (3,)),
        ("force_rate", "f8", (3,)),
        ("torque", "f8", (3,)),
        ("torque_rate", "f8", (3,)),
        ("R", "f8", (3, 3)),  # of the filtered attitude
        ("omega", "f8", (3,)),  # body rate of the filtered attitude
        ("angular_momentum", "f8", (3,)),  # of the filtered pose, world axes
        ("sample_p", "f8", (3,)),  # the last sample, or the expected one
        ("sample_q", "f8", (4,)),
        ("sample_R", "f8", (3, 3)),
        ("position_gap", "f8"),  # s since the last sample
        ("attitude_gap", "f8"),
    ]
)


@dataclass(frozen=True)
class ObserverTuning:
    """Gains of the observer and cutoffs of its pose filters.

    The 10-90 % rise time of force and torque is about ``2.2 / gain``: 1 s as given.

    Attributes:
        force_gain: 1/s, a scalar or (3,) for world x, y, z.
        torque_gain: 1/s, likewise.
        position_cutoff_hz: Hz, of the low-pass of the position.
        attitude_cutoff_hz: Hz, of the low-pass of the attitude.
    """

    force_gain: ArrayLike = 2.2
    torque_gain: ArrayLike = 2.2
    position_cutoff_hz: float = 3.0
    attitude_cutoff_hz: float = 5.0

    def __post_init__(self) -> None:
        check_positive(self, ("force_gain", "torque_gain"))


class NonlinearObserver(WrenchUKF):
    """Force and torque observer: a ``WrenchUKF`` whose state an observer moves. It has neither NIS
    nor covariance, and no gate; it takes whole steps alone, and no inertial measurements.

    Pose and twist are those of the low-pass filters, moved ahead by the filters' delay with the
    model. Through gaps in the measurements the model carries on with the last wrench.

    Args:
        vehicle: the declared vehicle with its declared effects.
        tuning: gains and cutoffs.
        period: time between steps, s.

    Raises:
        InputError: the period is out of range.
    """

    _no_imu = "an observer takes no inertial measurements"

    def __init__(
        self, vehicle: Vehicle, tuning: ObserverTuning | None = None, period: float = 0.005
    ) -> None:
        self.gains = ObserverTuning() if tuning is None else tuning
        super().__init__(vehicle, None, period)

    def _prepare(self) -> None:
        """Start at rest at the origin."""
        self._observer = np.zeros(1, dtype=OBSERVER)
        o, gains = self._observer[0], self.gains
        _low_pass(o["translation"], gains.position_cutoff_hz, self.period)
        _low_pass(o["rotation"], gains.attitude_cutoff_hz, self.period)
        o["force_decay"] = np.exp(-self.period * np.asarray(gains.force_gain))
        o["torque_decay"] = np.exp(-self.period * np.asarray(gains.torque_gain))
        self.reset((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))

    def _begin(self) -> None:
        """Start in equilibrium; the covariance that ``reset`` was given is not used."""
        self.record["P"] = math.nan
        _start(self.record, self._observer)

    def _run(self, parts: int, dt: float, voltage: float | None) -> WrenchEstimate:
        if dt != self.period:
            raise InputError(f"NonlinearObserver: expected a step of {self.period:g} s, got {dt:g}")
        volts = self._voltage if voltage is None else voltage
        if _step(self.record, self._observer, self._sample.z, parts, dt, volts) < 0:
            raise self._sample.bad_quaternion()
        return self.estimate

    @property
    def step_address(self) -> int:
        """An observer has none.

        Raises:
            InputError: always.
        """
        raise InputError("step_address: an observer steps in Python only")


def _low_pass(record: Record, cutoff_hz: float, period: float) -> None:
    """Fill in a second-order low-pass, y'' = w^2 (x - y) - 2 d w y', for an input that is straight
    between samples.
    """
    w = 2.0 * math.pi * cutoff_hz
    # states y and y'/w, then the input and its change over the step
    matrix = np.zeros((4, 4))
    matrix[0, 1] = w * period
    matrix[1, :3] = -w * period, -2.0 * _DAMPING * w * period, w * period
    matrix[2, 3] = 1.0
    M = scipy.linalg.expm(matrix)
    unit = np.array([1.0, w])
    record["frequency"], record["delay"] = w, 2.0 * _DAMPING / w
    record["transition"] = M[:2, :2] * unit[:, None] / unit
    record["old"] = (M[:2, 2] - M[:2, 3]) * unit
    record["new"] = M[:2, 3] * unit


@compiled
def _filter(g: Record, y: Array, dy: Array, old: Array, new: Array) -> None:
    """Move a filter's output ``y`` and its rate ``dy`` (n,) on by a step with the input from
    ``old`` to ``new``.
    """
    A, a, b = g.transition, g.old, g.new
    value, rate = y.copy(), dy.copy()
    y[:] = A[0, 0] * value + A[0, 1] * rate + a[0] * old + b[0] * new
    dy[:] = A[1, 0] * value + A[1, 1] * rate + a[1] * old + b[1] * new


@compiled
def _filter_model(g: Record, y: Array, dy: Array, u: Array, dt: float) -> Array:
    """Filter a force or torque (3,) that is constant over the step; return the integral of the
    filtered one over the step.
    """
    value, rate = y.copy(), dy.copy()
    _filter(g, y, dy, u, u)
    # the filter's own equation, integrated over the step
    lag = (dy - rate) / g.frequency + 2.0 * _DAMPING * (y - value)
    impulse: Array = u * dt - lag / g.frequency
    return impulse


@compiled
def _twist(f: Record, o: Record) -> None:
    """Write rotation, body rate and angular momentum (world axes) of the filtered attitude."""
    q, d, omega = o.q, o.dq, o.omega
    square = np.sum(q * q)
    scale = 2.0 / square
    # 2 q* q' / |q|^2: the norm, which a filter does not keep, drops out
    omega[0] = scale * (q[0] * d[1] - q[1] * d[0] - q[2] * d[3] + q[3] * d[2])
    omega[1] = scale * (q[0] * d[2] - q[2] * d[0] - q[3] * d[1] + q[1] * d[3])
    omega[2] = scale * (q[0] * d[3] - q[3] * d[0] - q[1] * d[2] + q[2] * d[1])
    quaternion_to_matrix(q / math.sqrt(square), o.R)
    o.angular_momentum[:] = o.R @ (f.body.inertia @ omega)


@compiled
def _spin(o: Record) -> None:
    """Set the rate of the filtered quaternion to that of a turn at ``omega``: (11), (13)."""
    q, d, omega = o.q, o.dq, o.omega
    d[0] = 0.5 * (-q[1] * omega[0] - q[2] * omega[1] - q[3] * omega[2])
    d[1] = 0.5 * (q[0] * omega[0] + q[2] * omega[2] - q[3] * omega[1])
    d[2] = 0.5 * (q[0] * omega[1] + q[3] * omega[0] - q[1] * omega[2])
    d[3] = 0.5 * (q[0] * omega[2] + q[1] * omega[1] - q[2] * omega[0])


@compiled
def _seat_attitude(f: Record, o: Record, q: Array) -> None:
    """Put the attitude filter where it is for a vehicle that turns at ``omega`` and is at ``q``."""
    omega = o.omega
    turn_body(q, omega[0], omega[1], omega[2], -o.rotation.delay, o.q)
    _spin(o)
    _twist(f, o)


@compiled
def _start(model: Record, record: Record) -> None:
    """Start the observer at the pose and twist of the model's state."""
    f, o = model[0], record[0]
    x, com, R = f.x, f.body.com, o.sample_R
    o.sample_q[:], o.omega[:] = x[3:7], x[10:13]
    quaternion_to_matrix(o.sample_q, R)
    o.sample_p[:] = x[0:3] + R @ com
    o.v[:] = x[7:10] + R @ np.cross(x[10:13], com)
    o.force[:], o.force_rate[:], o.torque[:], o.torque_rate[:] = 0.0, 0.0, 0.0, 0.0
    o.position_gap, o.attitude_gap = 0.0, 0.0
    o.p[:] = o.sample_p - o.translation.delay * o.v
    _seat_attitude(f, o, o.sample_q)


@compiled
def _observe_force(
    f: Record, o: Record, impulse: Array, old: Array, measured: bool, dt: float
) -> None:
    force, mass, v, decay = f.x[16:19], f.body.mass, o.v, o.force_decay
    if not measured:
        change = (impulse + force * dt) / mass
        o.p[:] += dt * (v + 0.5 * change)
        v[:] += change
        return
    before = v.copy()
    _filter(o.translation, o.p, v, old, o.sample_p)
    force[:] = decay * force + (1.0 - decay) / dt * (mass * (v - before) - impulse)


@compiled
def _observe_torque(
    f: Record, o: Record, impulse: Array, old: Array, measured: bool, dt: float
) -> None:
    torque, h, omega, decay = f.x[13:16], o.angular_momentum, o.omega, o.torque_decay
    if not measured:
        turn_body(o.q.copy(), omega[0], omega[1], omega[2], dt, o.q)
        normalise(o.q)
        quaternion_to_matrix(o.q, o.R)
        h[:] += impulse + torque * dt
        omega[:] = f.body.inverse_inertia @ (o.R.T @ h)
        _spin(o)
        return
    before = h.copy()
    _filter(o.rotation, o.q, o.dq, old, o.sample_q)
    _twist(f, o)
    torque[:] = decay * torque + (1.0 - decay) / dt * (h - before - impulse)


@compiled
def _look_ahead(f: Record, o: Record) -> None:
    """Write pose and twist as they are now: the filtered ones, ahead by the filters' delay.

    The inverse of the filter, y + 2 d / w y' + y'' / w^2, with the derivatives of v and omega taken
    from the model.
    """
    x, R, omega, mass, com = f.x, o.R, o.omega, f.body.mass, f.body.com
    J, inverse = f.body.inertia, f.body.inverse_inertia
    delay, square = o.rotation.delay, o.rotation.frequency * o.rotation.frequency
    alpha = inverse @ (R.T @ (o.torque + x[13:16]) - np.cross(omega, J @ omega))
    x[10:13] = omega + delay * alpha + inverse @ (R.T @ o.torque_rate) / square
    turn = delay * omega + alpha / square
    turn_body(o.q, turn[0], turn[1], turn[2], 1.0, x[3:7])
    normalise(x[3:7])
    delay, square = o.translation.delay, o.translation.frequency * o.translation.frequency
    acceleration = (o.force + x[16:19]) / mass
    # from the centre of mass to the geometric centre
    quaternion_to_matrix(x[3:7], f.rotation)
    x[7:10] = o.v + delay * acceleration + o.force_rate / (mass * square)
    x[7:10] -= f.rotation @ np.cross(x[10:13], com)
    x[0:3] = o.p + delay * o.v + acceleration / square - f.rotation @ com


@compiled
def _step(
    model: Record, record: Record, sample: Array, parts: int, dt: float, voltage: float
) -> int:
    """Go ``dt`` s on, the period for which the observer was made, with the ``parts`` of ``sample``
    (11,) that were measured; return the usable ones, or -1 if the quaternion is no rotation.
    """
    f, o = model[0], record[0]
    parts = check_sample(f, sample, parts)
    if parts < 0:
        return parts
    z = undo_sensing(f, sample, parts, dt)
    x, w, R = f.x, f.rotor_wrench, o.sample_R
    position, attitude = parts & 1 != 0, parts & 2 != 0
    f.status, x[NIS] = TRACKING if parts else COASTING, math.nan
    drive(f, z[0:4], dt, voltage)
    # the samples: those measured, else the expected ones
    old_p, old_q, mean_R = o.sample_p.copy(), o.sample_q.copy(), 0.5 * R
    if f.wrench_count > 0:
        apply_effects(f, x[0:3], R, x[7:10], x[10:13])
    turn_body(old_q, x[10], x[11], x[12], dt, o.sample_q)
    normalise(o.sample_q)
    if attitude:
        # a quaternion and its negative are one attitude: take the one near the expected
        o.sample_q[:] = z[7:11] if np.sum(o.sample_q * z[7:11]) >= 0.0 else -z[7:11]
    quaternion_to_matrix(o.sample_q, R)
    if position:
        o.sample_p[:] = z[4:7] + R @ f.body.com
    # the model at the mean attitude of the step
    mean_R += 0.5 * R
    force = mean_R[:, 2] * w[0] + f.effect_wrench[0:3]
    force[2] -= f.body.mass * f.body.gravity
    force = _filter_model(o.translation, o.force, o.force_rate, force, dt)
    torque = mean_R @ (w[1:4] + f.effect_wrench[3:6])
    torque = _filter_model(o.rotation, o.torque, o.torque_rate, torque, dt)
    # after a gap that the filter has forgotten, the error of the dead reckoning is no motion: start
    # from the new sample
    if attitude and o.attitude_gap > _FORGOTTEN * o.rotation.delay:
        turn_body(o.sample_q, o.omega[0], o.omega[1], o.omega[2], -dt, old_q)
        _seat_attitude(f, o, old_q)
    if position and o.position_gap > _FORGOTTEN * o.translation.delay:
        old_p[:] = o.sample_p - dt * o.v
        o.p[:] = old_p - o.translation.delay * o.v
    o.position_gap = 0.0 if position else o.position_gap + dt
    o.attitude_gap = 0.0 if attitude else o.attitude_gap + dt
    _observe_torque(f, o, torque, old_q, attitude, dt)
    _observe_force(f, o, force, old_p, position, dt)
    _look_ahead(f, o)
    if not position:
        quaternion_to_matrix(o.sample_q, f.rotation)
        o.sample_p[:] = x[0:3] + f.rotation @ f.body.com
    f.time += dt
    return parts
