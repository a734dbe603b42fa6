"""The state of a flight at each row of its log, from this row and those before it alone.

A prediction starts here. The wrench filter runs forward, without a smoother. The best bandwidth of
a filter depends on the model's errors, stated in no file. So filters with four assumptions of them
run side by side. At each row the state is from the filter with the likeliest poses so far (multiple
models: Magill, *Optimal adaptive estimation of sampled stochastic processes*, IEEE Trans. Automatic
Control 10, 1965).

A gyro measures the angular velocity, however wrong the model's torque. One filter with the default
tuning then starts predictions as well as four.
"""

from dataclasses import replace

import numpy as np

from .. import _core
from ..dynamics.vehicle import Vehicle
from ..estimator import Recovery, UKFTuning, WrenchUKF
from ..estimator.estimate import WITHOUT_COVARIANCE
from ..estimator.model_uncertainty import LOAD
from ..estimator.tuning import PERIOD
from ..estimator.ukf import default_covariance, make_calls
from .logs.flight_log import FlightLog
from .logs.table import Array
from .motion.sensing_effects import delay_of, sensing_of
from .wrench_series import calls_of

STATE = 13  # numbers: position, quaternion, velocity, angular velocity

# white noise of the model, walk of the force and of the torque, in units of
# ``UKFTuning.for_vehicle``. On 17 simulated and measured flights a grid of 17 predicts the position
# nearer by 0.2 % on average and by 6.5 % at most; the default alone is 31 % worse on average
_ASSUMED = ((1.0, 1.0, 1.0), (0.1, 1.0, 0.03), (0.1, 1.0, 1.0), (0.1, 45.0, 45.0))


def causal_states(log: FlightLog, vehicle: Vehicle) -> Array:
    """Return the state (N, STATE) at each row of a log: position (m) and velocity (m/s), world,
    quaternion, body to world, and angular velocity (rad/s), body. Rows before the first pose are
    NaN.

    Args:
        log: with a pose, without declared sensing effects (``undo_log_sensing``).
        vehicle: the filters' model, with its declared effects.

    Raises:
        InputError: the vehicle has too many effects for a model.
    """
    first, count = int(np.flatnonzero(log.valid)[0]), len(log.t)
    # a declared delay has moved the poses off the clock of an IMU
    with_imu = log.gyro is not None and delay_of(vehicle) == 0.0
    sensing = sensing_of(vehicle)
    vehicle = replace(vehicle, effects=tuple(e for e in vehicle.effects if e not in sensing))
    # with a fixed period: the log's, a median, would depend on later rows
    usual = UKFTuning.for_vehicle(vehicle, PERIOD)
    filters = [
        WrenchUKF(vehicle, scaled_tuning(usual, *factors), PERIOD)
        for factors in _ASSUMED[: 1 if with_imu else None]
    ]
    rows = np.arange(first + 1, count)
    calls, to = calls_of(log, rows, filters[0], with_imu)
    last, posed = np.searchsorted(to, rows, side="right") - 1, calls["parts"] == 3
    states, best = np.full((count, STATE), np.nan), np.full(len(rows), -np.inf)
    states[first] = np.concatenate([log.position[first], log.quaternion[first], np.zeros(6)])
    each = np.arange(len(calls))
    numbers, innovations = np.empty((len(calls), WITHOUT_COVARIANCE)), np.empty((len(calls), 12))
    others = np.empty((len(calls), 18)), np.empty((len(calls), *LOAD))
    # at the start the angular velocity and the velocity are not known
    moving = np.array([3, 4, 5, 9, 10, 11])
    deviations = np.repeat([Recovery.angular_velocity_std, Recovery.velocity_std], 3)
    for ukf in filters:
        covariance = default_covariance(vehicle, ukf.tuning)
        covariance[moving, moving] = np.square(deviations)
        ukf.reset(log.position[first], log.quaternion[first], covariance)
        make_calls(ukf.record, calls, each, numbers, *others, innovations)
        _core.choose_likeliest(last, posed, numbers, innovations, states[first + 1 :], best)
    return states


def scaled_tuning(usual: UKFTuning, white: float, force: float, torque: float) -> UKFTuning:
    """Return a tuning with the white noise of the model and the walks times these factors."""
    return replace(
        usual,
        thrust_noise=white * np.asarray(usual.thrust_noise),
        motor_torque_noise=white * np.asarray(usual.motor_torque_noise),
        force_walk=force * np.asarray(usual.force_walk),
        torque_walk=torque * np.asarray(usual.torque_walk),
    )
