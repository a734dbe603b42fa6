"""Neither filter nor environment holds on to more memory the longer it runs."""

import gc
import itertools
import tracemalloc

import numpy as np
import pytest

from windwrench.dynamics import load_vehicle
from windwrench.envs import FanTrackingEnv
from windwrench.envs.vector import TaskVectorEnv
from windwrench.estimator import ConstantGainFilter, WrenchUKF, WrenchUKFBatch

VEHICLE = load_vehicle("ardrone2")
SPEEDS = np.full(4, VEHICLE.hover_rate)
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


def stepped(estimator, count=None, steps=300):
    """Return what steps an estimator, or ``count`` side by side, so many times."""
    given = [np.tile(part, (count, 1)) if count else part for part in (SPEEDS, *POSE)]
    estimator.reset(*POSE)

    def work():
        for _ in range(steps):
            estimator.step(*given)

    return work


def episode(env, steps=10):
    """Return what flies the beginning of an episode."""
    action = np.zeros(env.action_space.shape, np.float32)

    def work():
        env.reset(seed=0)
        for _ in range(steps):
            env.step(action)

    return work


def test_a_leak_is_seen():
    kept = []
    assert growth(lambda: kept.append(bytes(10_000))) > 40_000


@pytest.mark.parametrize(
    ("make", "most"),
    [
        (lambda: stepped(WrenchUKF(VEHICLE)), 4000),
        pytest.param(lambda: stepped(ConstantGainFilter(VEHICLE)), 4000, marks=pytest.mark.slow),
        (lambda: stepped(WrenchUKFBatch(VEHICLE, 11), 11, 50), 4000),
        pytest.param(lambda: episode(FanTrackingEnv("base")), 20_000, marks=pytest.mark.slow),
        (lambda: episode(TaskVectorEnv(3, threads=2, scenario="base")), 20_000),
    ],
    ids=["filter", "constant gain", "batch", "environment", "environments"],
)
def test_nothing_grows(make, most):
    assert growth(make()) < most
