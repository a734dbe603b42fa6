"""Neither filter nor environment holds on to more memory the longer it runs."""

import gc
import itertools
import tracemalloc

import numpy as np
import pytest

from windwrench.dynamics import load_vehicle
from windwrench.envs import FanTrackingEnv
from windwrench.envs.vector import FanTrackingVectorEnv
from windwrench.estimator import ConstantGainFilter, WrenchUKF, WrenchUKFBatch

VEHICLE = load_vehicle("ardrone2")
POSE = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0, 0.0])


def growth(work):
    """Bytes that are held after ``work`` was done five times more, once it has warmed up: the least
    of three times, since a leak grows in each, and what else is done meanwhile does not.
    """
    work()
    work()
    tracemalloc.start()
    try:
        work()
        held = []
        for _ in range(3):
            gc.collect()
            held.append(tracemalloc.get_traced_memory()[0])
            for _ in range(5):
                work()
        gc.collect()
        held.append(tracemalloc.get_traced_memory()[0])
        return min(after - before for before, after in itertools.pairwise(held))
    finally:
        tracemalloc.stop()


def test_of_what_leaks():
    kept = []
    assert growth(lambda: kept.append(bytes(10_000))) > 40_000


@pytest.mark.parametrize("make", [WrenchUKF, ConstantGainFilter])
def test_of_a_filter(make):
    estimator, speeds = make(VEHICLE), np.full(4, VEHICLE.hover_rate)
    estimator.reset(*POSE)

    def work():
        for _ in range(2000):
            estimator.step(speeds, *POSE)

    assert growth(work) < 4000


def test_of_a_batch():
    batch, speeds = WrenchUKFBatch(VEHICLE, 50), np.full((50, 4), VEHICLE.hover_rate)
    batch.reset(*POSE)
    position, quaternion = (np.tile(part, (50, 1)) for part in POSE)

    def work():
        for _ in range(40):
            batch.step(speeds, position, quaternion)

    assert growth(work) < 4000


@pytest.mark.parametrize(
    "make",
    [lambda: FanTrackingEnv("base"), lambda: FanTrackingVectorEnv(3, threads=2, scenario="base")],
)
def test_of_an_environment_over_episodes(make):
    env = make()
    action = np.zeros(env.action_space.shape, np.float32)

    def work():
        env.reset(seed=0)
        for _ in range(30):
            env.step(action)

    assert growth(work) < 20_000
    env.close()
