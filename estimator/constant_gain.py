"""The wrench filter with its converged gain: less than a tenth of the work, for training and for
many vehicles.

The gain of a Kalman filter in steady flight converges. Here ``WrenchUKF`` at hover gives the gain
once. The same functions carry the mean, (2)-(5), (11)-(14), and nothing carries the covariance. A
yawed vehicle sees the same problem turned about the vertical: the innovation is turned into the
vehicle's heading, and the correction back.
"""

import math
from functools import lru_cache

import numpy as np
from numba import carray

from ..dynamics.rotation import attitude_error
from ..runtime.addresses import pointer_to
from ..runtime.compiled import Record, compiled, compiled_without_gil
from ..runtime.errors import InputError
from .error_state import fold
from .estimate import COASTING, NIS, TRACKING, Array
from .filter_record import FILTER, N, drive, propagate
from .hover_covariance import (
    carry_at_hover,
    catch_up,
    heading,
    jacobian_at_hover,
    turn_vectors,
    turn_world,
)
from .model_uncertainty import follow_loads
from .recovery import after_prediction, grow_older, learn_noise, likeliest_scale, remember
from .sample import check_sample, undo_sensing
from .ukf import WrenchUKF, correct_parts
from .ukf import step as ukf_step

_MEASURED = (0, 1, 2, 6, 7, 8)  # rows of (rho, x) in the error state
_LONGEST = 60  # s of hover until the gain must have converged
_CONVERGED = 1e-9  # relative change of the covariance in a second
_HEIGHT = 1.2  # m, of that hover
_LONGEST_GAP = 0.1  # s of coasting with a constant gain, without a position or an attitude
_NEAR = 1.1  # of the converged variances: nearly converged again
# The variances must have been near for so many time constants of the wrench. A difference of e^-4
# remains: a step earlier or later makes no difference.
_SETTLE = 2.0


