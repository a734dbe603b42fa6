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

p comes from the low-pass-filtered pose and is late by the filter's delay; u goes through the same
filter, so that the vehicle's own manoeuvres cancel and do not show as a wrench. Both filters are
discretised exactly (the pose as a straight line between samples, u as constant over a step), so
that any cutoff at any period is stable.
"""

import math
from dataclasses import dataclass, fields

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from ..dynamics.model import apply_effects
from ..dynamics.rotation import (
    normalise,
    quaternion_from_mrp,
    quaternion_multiply,
    quaternion_to_matrix,
    turn_body,
)
from ..dynamics.vehicle import Vehicle
from ..runtime.compiled import Record, compiled
from ..runtime.errors import InputError
from .error_state import error_from
from .estimate import COASTING, NIS, RESTARTED, TRACKING, Array, WrenchEstimate
from .filter_record import drive, propagate
from .recovery import (
    Recovery,
    continues,
    judge,
    lost_attitude,
    lost_position,
    remember,
    start_over_if_broken,
)
from .sample import Sample, check_sample, copy_estimate, empty_estimate, undo_sensing
from .ukf import WrenchUKF, carry

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
        # what the model says of force (world) and torque (world), filtered, and their rates
        ("u", "f8", (6,)),
        ("du", "f8", (6,)),
        ("impulse", "f8", (6,)),  # of the filtered u over the last step
        ("angular_momentum", "f8", (3,)),  # of the filtered pose, world axes
        ("sample_p", "f8", (3,)),  # the last sample, or what was expected of it
        ("sample_q", "f8", (4,)),
        ("position_gap", "f8"),  # s since the last sample
        ("attitude_gap", "f8"),
        ("position_settles", "f8"),  # s until the filter has forgotten a restart
        ("attitude_settles", "f8"),
        ("covariance", "f8", (18, 18)),  # of the error while every pose is measured
        ("kept", "f8", (18,)),  # share of an error that a step with a pose leaves
        # the step in progress
        ("R_old", "f8", (3, 3)),
        ("R_new", "f8", (3, 3)),
        ("R", "f8", (3, 3)),  # of the filtered attitude
        ("omega", "f8", (3,)),  # body rate of the filtered attitude
        ("alpha", "f8", (3,)),  # its rate, by the model
        ("old_p", "f8", (3,)),  # the sample before
        ("old_q", "f8", (4,)),
        ("momentum", "f8", (3,)),  # before the step
        ("turn", "f8", (3,)),
        ("scratch_q", "f8", (4,)),
    ]
)


_RESPONSE = 4.0  # time constants of the slowest gain, after which exp(-8) of a variance is left
_SMALL = 1e-3  # of a noise's standard deviation: the response to it is linear


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
        for f in fields(self):
            value = getattr(self, f.name)
            shapes: tuple[tuple[int, ...], ...] = ((), (3,)) if f.name.endswith("gain") else ((),)
            expected = (
                "positive and finite, a number or three"
                if len(shapes) > 1
                else "positive and finite"
            )
            try:
                array = np.asarray(value, dtype=np.float64)
            except (TypeError, ValueError) as error:
                raise InputError(
                    f"ObserverTuning: {f.name} must be {expected}, got {value!r}"
                ) from error
            if array.shape not in shapes or not np.all(np.isfinite(array)) or np.any(array <= 0):
                raise InputError(f"ObserverTuning: {f.name} must be {expected}, got {value!r}")


class NonlinearObserver:
    """Force and torque observer with the interface of ``WrenchUKF``; it has no NIS.

    It works without a covariance. The one that it reports is that of its error under the noise
    that ``UKFTuning.for_vehicle`` assumes, worked out once from its response to each noise at
    hover; where nothing is measured it grows as that of ``WrenchUKF`` does.

    The pose and twist that it returns are those of the low-pass filters, moved ahead by the
    filters' delay with the model. Through gaps in the measurements the model carries on with the
    last wrench. Poses that jump restart the pose filters, or are refused where there is a gate, as
    in ``WrenchUKF``; having no innovations, the gate asks only whether a pose can follow the last
    one.

    Args:
        vehicle: the declared vehicle with its declared effects.
        tuning: gains and cutoffs.
        period: time between steps, s.
        gate: refuse poses that jump (any probability, as of ``WrenchUKF``); None takes in any.
        recovery: as of ``WrenchUKF``.

    Raises:
        InputError: period, gate or recovery out of range.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        tuning: ObserverTuning | None = None,
        period: float = 0.005,
        gate: float | None = None,
        recovery: Recovery | None = None,
    ) -> None:
        if not (math.isfinite(period) and period > 0):
            raise InputError(f"NonlinearObserver: period must be positive, in s, got {period!r}")
        self.vehicle = vehicle
        self.tuning = ObserverTuning() if tuning is None else tuning
        self.period = float(period)
        # lends its checks, its model of the vehicle and its state vector
        self._filter = WrenchUKF(vehicle, None, period, gate, recovery)
        self._record = np.zeros(1, dtype=OBSERVER)
        o = self._record[0]
        _low_pass(o["translation"], self.tuning.position_cutoff_hz, period)
        _low_pass(o["rotation"], self.tuning.attitude_cutoff_hz, period)
        o["force_decay"] = np.exp(-period * np.asarray(self.tuning.force_gain))
        o["torque_decay"] = np.exp(-period * np.asarray(self.tuning.torque_gain))
        # what is left of an error after a step: of pose and twist by the filters, of the wrench by
        # the gains
        for rows, kept in (
            (slice(0, 6), math.exp(-_DAMPING * o["rotation"]["frequency"] * period)),
            (slice(6, 12), math.exp(-_DAMPING * o["translation"]["frequency"] * period)),
            (slice(12, 15), o["torque_decay"]),
            (slice(15, 18), o["force_decay"]),
        ):
            o["kept"][rows] = kept
        self._sample = Sample()
        self._voltage = vehicle.voltage_ref
        o["covariance"] = self._error_covariance()
        self.reset((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))

    def __repr__(self) -> str:
        return (
            f"<{type(self).__name__} of {self.vehicle.name}: period {self.period:g} s, "
            f"{self.estimate.status}>"
        )

    def reset(
        self,
        position: ArrayLike,
        quaternion: ArrayLike,
        covariance: ArrayLike | None = None,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        """Start at a pose, in equilibrium and without an external wrench.

        Args:
            position: (3,) m, world.
            quaternion: (4,) body to world, scalar first.
            covariance: not used; here because the filters have it.
            velocity: (3,) m/s, world.
            angular_velocity: (3,) rad/s, body.

        Raises:
            InputError: a shape is wrong, a number is not finite, or the quaternion is not one of a
                rotation.
        """
        self._filter.reset(position, quaternion, None, velocity, angular_velocity)
        _start(self._filter.record, self._record)

    @property
    def records(self) -> tuple[np.ndarray, np.ndarray]:
        """The memories, each (1,), of model and observer, for compiled code that calls ``step`` of
        this module.
        """
        return self._filter.record, self._record

    @property
    def covariance(self) -> Array:
        """Covariance (18, 18) of the error under assumed noise; see the class."""
        return self._filter.covariance

    @property
    def estimate(self) -> WrenchEstimate:
        """What the observer believes now."""
        return self._filter.estimate

    def step(
        self,
        rotor_speeds: ArrayLike,
        position: ArrayLike | None = None,
        quaternion: ArrayLike | None = None,
        voltage: float | None = None,
    ) -> WrenchEstimate:
        """Go one period on with the rotor speeds of that period and the pose at its end.

        Args:
            rotor_speeds: (4,) rad/s.
            position: (3,) m, world, or None.
            quaternion: (4,) body to world, scalar first, or None.
            voltage: battery voltage, V, for effects that depend on it; default ``voltage_ref``.

        Raises:
            InputError: a shape or type is wrong, a rotor speed is negative, or the quaternion's
                length is not 1; the observer stays as it was.
        """
        sample = self._sample
        parts = sample.read(rotor_speeds, position, quaternion)
        out = empty_estimate()
        volts = self._voltage if voltage is None else voltage
        if (
            _step_and_copy(
                self._filter.record, self._record, sample.z, parts, self.period, volts, out
            )
            < 0
        ):
            raise sample.bad_quaternion()
        return WrenchEstimate(out)

    def _error_covariance(self) -> Array:
        """Return the covariance (18, 18) of the error under stationary noise: the sum over time and
        noises of the squared response to each.
        """
        tuning, o = self._filter.tuning, self._record[0]
        noises = (
            tuning.motor_torque_noise,
            tuning.thrust_noise,
            tuning.torque_walk,
            tuning.force_walk,
            np.asarray(tuning.attitude_noise) / 4.0,  # (16)
            tuning.position_noise,
        )
        sizes = np.concatenate([np.broadcast_to(noise, 3) for noise in noises]).astype(np.float64)
        slowest = min(np.min(self.tuning.force_gain), np.min(self.tuning.torque_gain))
        steps = min(math.ceil(_RESPONSE / slowest / self.period), 100_000)
        W = np.full(4, self._filter.record[0]["last_speeds"][0])
        P = np.diag(np.full(18, 1e-12))
        for which in range(18):
            errors = np.empty((2, steps, 18))
            for run, size in enumerate((0.0, _SMALL * sizes[which])):
                self._filter.reset((0.0, 0.0, 1.2), (1.0, 0.0, 0.0, 0.0))
                _start(self._filter.record, self._record)
                truth = self._filter.record.copy()
                _respond(
                    truth,
                    self._filter.record,
                    self._record,
                    W,
                    which,
                    size,
                    self.period,
                    self._voltage,
                    errors[run],
                )
            response = (errors[1] - errors[0]) / _SMALL
            P += response.T @ response
        o["covariance"] = P
        return P


@compiled
def _respond(
    truth: Record,
    model: Record,
    record: Record,
    rotor_speeds: Array,
    which: int,
    size: float,
    dt: float,
    voltage: float,
    errors: Array,
) -> None:
    """Write the observer's errors (K, 18) after one noise, number ``which`` of motor torque,
    thrust, torque walk, force walk, attitude and position, came in the first step.
    """
    g, f, o = truth[0], model[0], record[0]
    x, z = g.x, np.empty(11)
    for k in range(len(errors)):
        push = size if k == 0 else 0.0
        if 6 <= which < 12:
            x[7 + which] += push
        drive(g, rotor_speeds, dt, voltage)
        if which < 3:
            g.rotor_wrench[1 + which] += push
        propagate(g, x, dt, g.next)
        if 3 <= which < 6:
            for i in range(3):
                change = g.rotation[i, which - 3] * push * dt / g.body.mass
                g.next[i] += 0.5 * dt * change
                g.next[7 + i] += change
        normalise(g.next[3:7])
        for i in range(NIS):
            x[i] = g.next[i]
        g.time += dt
        z[0:4] = rotor_speeds
        z[4:11] = x[0:7]
        if 12 <= which < 15:
            for i in range(3):
                g.rho[i] = push if i == which - 12 else 0.0
            quaternion_from_mrp(g.rho, g.q)
            quaternion_multiply(g.q, x[3:7], z[7:11])
        if which >= 15:
            z[4 + which - 15] += push
        step(f, o, z, 3, dt, voltage)
        error_from(x, f.x, errors[k])


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
def _filter_sample(g: Record, y: Array, dy: Array, old: Array, new: Array) -> None:
    """Move a filter's output ``y`` and its rate ``dy`` (n,) on by a step with the input from
    ``old`` to ``new``.
    """
    A, a, b = g.transition, g.old, g.new
    for i in range(len(y)):
        value, rate = y[i], dy[i]
        y[i] = A[0, 0] * value + A[0, 1] * rate + a[0] * old[i] + b[0] * new[i]
        dy[i] = A[1, 0] * value + A[1, 1] * rate + a[1] * old[i] + b[1] * new[i]


@compiled
def _filter_input(o: Record, g: Record, i: int, u: float, dt: float) -> None:
    """Filter row ``i`` of u, constant over the step, and write the integral of the filtered one
    over it.
    """
    value, rate, A = o.u[i], o.du[i], g.transition
    o.u[i] = A[0, 0] * value + A[0, 1] * rate + (g.old[0] + g.new[0]) * u
    o.du[i] = A[1, 0] * value + A[1, 1] * rate + (g.old[1] + g.new[1]) * u
    # the filter's own equation, integrated over the step
    lag = (o.du[i] - rate) / g.frequency + 2.0 * _DAMPING * (o.u[i] - value)
    o.impulse[i] = u * dt - lag / g.frequency


@compiled
def _twist(f: Record, o: Record) -> None:
    """Write rotation, body rate and angular momentum (world axes) of the filtered attitude."""
    q, d, R, J, omega = o.q, o.dq, o.R, f.body.inertia, o.omega
    square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    scale = 2.0 / square
    # 2 q* q' / |q|^2: the norm, which a filter does not keep, drops out
    omega[0] = scale * (q[0] * d[1] - q[1] * d[0] - q[2] * d[3] + q[3] * d[2])
    omega[1] = scale * (q[0] * d[2] - q[2] * d[0] - q[3] * d[1] + q[1] * d[3])
    omega[2] = scale * (q[0] * d[3] - q[3] * d[0] - q[1] * d[2] + q[2] * d[1])
    for i in range(4):
        o.scratch_q[i] = q[i] / math.sqrt(square)
    quaternion_to_matrix(o.scratch_q, R)
    h0 = J[0, 0] * omega[0] + J[0, 1] * omega[1] + J[0, 2] * omega[2]
    h1 = J[1, 0] * omega[0] + J[1, 1] * omega[1] + J[1, 2] * omega[2]
    h2 = J[2, 0] * omega[0] + J[2, 1] * omega[1] + J[2, 2] * omega[2]
    for i in range(3):
        o.angular_momentum[i] = R[i, 0] * h0 + R[i, 1] * h1 + R[i, 2] * h2


@compiled
def _seat_attitude(f: Record, o: Record, q: Array) -> None:
    """Put the attitude filter where a vehicle that turns at ``omega`` and was just seen at ``q``
    has it.
    """
    omega = o.omega
    turn_body(q, omega[0], omega[1], omega[2], -o.rotation.delay, o.q)
    _spin(o)
    _twist(f, o)


@compiled
def _spin(o: Record) -> None:
    """Set the rate of the filtered quaternion to that of a turn at ``omega``: (11), (13)."""
    q, d, omega = o.q, o.dq, o.omega
    d[0] = 0.5 * (-q[1] * omega[0] - q[2] * omega[1] - q[3] * omega[2])
    d[1] = 0.5 * (q[0] * omega[0] + q[2] * omega[2] - q[3] * omega[1])
    d[2] = 0.5 * (q[0] * omega[1] + q[3] * omega[0] - q[1] * omega[2])
    d[3] = 0.5 * (q[0] * omega[2] + q[1] * omega[1] - q[2] * omega[0])


@compiled
def _seat_position(o: Record, p: Array) -> None:
    """Put the position filter where a vehicle that moves at ``v`` and was just seen at ``p`` has
    it.
    """
    for i in range(3):
        o.p[i] = p[i] - o.translation.delay * o.v[i]


@compiled
def _centre_of_mass(f: Record, position: Array, R: Array, out: Array) -> None:
    c = f.body.com
    for i in range(3):
        out[i] = position[i] + R[i, 0] * c[0] + R[i, 1] * c[1] + R[i, 2] * c[2]


@compiled
def _start(model: Record, record: Record) -> None:
    """Start the observer at the pose and twist of the model's state."""
    f, o = model[0], record[0]
    o.position_settles, o.attitude_settles = 0.0, 0.0
    _seat(f, o)
    f.P[:] = o.covariance


@compiled
def _seat(f: Record, o: Record) -> None:
    """Set the filters to the pose and twist of the model's state."""
    x, c = f.x, f.body.com
    o.sample_q[:] = x[3:7]
    o.omega[:] = x[10:13]
    quaternion_to_matrix(o.sample_q, o.R_new)
    _centre_of_mass(f, x[0:3], o.R_new, o.sample_p)
    a = x[11] * c[2] - x[12] * c[1], x[12] * c[0] - x[10] * c[2], x[10] * c[1] - x[11] * c[0]
    for i in range(3):
        o.v[i] = x[7 + i] + o.R_new[i, 0] * a[0] + o.R_new[i, 1] * a[1] + o.R_new[i, 2] * a[2]
    for i in range(6):
        o.u[i] = 0.0
        o.du[i] = 0.0
    o.position_gap, o.attitude_gap = 0.0, 0.0
    _seat_position(o, o.sample_p)
    _seat_attitude(f, o, o.sample_q)


@compiled
def _model(f: Record, o: Record, dt: float) -> None:
    """Work out u at the mean attitude of the step, and filter it."""
    x, w, R = f.x, f.rotor_wrench, f.rotation
    for i in range(3):
        for j in range(3):
            R[i, j] = 0.5 * (o.R_old[i, j] + o.R_new[i, j])
    if f.wrench_count > 0:
        apply_effects(f, x[0:3], o.R_old, x[7:10], x[10:13])
    e = f.effect_wrench
    for i in range(3):
        force = R[i, 2] * w[0] + e[i]
        if i == 2:
            force -= f.body.mass * f.body.gravity
        _filter_input(o, o.translation, i, force, dt)
        torque = R[i, 0] * (w[1] + e[3]) + R[i, 1] * (w[2] + e[4]) + R[i, 2] * (w[3] + e[5])
        _filter_input(o, o.rotation, 3 + i, torque, dt)


@compiled
def _observe_force(f: Record, o: Record, measured: bool, dt: float) -> None:
    force, mass, v = f.x[16:19], f.body.mass, o.v
    if not measured:
        for i in range(3):
            change = (o.impulse[i] + force[i] * dt) / mass
            o.p[i] += dt * (v[i] + 0.5 * change)
            v[i] += change
        return
    for i in range(3):
        o.momentum[i] = mass * v[i]
    _filter_sample(o.translation, o.p, v, o.old_p, o.sample_p)
    if o.position_settles > 0.0:
        return
    for i in range(3):
        gain = (1.0 - o.force_decay[i]) / dt
        force[i] = o.force_decay[i] * force[i] + gain * (mass * v[i] - o.momentum[i] - o.impulse[i])


@compiled
def _observe_torque(f: Record, o: Record, measured: bool, dt: float) -> None:
    torque, h, omega, R, inverse = (
        f.x[13:16],
        o.angular_momentum,
        o.omega,
        o.R,
        f.body.inverse_inertia,
    )
    if not measured:
        turn_body(o.q, omega[0], omega[1], omega[2], dt, o.scratch_q)
        o.q[:] = o.scratch_q
        normalise(o.q)
        quaternion_to_matrix(o.q, R)
        for i in range(3):
            h[i] += o.impulse[3 + i] + torque[i] * dt
        for i in range(3):
            o.alpha[i] = R[0, i] * h[0] + R[1, i] * h[1] + R[2, i] * h[2]
        for i in range(3):
            omega[i] = (
                inverse[i, 0] * o.alpha[0] + inverse[i, 1] * o.alpha[1] + inverse[i, 2] * o.alpha[2]
            )
        _spin(o)
        return
    for i in range(3):
        o.momentum[i] = h[i]
    _filter_sample(o.rotation, o.q, o.dq, o.old_q, o.sample_q)
    _twist(f, o)
    if o.attitude_settles > 0.0:
        return
    for i in range(3):
        gain = (1.0 - o.torque_decay[i]) / dt
        torque[i] = o.torque_decay[i] * torque[i] + gain * (h[i] - o.momentum[i] - o.impulse[3 + i])


@compiled
def _look_ahead(f: Record, o: Record) -> None:
    """Write pose and twist as they are now: the filtered ones, ahead by the filters' delay.

    The inverse of the filter, y + 2 d / w y' + y'' / w^2, with the derivatives of v and omega taken
    from the model.
    """
    x, R, J, inverse, omega, alpha = (
        f.x,
        o.R,
        f.body.inertia,
        f.body.inverse_inertia,
        o.omega,
        o.alpha,
    )
    h0 = J[0, 0] * omega[0] + J[0, 1] * omega[1] + J[0, 2] * omega[2]
    h1 = J[1, 0] * omega[0] + J[1, 1] * omega[1] + J[1, 2] * omega[2]
    h2 = J[2, 0] * omega[0] + J[2, 1] * omega[1] + J[2, 2] * omega[2]
    t0, t1, t2 = o.u[3] + x[13], o.u[4] + x[14], o.u[5] + x[15]
    m0 = R[0, 0] * t0 + R[1, 0] * t1 + R[2, 0] * t2 - (omega[1] * h2 - omega[2] * h1)
    m1 = R[0, 1] * t0 + R[1, 1] * t1 + R[2, 1] * t2 - (omega[2] * h0 - omega[0] * h2)
    m2 = R[0, 2] * t0 + R[1, 2] * t1 + R[2, 2] * t2 - (omega[0] * h1 - omega[1] * h0)
    delay, square = o.rotation.delay, o.rotation.frequency * o.rotation.frequency
    d0 = (R[0, 0] * o.du[3] + R[1, 0] * o.du[4] + R[2, 0] * o.du[5]) / square
    d1 = (R[0, 1] * o.du[3] + R[1, 1] * o.du[4] + R[2, 1] * o.du[5]) / square
    d2 = (R[0, 2] * o.du[3] + R[1, 2] * o.du[4] + R[2, 2] * o.du[5]) / square
    for i in range(3):
        alpha[i] = inverse[i, 0] * m0 + inverse[i, 1] * m1 + inverse[i, 2] * m2
        x[10 + i] = (
            omega[i]
            + delay * alpha[i]
            + inverse[i, 0] * d0
            + inverse[i, 1] * d1
            + inverse[i, 2] * d2
        )
        o.turn[i] = delay * omega[i] + alpha[i] / square
    turn_body(o.q, o.turn[0], o.turn[1], o.turn[2], 1.0, x[3:7])
    normalise(x[3:7])
    delay, square = o.translation.delay, o.translation.frequency * o.translation.frequency
    for i in range(3):
        acceleration = (o.u[i] + x[16 + i]) / f.body.mass
        x[7 + i] = o.v[i] + delay * acceleration + o.du[i] / (f.body.mass * square)
        x[i] = o.p[i] + delay * o.v[i] + acceleration / square
    c = f.body.com
    if c[0] != 0.0 or c[1] != 0.0 or c[2] != 0.0:
        # from the centre of mass to the geometric centre
        quaternion_to_matrix(x[3:7], f.rotation)
        a = x[11] * c[2] - x[12] * c[1], x[12] * c[0] - x[10] * c[2], x[10] * c[1] - x[11] * c[0]
        S = f.rotation
        for i in range(3):
            x[i] -= S[i, 0] * c[0] + S[i, 1] * c[1] + S[i, 2] * c[2]
            x[7 + i] -= S[i, 0] * a[0] + S[i, 1] * a[1] + S[i, 2] * a[2]


@compiled
def _believed(f: Record, o: Record, z: Array, parts: int, dt: float) -> int:
    """Return the parts of a sample that are believed, after a restart where it calls for one, and
    carry the covariance over the step.
    """
    P, x = f.P, f.x
    position, attitude = parts & 1 != 0, parts & 2 != 0
    for i in range(3):
        f.gap[i] += dt
    status = COASTING if parts == 0 else TRACKING
    if parts != 0:
        strange = not continues(f, z[4:7], z[7:11], f.seen, f.gap[0], f.gap[1], position, attitude)
        late = (position and f.gap[0] > f.patience) or (attitude and f.gap[1] > f.patience)
        # no covariance of an innovation says how strange: as far as can be
        if (strange or late or f.refused > 0.5) and not judge(
            f, z[4:7], z[7:11], position, attitude, math.inf, strange
        ):
            status = f.status
            if status == RESTARTED:
                _reseat(f, o)
            else:
                parts, position, attitude = 0, False, False
        if parts != 0:
            remember(f, z[4:7], z[7:11], position, attitude)
    if parts != 3:
        # the filter's own prediction of the covariance; state and times are the observer's
        for i in range(NIS):
            f.next[i] = x[i]
        position_gap, attitude_gap, doubt_gap = f.gap[0], f.gap[1], f.gap[2]
        quaternion_to_matrix(x[3:7], f.rotation)
        carry(f, dt)
        f.gap[0], f.gap[1], f.gap[2] = position_gap, attitude_gap, doubt_gap
        for i in range(NIS):
            x[i] = f.next[i]
        # held where it is lost
        if lost_position(f):
            o.v[:], x[7:10] = 0.0, 0.0
        if lost_attitude(f):
            o.omega[:], o.angular_momentum[:], x[10:13] = 0.0, 0.0, 0.0
    f.status = status
    for i in range(18):
        a = o.kept[i] if _measured(i, position, attitude) else 1.0
        for j in range(i + 1):
            b = o.kept[j] if _measured(j, position, attitude) else 1.0
            rest = math.sqrt((1.0 - a * a) * (1.0 - b * b))
            P[i, j] = a * b * P[i, j] + rest * o.covariance[i, j]
            P[j, i] = P[i, j]
    return parts


@compiled
def _measured(row: int, position: bool, attitude: bool) -> bool:
    """Return whether a row of the covariance is of what a sample corrects: attitude, angular
    velocity and torque, or position, velocity and force.
    """
    return attitude if row < 6 or 12 <= row < 15 else position


@compiled
def _reseat(f: Record, o: Record) -> None:
    """Put pose and twist of the filters where those of the model's state are, and leave the wrench
    as it is until they have forgotten that.
    """
    wrench, rates = o.u.copy(), o.du.copy()
    _seat(f, o)
    o.u[:], o.du[:] = wrench, rates
    o.position_settles = _FORGOTTEN * o.translation.delay
    o.attitude_settles = _FORGOTTEN * o.rotation.delay


@compiled
def step(f: Record, o: Record, z: Array, parts: int, dt: float, voltage: float) -> None:
    """Go ``dt`` s on, the period for which ``o`` was made, with the ``parts`` of ``z`` (11,) that
    were measured.
    """
    x = f.x
    drive(f, z[0:4], dt, voltage)
    parts = _believed(f, o, z, parts, dt)
    position, attitude = parts & 1 != 0, parts & 2 != 0
    # the samples: those measured, else what is expected
    for i in range(3):
        o.old_p[i] = o.sample_p[i]
        for j in range(3):
            o.R_old[i, j] = o.R_new[i, j]
    for i in range(4):
        o.old_q[i] = o.sample_q[i]
    turn_body(o.old_q, x[10], x[11], x[12], dt, o.sample_q)
    normalise(o.sample_q)
    if attitude:
        # a quaternion and its negative are one attitude: take the one near the expected
        dot = 0.0
        for i in range(4):
            dot += o.sample_q[i] * z[7 + i]
        for i in range(4):
            o.sample_q[i] = z[7 + i] if dot >= 0.0 else -z[7 + i]
    quaternion_to_matrix(o.sample_q, o.R_new)
    _model(f, o, dt)
    if position:
        _centre_of_mass(f, z[4:7], o.R_new, o.sample_p)
    # after a gap that the filter has forgotten, the error of the dead reckoning is no motion: start
    # from the new sample
    if attitude and o.attitude_gap > _FORGOTTEN * o.rotation.delay:
        turn_body(o.sample_q, o.omega[0], o.omega[1], o.omega[2], -dt, o.old_q)
        _seat_attitude(f, o, o.old_q)
    if position and o.position_gap > _FORGOTTEN * o.translation.delay:
        for i in range(3):
            o.old_p[i] = o.sample_p[i] - dt * o.v[i]
        _seat_position(o, o.old_p)
    o.position_gap = 0.0 if position else o.position_gap + dt
    o.attitude_gap = 0.0 if attitude else o.attitude_gap + dt
    o.position_settles = max(0.0, o.position_settles - dt)
    o.attitude_settles = max(0.0, o.attitude_settles - dt)
    _observe_torque(f, o, attitude, dt)
    _observe_force(f, o, position, dt)
    _look_ahead(f, o)
    if not position:
        quaternion_to_matrix(o.sample_q, f.rotation)
        _centre_of_mass(f, x[0:3], f.rotation, o.sample_p)
    f.time += dt
    x[NIS] = math.nan
    if not math.isfinite(np.sum(x[0:NIS])):
        start_over_if_broken(f)
        _seat(f, o)


@compiled
def _step_and_copy(
    model: Record, record: Record, z: Array, parts: int, dt: float, voltage: float, out: Array
) -> int:
    f = model[0]
    usable: int = check_sample(f, z, parts)
    if usable >= 0:
        step(f, record[0], undo_sensing(f, z, usable, dt), usable, dt, voltage)
    copy_estimate(f, out)
    return usable
