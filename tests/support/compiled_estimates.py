"""Estimates on logs of every mix of sensors, which compile what most tests need."""

from dataclasses import replace

import numpy as np

from windwrench.dynamics import load_vehicle
from windwrench.envs.recording import record_flight
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.wrench_series import estimate_log


def compile_estimates():
    """Estimate with a pose, with an IMU beside it, smoothed, and with a pose five times a second;
    compiled code is kept, so that a second call takes no time.
    """
    vehicle = load_vehicle("ardrone2")
    log = FlightLog(**record_flight(vehicle, (), "hover", 12.0, seed=0, imu=True))
    estimate_log(replace(log, accelerometer=None, gyro=None), vehicle)
    estimate_log(log, vehicle)
    estimate_log(log, vehicle, smooth=True)
    rows = np.arange(len(log.t))
    for seen in (rows % 40 == 0, rows < 0):
        position = np.where(seen[:, None], log.position, np.nan)
        quaternion = np.where(seen[:, None], log.quaternion, np.nan)
        estimate_log(replace(log, position=position, quaternion=quaternion, valid=seen), vehicle)