@compiled
def step(f: Record, z: Array, parts: int, dt: float, voltage: float) -> int:
    """Step like ``ukf.step``; in the steady state the gain is ``f.gain``, not the covariance's."""
    usable = check_sample(f, z, parts)
    if usable < 0:
        return usable
    sample = undo_sensing(f, z, usable, dt)
    x, centre, y, residual = f.x, f.centre, f.innovation, f.poses.residual
    centre[:NIS] = x[:NIS]
    if dt > 0.0:
        drive(f, sample[0:4], dt, voltage)
        propagate(f, x, dt, centre)
        follow_loads(f, f.rotation, dt)
        f.time += dt
    if f.steady == 0:  # go on from the predicted state with the covariance
        x[:NIS], x[NIS] = centre[:NIS], math.nan
        if dt > 0.0:
            f.near += dt
            carry_at_hover(f, dt)
            after_prediction(f, dt)
        if usable > 0:
            _correct_with_covariance(f, sample, usable)
            _look_for_steady_state(f)
        return usable
    grow_older(f, dt)
    f.status = COASTING
    y[:] = 0.0
    if usable & 2 != 0:
        attitude_error(sample[7:11], centre[3:7], y[0:3])
    if usable & 1 != 0:
        for i in range(3):
            y[3 + i] = sample[4 + i] - centre[i]
    for i in range(6):
        a = _MEASURED[i]
        f.increment[i], f.unsure[i] = y[i] - residual[i], f.converged[a, a]
    # the heading as cosine and sine; straight up or down there is none, and none is needed
    across, along = (
        centre[3] * centre[6] + centre[4] * centre[5],
        0.5 - centre[5] * centre[5] - centre[6] * centre[6],
    )
    length = math.sqrt(across * across + along * along)
    cosine, sine = (along / length, across / length) if length > 1e-6 else (1.0, 0.0)
    turn_vectors(y, 2, cosine, -sine)
    mean = f.mean
    for i in range(N):
        total = 0.0
        for j in range(6):
            total += f.gain[i, j] * y[j]
        mean[i] = total
    nis = 0.0
    for i in range(6):
        for j in range(6):
            nis += y[i] * f.information[i, j] * y[j]
    noise = 1.0 + max(f.poses.widened[0], f.poses.widened[1])
    likeliest = max(likeliest_scale(f, 0), likeliest_scale(f, 3))
    late = f.poses.position_age > _LONGEST_GAP or f.poses.attitude_age > _LONGEST_GAP
    if late or not nis <= likeliest * f.alarm[usable // 3]:
        # a covariance takes over at the predicted state: after a gap, with the gap's widening made
        # up for, or at a measurement that must be judged
        f.steady, f.near = 0, 0.0
        x[:NIS], x[NIS] = centre[:NIS], math.nan
        catch_up(f)
        after_prediction(f, 0.0)
        _correct_with_covariance(f, sample, usable)
        return usable
    x[NIS] = nis if usable == 3 else math.nan
    if usable > 0:
        learn_noise(f, usable & 1 != 0, usable & 2 != 0)
        # with this gain more noise has more of a share in the covariance: at most all of it
        f.poses.strain = max(f.poses.strain, noise - 1.0)
    turn_vectors(mean[0:3], 1, cosine, sine)  # the rate, next, is in body axes
    turn_vectors(mean[6:N], 4, cosine, sine)
    fold(f, centre, mean)
    for i in range(6):
        if usable & (2 if i < 3 else 1) != 0:
            residual[i] += f.increment[i]
        residual[i] -= mean[_MEASURED[i]]
    if usable > 0:
        f.status = TRACKING
        remember(f, sample[4:11], usable & 1 != 0, usable & 2 != 0)
    return usable


@compiled
def _correct_with_covariance(f: Record, sample: Array, usable: int) -> None:
    if usable > 0:
        w, z = heading(f.x[3:7])
        here, origin = f.x[0:3].copy(), np.zeros(3)
        turn_world(f, sample[4:11], w, -z, here, origin)
        correct_parts(f, sample, usable)
        turn_world(f, sample[4:11], w, z, origin, here)


@compiled
def _look_for_steady_state(f: Record) -> None:
    """Return to the constant gain once the covariance has stayed near the converged one for a
    while.
    """
    near, noise = f.status == TRACKING, 1.0 + max(f.poses.widened[0], f.poses.widened[1])
    for i in range(N):
        near &= f.P[i, i] <= _NEAR * noise * f.converged[i, i]
    if not near:
        f.near = 0.0
    if f.near <= f.settle:
        return
    f.steady, f.P[:] = 1, f.converged


@compiled
def _step_at(address: int, parts: int, dt: float, voltage: float) -> int:
    f = carray(pointer_to(address), 1, FILTER)[0]
    return step(f, f.z, parts, dt, voltage)


class ConstantGainFilter(WrenchUKF):
    """The wrench filter with a constant gain; ``reset`` and ``step`` are those of ``WrenchUKF``.

    The gain is converged from the start: a wrong first guess of pose or wrench takes the rise time
    to correct. Up to 0.1 s without a measurement, or a part of one, the filter coasts: the state
    moves on by the model, and the gain stays. After a longer gap, a restart or a refused
    measurement the filter has a covariance until convergence: that of the model linearised at
    hover. ``covariance`` is always that of a vehicle facing along x. With noise that differs
    between x and y, the gain is exact at this heading only.

    Arguments are those of ``WrenchUKF``.

    Raises:
        InputError: a setting is out of range, or the filter does not converge at hover.
    """

    _step_at = staticmethod(_step_at)
    _no_imu = "correct_imu needs a covariance; use WrenchUKF"
    _converged: Array | None = None

    def _prepare(self) -> None:
        """Converge at hover."""
        self.reset((0.0, 0.0, _HEIGHT), (1.0, 0.0, 0.0, 0.0))
        P, hover = _converged(self.record.tobytes(), self.vehicle.voltage_ref)
        self._converged, f = P, self.record[0]
        f["hover"] = hover
        inverse = 1.0 / f["noise"]
        # with P after the correction: K = P H' / R, and the innovation's inverse covariance is (R -
        # H P H') within / R
        f["gain"] = P[:, list(_MEASURED)] * inverse
        left = np.diag(f["noise"]) - P[np.ix_(_MEASURED, _MEASURED)]
        f["information"] = inverse[:, None] * left * inverse
        f["P"] = f["converged"] = P
        walks = f["thrust"] / f["force_walk"], f["motor_torque"] / f["torque_walk"]
        f["settle"] = _SETTLE * self.period * math.sqrt(float(np.max(walks)))
        f["steady"] = 1

    def _begin(self) -> None:
        """Start with the converged covariance, whatever ``reset`` was given."""
        if self._converged is not None:
            f = self.record[0]
            f["P"], f["steady"] = self._converged, 1


@compiled_without_gil
def _hover(record: np.ndarray, z: Array, steps: int, voltage: float) -> None:
    f = record[0]
    for _ in range(steps):
        ukf_step(f, z, 3, f.period, voltage)


@lru_cache(maxsize=32)
def _converged(start: bytes, voltage: float) -> tuple[Array, Array]:
    """Return the converged covariance (18, 18) after a correction of ``WrenchUKF``, its record
    given at hover, and the derivatives (6, 18) of its accelerations there.

    Raises:
        InputError: no convergence.
    """
    record = np.frombuffer(start, dtype=FILTER).copy()
    f = record[0]
    z = np.concatenate([f["last_speeds"], f["x"][:7]])
    second = max(1, round(1.0 / float(f["period"])))
    for _ in range(_LONGEST):
        before = f["P"].copy()
        _hover(record, z, second, voltage)
        scale = np.sqrt(np.diag(f["P"]))
        if np.all(np.abs(f["P"] - before) <= _CONVERGED * np.outer(scale, scale)):
            return np.array(f["P"]), jacobian_at_hover(record, voltage, scale)
    raise InputError(
        f"ConstantGainFilter: the gain does not converge within {_LONGEST} s of hover; use "
        f"WrenchUKF"
    )
