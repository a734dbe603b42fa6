"""Hindsight in FanTracking: what is taught, what a network learns, and how its policy flies."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from tests.support.sizes import rms
from windwrench.controllers.preview import Oracle
from windwrench.envs.fan_tracking import FanTrackingEnv
from windwrench.envs.lanes.vector import TaskLanes

pytest.importorskip("torch", reason="pip install 'windwrench[rl]'")
pytest.importorskip("stable_baselines3", reason="pip install 'windwrench[rl]'")
import torch

from windwrench.training.fan_hindsight import FEATURES, FanHindsight
from windwrench.training.flown_sequences import Flights
from windwrench.training.seeds import training_seed
from windwrench.training.taught_network import Sequences, TaughtNetwork, fit


def flown(lesson, scenario, size, time=1.0, seed=3, count=8):
    flights = Flights(
        [TaskLanes(count, task=FanTrackingEnv, scenario=scenario)],
        lesson,
        (size, time),
        seed,
    )
    flights.fly(None, np.eye(3, dtype=np.float32)[:1])
    return flights.sequences()


def test_what_is_taught_is_the_oracle_s_command():
    """Of the first episode once more, one environment by itself, at the commands that were seen."""
    flights = flown(FanHindsight(), "base", 0.1)
    assert flights.seen.shape == (250, 8, FEATURES.size)
    env = FanTrackingEnv("base")
    oracle = Oracle(foresight=24)
    oracle.largest = 2.5
    env.foresight = oracle.foresight
    observation, info = env.reset(seed=training_seed(3, 0, 0))
    wanted = []
    offsets = []
    for k in range(100):
        seen = FEATURES.frames(observation[None])[0]
        assert_allclose(flights.seen[k, 0, -6:-1], seen[:5], atol=1e-3)
        wanted.append(oracle(observation, info)[0])
        offsets.append(info["fan_y"] - info["y"])
        observation, _, _, _, info = env.step(flights.seen[k + 1, 0, -2:-1])
    truth = flights.truth[:100, 0]
    assert_allclose(truth[:, 1], offsets, atol=1e-4)
    # the set point is held to begin where the vehicle is: it has moved while the filter settled
    assert rms(truth[:, 0] - wanted) < 0.1 * np.std(wanted)
    assert flights.counts.sum(axis=0).tolist() == [241.0] * 8


def test_nothing_is_taught_where_the_vehicle_is_lost():
    flights = flown(FanHindsight(), "base", 20.0, 30.0, 0, 16)
    assert len(np.flatnonzero(flights.counts[:200].min(axis=0) == 0.0)) > 0
    assert (np.diff(flights.counts, axis=0) <= 0.0).all()  # and never again
    assert abs(flights.truth[..., 1][flights.counts > 0]).max() <= 2.6


def test_the_mean_of_what_is_hidden_is_learned():
    """A random walk seen through noise: the network must come to the error of the Kalman filter."""
    rng = default_rng(0)
    walk = np.cumsum(0.3 * rng.normal(size=(60, 256, 1)), axis=0).astype(np.float32)
    seen = walk + rng.normal(size=walk.shape).astype(np.float32)
    torch.manual_seed(0)
    network = TaughtNetwork(1, 1, "lstm", 16, [16], "relu")
    episodes = Sequences(seen, walk, np.ones((60, 256), dtype=np.float32))
    fit(network, episodes, 25, 32, (0.01, 0.0), torch.Generator().manual_seed(0))
    with torch.no_grad():
        mean, deviation, _ = network(torch.from_numpy(seen))
    error = rms((mean.numpy() - walk)[20:])
    # the Riccati equation of the walk: p = (p + q) / (p + q + 1), q = 0.09
    assert error < 1.25 * np.sqrt((-0.09 + np.sqrt(0.09**2 + 4 * 0.09)) / 2)
    assert np.exp(deviation[20:].numpy()).mean() == pytest.approx(error, rel=0.2)


def test_the_left_is_learned_from_the_right():
    """Episodes in which what is hidden is positive alone teach what it is where it is negative."""
    rng = default_rng(0)
    hidden = np.repeat(rng.uniform(0.5, 1.5, (1, 128, 1)), 20, axis=0).astype(np.float32)
    seen = np.concatenate([hidden, np.ones_like(hidden)], axis=2)
    torch.manual_seed(0)
    network = TaughtNetwork(2, 1, "gru", 8, [8], "relu")
    mirrored = np.array([-1.0, 1.0], dtype=np.float32)
    episodes = Sequences(seen, hidden, np.ones((20, 128), dtype=np.float32))
    fit(network, episodes, 30, 32, (0.02, 0.0), torch.Generator().manual_seed(0), mirrored)
    with torch.no_grad():
        mean, _, _ = network(torch.from_numpy(seen * mirrored))
    assert abs(mean.numpy() + hidden)[5:].mean() < 0.05
