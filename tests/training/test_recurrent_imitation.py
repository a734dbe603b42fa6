"""Imitation with a memory: what is taught, what is folded, and that it learns."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from windwrench.controllers.observation import VELOCITY_Y
from windwrench.controllers.trained_policy import TrainedPolicy, load_policy
from windwrench.envs.fan_tracking import FanTrackingEnv
from windwrench.training.configuration import features_of, load_config

pytest.importorskip("torch", reason="pip install 'windwrench[rl]'")
pytest.importorskip("stable_baselines3", reason="pip install 'windwrench[rl]'")
import torch

from windwrench.training.belief_network import BeliefNetwork, Sequences, fit
from windwrench.training.flown_sequences import fan_flights
from windwrench.training.run import card_of, read_progress
from windwrench.training.seeds import training_seed
from windwrench.training.train import train as run_training

SHORT = ["rounds=2", "epochs=1", "last_epochs=1", "state=4", "net=[8]", "gains=[2.0, 3.0]"]
SHORT += ["dampings=[0.2]", "validation.episodes=1"]


def config_of(*more):
    return load_config("recurrent-imitation", [*SHORT, *more])


@pytest.mark.parametrize("cell", ["lstm", "gru"])
def test_a_policy_commands_its_shares_of_what_the_network_says(cell):
    config = config_of()
    torch.manual_seed(1)
    network = BeliefNetwork(6, 3, cell, 5, [7], "relu")
    shares = np.array([[2.0, 1.0, 0.3]], dtype=np.float32)
    policy = TrainedPolicy(card_of(config, "base", 0, 0), network.policy_weights(shares))
    frames = np.random.default_rng(0).normal(size=(9, 6)).astype(np.float32)
    with torch.no_grad():
        means, _, _ = network(torch.from_numpy(frames)[:, None])
    expected = np.clip(means[:, 0].numpy() @ shares[0], -1.0, 1.0)
    assert_allclose([policy.act(x)[0] for x in frames], expected, atol=1e-5)


def test_what_is_taught_is_the_fan_s_place_and_velocity():
    config = config_of("steps=500", "rounds=1", "wander.size=0.0")
    flights = fan_flights(config, "fast", 3)
    flights.fly(None, np.zeros((1, 3), dtype=np.float32))
    flown = flights.sequences()
    assert flown.seen.shape == (250, 2, 6)
    assert flown.counts.min() == 1.0
    # the first episode once more, one environment by itself, at the commands that were seen
    env = FanTrackingEnv("fast", estimator="constant-gain")
    observation, info = env.reset(seed=training_seed(3, 0, 0))
    features, fan, offsets, speeds = features_of(config), [], [], []
    for k in range(40):
        seen = features.frames(observation[None])[0]
        assert_array_equal(flown.seen[k, 0, :5], seen[:5])
        fan.append(info["fan_y"])
        offsets.append(info["fan_y"] - info["y"])
        speeds.append(observation[VELOCITY_Y])
        observation, _, _, _, info = env.step(flown.seen[k + 1, 0, 4:5])
    assert_allclose(flown.truth[:40, 0, 0], offsets, atol=1e-6)
    velocities = (np.array(fan[2:]) - fan[:-2]) / 0.16
    assert_allclose(flown.truth[:38, 0, 1], velocities, atol=1e-5)
    assert_allclose(flown.truth[:38, 0, 2], velocities - np.array(speeds)[:38], atol=1e-5)


def test_nothing_is_taught_where_the_vehicle_is_lost():
    config = config_of("steps=1000", "rounds=1", "wander.size=20.0", "wander.time=30.0")
    flights = fan_flights(config, "base", 0)
    flights.fly(None, np.zeros((1, 3), dtype=np.float32))
    flown = flights.sequences()
    ended = np.flatnonzero(flown.counts.min(axis=0) == 0.0)
    assert len(ended) > 0
    assert np.all(np.diff(flown.counts, axis=0) <= 0.0)  # and never again
    assert np.abs(flown.truth[..., 0][flown.counts > 0]).max() <= 2.6


def test_the_mean_of_what_is_hidden_is_learned():
    """A random walk seen through noise: the network must come to the error of the Kalman filter."""
    rng = np.random.default_rng(0)
    walk = np.cumsum(0.3 * rng.normal(size=(60, 256, 1)), axis=0).astype(np.float32)
    seen = walk + rng.normal(size=walk.shape).astype(np.float32)
    torch.manual_seed(0)
    network = BeliefNetwork(1, 1, "lstm", 16, [16], "relu")
    episodes = Sequences(seen, walk, np.ones((60, 256), dtype=np.float32))
    fit(network, episodes, 25, 32, (0.01, 0.0), torch.Generator().manual_seed(0))
    with torch.no_grad():
        mean, deviation, _ = network(torch.from_numpy(seen))
    error = np.sqrt(np.mean((mean.numpy() - walk)[20:] ** 2))
    # the Riccati equation of the walk: p = (p + q) / (p + q + 1), q = 0.09
    best = np.sqrt((-0.09 + np.sqrt(0.09**2 + 4 * 0.09)) / 2)
    assert error < 1.25 * best
    assert np.exp(deviation[20:].numpy()).mean() == pytest.approx(error, rel=0.2)


def test_the_left_is_learned_from_the_right():
    """Episodes in which what is hidden is positive alone teach what it is where it is negative."""
    rng = np.random.default_rng(0)
    hidden = np.repeat(rng.uniform(0.5, 1.5, (1, 128, 1)), 20, axis=0).astype(np.float32)
    seen = np.concatenate([hidden, np.ones_like(hidden)], axis=2)
    torch.manual_seed(0)
    network = BeliefNetwork(2, 1, "gru", 8, [8], "relu")
    mirrored = np.array([-1.0, 1.0], dtype=np.float32)
    episodes = Sequences(seen, hidden, np.ones((20, 128), dtype=np.float32))
    fit(network, episodes, 40, 16, (0.02, 0.0), torch.Generator().manual_seed(0), mirrored)
    with torch.no_grad():
        mean, _, _ = network(torch.from_numpy(seen * mirrored))
    assert np.abs(mean.numpy() + hidden)[5:].mean() < 0.05


def test_a_run_leaves_the_best_policy_and_is_the_same_again(tmp_path):
    config = config_of("steps=2000")
    told = []
    path = run_training(config, "base-fast", 0, tmp_path / "a", advance=told.append)
    card = load_policy(path).card
    assert (card["gain"], card["damping"]) in [(2.0, 0.2), (3.0, 0.2)]
    assert read_progress(tmp_path / "a").steps[-1] == 2000
    assert told == sorted(told)
    assert told[-1] == 2000
    before = path.read_bytes()
    assert run_training(config, "base-fast", 0, tmp_path / "a").read_bytes() == before  # done
    again = run_training(config, "base-fast", 0, tmp_path / "b")
    assert again.read_bytes() == before


def test_a_command_can_be_taught_in_place_of_the_motion(tmp_path):
    config = config_of("steps=1000", "says=command")
    card = load_policy(run_training(config, "base", 0, tmp_path)).card
    assert "gain" not in card
    assert json.dumps(card["config"]) == json.dumps(config)
