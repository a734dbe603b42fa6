"""Trained policies: what they see, what their files hold, how they fly, and what is refused."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from tests.support.outcomes import refused
from windwrench.controllers.features import Features
from windwrench.controllers.registry import shipped_policies
from windwrench.controllers.trained_policy import (
    TaskPolicy,
    TrainedPolicy,
    load_policy,
    save_policy,
)
from windwrench.envs.fan_tracking import FanTrackingEnv
from windwrench.evaluation.episodes import FIRST_TEST_SEED, benchmark_seeds, fly_episode
from windwrench.evaluation.tasks import TASKS, make_pilot
from windwrench.training.seeds import FIRST_VALIDATION_SEED, training_seed, validation_seeds

CARD = {
    "algorithm": "test",
    "features": {"frame": ["torque_z"], "history": 1, "scale": [0.03]},
    "repeat": 1,
    "activation": "relu",
    "squash": False,
}


def follower(gain=18.0):
    """The admittance law as a policy: one linear layer on the scaled torque."""
    return {
        "weight0": np.array([[-gain * 0.03]], dtype=np.float32),
        "bias0": np.zeros(1, dtype=np.float32),
    }


def test_a_linear_policy_is_the_admittance_law(tmp_path):
    path = save_policy(CARD, follower(), tmp_path / "law.npz")
    env = FanTrackingEnv("base")
    policy, law = (
        fly_episode(env, make_pilot(name, "FanTracking"), 0) for name in (str(path), "admittance")
    )
    assert_allclose(policy.command, law.command, atol=1e-5)
    assert law.rmse < 0.3


def test_what_is_written_is_what_is_read(tmp_path):
    path = save_policy(CARD, follower(), tmp_path / "a.npz")
    again = save_policy(CARD, follower(), tmp_path / "b.npz")
    assert path.read_bytes() == again.read_bytes()
    for name in ("a.npz", "a.json"):
        policy = load_policy(tmp_path / name)
        assert_array_equal(policy.weights["weight0"], follower()["weight0"])
        assert policy.card["algorithm"] == "test"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.json", "a.npz", "b.json", "b.npz"]


def test_a_held_command_changes_every_other_decision():
    policy = TrainedPolicy({**CARD, "repeat": 2}, follower())
    episode = fly_episode(FanTrackingEnv("static"), policy, 1)
    commands = episode.command[:40].reshape(20, 2)
    assert_array_equal(commands[:, 0], commands[:, 1])
    assert len(np.unique(commands[:, 0])) > 15


def recurrent(cell, seen=1, state=4, size=1):
    """Random weights of a cell with a state of some numbers, and a linear layer."""
    rng = default_rng(0)
    rows = state * {"lstm": 4, "gru": 3}[cell]
    shapes = {
        f"{cell}_input": (rows, seen),
        f"{cell}_hidden": (rows, state),
        f"{cell}_input_bias": (rows,),
        f"{cell}_hidden_bias": (rows,),
        "weight0": (size, state),
        "bias0": (size,),
    }
    return {k: 0.3 * rng.standard_normal(s).astype(np.float32) for k, s in shapes.items()}


TASK_CARD = {
    "task": "WindHover",
    "scale": [2.0] * 27,
    "largest": 4.0,
    "activation": "tanh",
    "squash": False,
}


@pytest.mark.parametrize(
    ("kind", "card", "weights"),
    [
        (TrainedPolicy, CARD, recurrent("lstm")),
        (TrainedPolicy, CARD, recurrent("gru")),
        (TaskPolicy, TASK_CARD, recurrent("gru", 27, 5, 3)),
    ],
)
def test_a_recurrent_policy_forgets_at_the_start_of_an_episode(kind, card, weights):
    policy = kind(card, weights)
    observation = np.full(27, 0.02)
    first = [policy(observation)[0] for _ in range(3)]
    assert len(set(first)) == 3  # it remembers
    policy.reset()
    assert [policy(observation)[0] for _ in range(3)] == first


def test_a_policy_of_another_task_is_refused(tmp_path):
    path = save_policy(TASK_CARD, recurrent("gru", 27, 5, 3), tmp_path / "mine.npz")
    with refused("a policy of WindHover, not of WindTrajectory"):
        make_pilot(str(path), "WindTrajectory")


def test_a_shipped_policy_of_two_axes_flies_better_than_hover():
    env = TASKS["FanTracking2D"].environment("base")
    seeds = range(910_000, 910_004)
    least, learned = (
        np.mean([fly_episode(env, make_pilot(name, "FanTracking2D"), k).rmse for k in seeds])
        for name in ("hover", "gru-0")
    )
    assert learned < 0.7 * least
    assert all("gru-0" in shipped_policies(task) for task in TASKS if task != "FanTracking")


def test_what_is_mirrored_is_known():
    features = Features(("torque_z", "force_x", "path_y"), 2)
    assert_array_equal(features.mirrored, [-1, 1, -1, -1, 1, -1])


def test_seeds_of_training_validation_and_test_never_meet():
    training = [
        training_seed(run, env, episode)
        for run in range(40)
        for env in range(8)
        for episode in range(40)
    ]
    assert min(training) >= 0
    assert max(training) < FIRST_VALIDATION_SEED
    assert len(set(training)) > 0.98 * len(training)
    validation = validation_seeds(100_000)
    assert (validation[0], validation[-1]) == (FIRST_VALIDATION_SEED, FIRST_TEST_SEED - 1)
    assert min(benchmark_seeds(0, 10_000)) > validation[-1]
