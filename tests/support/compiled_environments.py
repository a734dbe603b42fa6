"""Steps of each kind of filter and environment, which compile what most tests of them need."""

import gymnasium as gym
import numpy as np

import windwrench  # noqa: F401  registers the environments
from windwrench.dynamics import load_vehicle
from windwrench.estimator import WrenchEKF, ukf_lanes


def compile_environments():
    """Step filters in lanes, the linearised filter, single environments and
    vectors of them; compiled code is kept, so that a second call takes no time.

    What shares no code with ``compile_estimates``, which another process compiles meanwhile, comes
    first: the rest then finds on disk what that one has compiled.
    """
    ukf_lanes.step_address()
    pose = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    estimator = WrenchEKF(load_vehicle("ardrone2"))
    estimator.reset(*pose)
    estimator.step(np.full(4, 300.0), *pose)
    for name in ("FanTracking", "FanTracking2D", "WindHover"):
        step_one(name)
    for estimator in ("constant-gain", "ukf"):
        step_one("FanTracking", estimator=estimator)
        step_many(estimator=estimator)
    step_many(plant="lanes")


def step_one(name, **given):
    env = gym.make(f"windwrench/{name}-v0", **given)
    env.reset(seed=0)
    env.step(np.zeros(env.action_space.shape, dtype=np.float32))
    env.close()


def step_many(**given):
    envs = gym.make_vec(
        "windwrench/FanTracking-v0",
        num_envs=9,
        vectorization_mode="vector_entry_point",
        **given,
    )
    envs.reset(seed=0)
    envs.step(np.zeros(envs.action_space.shape, dtype=np.float32))
    envs.close()
