"""Estimates on logs of every mix of sensors, and a model that flies along one: they compile what
most tests of logs need.
"""

from dataclasses import replace

import numpy as np

from windwrench.dynamics import load_vehicle
from windwrench.envs.recording import record_flight
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.prediction import nis_without_wrench_state, rollout_error
from windwrench.identification.wrench_series import estimate_log


def compile_estimates():
    """Estimate with a pose, with an IMU beside it, smoothed with it and without, and with a pose
    five times a second; compiled code is kept, so that a second call takes no time.
    """
    vehicle = load_vehicle("ardrone2")
    log = FlightLog(**record_flight(vehicle, (), "hover", 12.0, seed=0, imu=True))
    alone = replace(log, accelerometer=None, gyro=None)
    estimate_log(alone, vehicle)
    estimate_log(log, vehicle)
    estimate_log(log, vehicle, smooth=True)
    estimate_log(alone, vehicle, smooth=True)
    flown = ((2.0, 10.0),)
    nis_without_wrench_state(alone, vehicle, flown)
    rollout_error(alone, vehicle, flown)
    rows = np.arange(len(log.t))
    for seen in (rows % 40 == 0, rows < 0):
        position = np.where(seen[:, None], log.position, np.nan)
        quaternion = np.where(seen[:, None], log.quaternion, np.nan)
        estimate_log(replace(log, position=position, quaternion=quaternion, valid=seen), vehicle)
