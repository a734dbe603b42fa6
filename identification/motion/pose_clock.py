"""A flight log on the clock of its poses, where poses are rarer than rows.

Poses between two measurements are unknown. An interpolated pose has no noise above half the pose's
own rate, so a likelihood over all rows takes interpolated poses for exact measurements. One row a
pose is the measured flight: rotor speeds act over the whole interval that ends at the pose.
"""

from dataclasses import replace

import numpy as np

from ..logs.flight_log import FlightLog, with_rows
from ..logs.table import Array, Data, Rows, median_step
from .inertial_signals import reads_imu


def on_pose_clock(log: FlightLog) -> FlightLog:
    """Return a log with one row a pose, or the log itself where poses stand in every row, or are so
    rare that an IMU shows the motion.

    Rotor speeds are the root of the mean square, commands, voltage and true wrench the mean over
    the interval that ends at the pose. Gyro and accelerometer are means around the pose.
    """
    rows = np.flatnonzero(log.valid)
    if reads_imu(log) or len(rows) < 2 or median_step(log.t[rows]) < 1.5 * log.period:
        return log
    begins = np.append(rows[0], rows[:-1] + 1)
    middles = np.append(0, (rows[1:] + rows[:-1]) // 2 + 1)
    flown = with_rows(log, np.arange(len(log.t)) <= rows[-1])

    def averaged(log: FlightLog, begins: Rows, *names: str) -> Data:
        values = {name: getattr(log, name) for name in names}
        return {name: _means(x, begins) for name, x in values.items() if x is not None}

    return replace(
        with_rows(log, log.valid),
        rotor_speeds=np.sqrt(_means(np.square(flown.rotor_speeds), begins)),
        **averaged(flown, begins, "command", "voltage", "force", "torque"),
        **averaged(log, middles, "gyro", "accelerometer"),
    )


def _means(x: Array, begins: Rows) -> Array:
    """Return the means of the finite rows of x (N, ...), from each row of ``begins`` to the next;
    NaN: there are none.
    """
    there = np.isfinite(x)
    counts = np.add.reduceat(there.astype(float), begins)
    sums = np.add.reduceat(np.where(there, x, 0.0), begins)
    return np.divide(sums, counts, out=np.full_like(sums, np.nan), where=counts > 0.0)
