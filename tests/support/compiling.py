"""Steps of each kind of filter and environment, and estimates on logs of every mix of sensors: they
compile what most tests need. Compiled code is kept, so that a second call takes no time.
"""

from dataclasses import replace

import gymnasium as gym
import numpy as np

import windwrench  # noqa: F401  registers the environments
from tests.support.flown import VEHICLE, without_pose
from tests.support.imu_flights import imu_flight
from windwrench.estimator import ukf_lanes
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.prediction import nis_without_wrench_state, rollout_error
from windwrench.identification.wrench_series import estimate_log


def compile_environments():
    """Step filters in lanes, single environments and vectors of them.

    What shares no code with ``compile_estimates``, which another process compiles meanwhile, comes
    first: the rest then finds on disk what that one has compiled.
    """
    ukf_lanes.step_address()
    for name in ("FanTracking", "FanTracking2D", "WindHover"):
        step_one(name)
    for estimator in ("constant-gain", "ukf"):
        step_one("FanTracking", estimator=estimator)
        step_many(estimator=estimator)
    step_many(plant="lanes")


def step_one(name, **given):
    env = gym.make(f"windwrench/{name}-v1", **given)
    env.reset(seed=0)
    env.step(np.zeros(env.action_space.shape, dtype=np.float32))
    env.close()


def step_many(**given):
    envs = gym.make_vec(
        "windwrench/FanTracking-v1",
        num_envs=9,
        vectorization_mode="vector_entry_point",
        **given,
    )
    envs.reset(seed=0)
    envs.step(np.zeros(envs.action_space.shape, dtype=np.float32))
    envs.close()


def compile_estimates():
    """Estimate with a pose, with an IMU beside it, smoothed with it and without, and with a pose
    five times a second; fly a model along; diagnose.
    """
    log = imu_flight(VEHICLE, seconds=12.0, trajectory="hover")
    alone = replace(log, accelerometer=None, gyro=None)
    for flown in (alone, log):
        estimate_log(flown, VEHICLE)
        estimate_log(flown, VEHICLE, smooth=True)
    segments = ((2.0, 10.0),)
    nis_without_wrench_state(alone, VEHICLE, segments)
    rollout_error(alone, VEHICLE, segments)
    diagnose([alone], VEHICLE)
    rows = np.arange(len(log.t))
    for lost in (rows % 40 != 0, rows >= 0):
        estimate_log(without_pose(log, lost), VEHICLE)
