"""The memory of one wrench filter, as a record: ``Filter<double>`` of ``core/filter.hpp``, then the
rest of ``ConstantGain<double>``.
"""

import numpy as np

from ..dynamics.model import MODEL_FIELDS, load_model
from ..dynamics.vehicle import Vehicle
from .estimate import STATE_SIZE
from .model_uncertainty import FACTORS, LOAD, factors_of
from .recovery import MEMORY, N, Recovery, load_recovery
from .tuning import UKFTuning

BIASES = 6  # gyro and accelerometer, three each
AGREEING = 5  # accelerometer samples in a row that make a push
# multiple of the hover's rotor speed: no vehicle lifts 900 of its weights; a log in rpm exceeds it
FASTEST = 30.0
COMPANIONS = 12  # the biases, and the noise of the last step: ``imu``

IMU = np.dtype(
    [
        ("used", "i8"),  # whether ``correct_imu`` was ever called
        ("known", "i8"),  # whether there was a step, so that its noise is known
        ("refused", "i8"),
        # largest NIS of three numbers, of six, and of ``AGREEING`` that agree
        ("gate", "f8", (3,)),
        ("in_row", "i8"),  # refusable accelerometer samples in a row
        ("unlikely", "f8", (AGREEING, 3)),  # their last innovations, m/s2
        ("doubt", "f8", (2,)),  # s for which a sensor was refused; negative: never
        ("prior", "f8", (BIASES,)),  # variances
        ("walk", "f8", (BIASES,)),  # likewise, a period
        ("bound", "f8", (BIASES,)),  # largest bias of a sensor of its class
        ("mean", "f8", (COMPANIONS,)),
        ("regression", "f8", (N, COMPANIONS)),  # on the error state
        ("rest", "f8", (COMPANIONS, COMPANIONS)),  # covariance of the regression's remainder
        ("bias_covariance", "f8", (BIASES, BIASES)),
        ("sensitivity", "f8", (6, COMPANIONS)),  # gyro and accelerometer
    ]
)

FILTER = np.dtype(
    [
        *MODEL_FIELDS,
        ("poses", MEMORY),  # gaps, refusals and restarts: estimator.recovery
        # the estimate, in one piece
        ("x", "f8", (STATE_SIZE,)),
        ("status", "f8"),  # verdict on the last step's measurement
        ("restarts", "f8"),  # since the reset
        # variances of measured attitudes and positions, learned from the poses: relative excess
        # over the declared ones (estimator.recovery)
        ("excess", "f8", (2,)),
        ("model", "f8", (6,)),  # variances of torque and force by the vehicle's uncertainty
        ("P", "f8", (N, N)),
        ("load", "f8", LOAD),  # loads that this uncertainty scales: estimator.model_uncertainty
        ("predicted", "f8", (6,)),  # variances of torque and force before the last measurement
        ("last_speeds", "f8", (4,)),  # last measured rotor speeds
        ("gated", "i8"),
        ("alarm", "f8", (2,)),  # largest NIS without a check: three numbers, six
        ("restart_at", "f8"),  # largest NIS for a linear correction
        ("patience", "f8"),  # s
        ("give_up", "f8"),  # s
        ("prior", "f8", (N,)),  # variances of unknown states
        ("reason", "f8", (6,)),  # largest believed squares of torque and force
        ("lost", "f8", (N,)),  # variances beyond which an unmeasured state is lost
        ("push", "f8", (2,)),  # rad/s2 and m/s2, the hardest push
        ("response", "f8"),  # s
        ("fastest", "f8"),  # rad/s, largest measured rotor speed
        # tuning, as variances
        ("motor_torque", "f8", (3,)),
        ("torque_walk", "f8", (3,)),
        ("thrust", "f8", (3,)),
        ("force_walk", "f8", (3,)),
        # 1/s, decay of torque and force; 0: a random walk
        ("torque_rate", "f8", (3,)),
        ("force_rate", "f8", (3,)),
        ("noise", "f8", (6,)),  # measured pose (rho, x)
        ("imu_noise", "f8", (6,)),  # gyro and accelerometer
        ("uncertain", "f8", (FACTORS,)),  # the vehicle's uncertainty
        ("kappa", "f8"),
        ("period", "f8"),
        ("imu", IMU),
        # rotor speeds, position and quaternion of a step called from the core
        ("z", "f8", (11,)),
        ("centre_rotation", "f8", (3, 3)),  # attitude at the start of the last step
        ("innovation", "f8", (6,)),  # last pose (rho, x), whitened
        # constant gain, facing along x: the gain, and the innovation's inverse covariance
        ("gain", "f8", (N, 6)),
        ("information", "f8", (6, 6)),
        ("steady", "i8"),  # whether the constant gain is in use
        ("converged", "f8", (N, N)),  # the covariance of that gain
        ("near", "f8"),  # s since the covariance came near it
        ("settle", "f8"),  # s until the constant gain starts
        ("hover", "f8", (6, N)),  # derivatives of the accelerations at hover by the error state
    ]
)
ESTIMATE = int(FILTER.fields["x"][1])  # type: ignore[index]  # bytes from the record's start to the estimate


def fields_between(first: str, last: str) -> tuple[str, ...]:
    """Return the names of a filter's fields from one to another."""
    names = FILTER.names or ()
    return names[names.index(first) : names.index(last) + 1]


def filter_record(
    vehicle: Vehicle,
    tuning: UKFTuning,
    period: float,
    gate: float | None = None,
    recovery: Recovery | None = None,
) -> np.ndarray:
    """Return the memory (1,) of a filter for a vehicle with its declared effects; ``period`` in s,
    ``gate`` a probability.

    Raises:
        InputError: more effects than a model holds.
    """
    record = np.zeros(1, dtype=FILTER)
    f = record[0]
    built = load_model(f, vehicle)
    f["last_speeds"], f["uncertain"] = built.hover_rate, factors_of(built)
    f["fastest"] = FASTEST * built.hover_rate
    f["kappa"], f["period"] = tuning.kappa, period
    load_recovery(f, built, gate, Recovery() if recovery is None else recovery)
    for name, deviation in (
        ("motor_torque", tuning.motor_torque_noise),
        ("torque_walk", tuning.torque_walk),
        ("thrust", tuning.thrust_noise),
        ("force_walk", tuning.force_walk),
    ):
        f[name] = np.square(deviation)
    f["torque_rate"] = 1.0 / np.asarray(tuning.torque_time)
    f["force_rate"] = 1.0 / np.asarray(tuning.force_time)
    f["noise"][:3] = np.square(np.asarray(tuning.attitude_noise, dtype=np.float64) / 4.0)  # (16)
    f["noise"][3:] = np.square(tuning.position_noise)
    f["imu_noise"][:3], f["imu_noise"][3:] = (
        np.square(tuning.gyro_noise),
        np.square(tuning.accelerometer_noise),
    )
    return record
