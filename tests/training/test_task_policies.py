"""Policies of the other tasks are trained, the same ones from the same seed."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

pytest.importorskip("torch", reason="pip install 'windwrench[rl]'")

import torch

from windwrench.controllers.axis_models import axis_models
from windwrench.controllers.preview import WindOracle, preview
from windwrench.controllers.trained_policy import TaskPolicy
from windwrench.controllers.wind_observation import WIND_PERIOD
from windwrench.envs.lanes.vector import TaskLanes
from windwrench.envs.plant import PlantSettings
from windwrench.evaluation.tasks import TASKS
from windwrench.training.hindsight import (
    AHEAD,
    FAN_MIX,
    LATE,
    MIX,
    MIXES,
    WindLesson,
    lanes_of,
    mix_of,
)
from windwrench.training.linear_policy import MEMORY, LinearLaw
from windwrench.training.task_policies import _card, teach
from windwrench.training.taught_network import Sequences, TaughtNetwork

HOVER = TASKS["WindHover"].environment
MEMORIES = {"memory": list(MEMORY)}


def test_lanes_tell_the_truth_of_the_single_environment():
    lanes = TaskLanes(3, task=HOVER)
    single = HOVER()
    single.foresight = 1
    lanes.reset(seed=[4, 5, 6])
    single.reset(seed=5)
    for action in ([1.0, -2.0, 0.5], [-1.0, 0.0, 2.0]):
        lanes.step(np.tile(action, (3, 1)))
        *_, info = single.step(np.array(action))
    for name, values in lanes.truth().items():
        assert_allclose(values[1], info[name], rtol=1e-6, atol=1e-9)


def test_lanes_tell_how_late_their_answers_are():
    lanes = TaskLanes(3, task=HOVER, settings=PlantSettings(actuator_delay=0.01, pose_delay=0.015))
    lanes.reset(seed=0)
    assert_allclose(lanes.late(), 0.025)
    (delayed,) = lanes_of("WindHover", LATE, 8)
    delayed.reset(seed=0)
    assert len(set(delayed.late())) > 2
    assert delayed.late().max() <= 0.04 + 1e-9


@pytest.mark.parametrize("late", [0.0, 0.02])
def test_hindsight_knows_what_came_beside_the_model(late):
    """Of a flight of the linear model itself with any commands and disturbances."""
    oracle = WindOracle()
    rng = default_rng(0)
    count = 30
    lesson = WindLesson("WindHover", limit=np.inf)
    lesson._late = np.full(2, late)
    commands = rng.standard_normal((count + 1, 2, 3))
    states = []
    wanted = []
    for i, axis in enumerate(axis_models(oracle.vehicle, lag=0.04 + late)):
        A, B, _ = axis.held(WIND_PERIOD)
        gain, ahead = preview(A, B, np.eye(len(A)), oracle.effort, AHEAD)
        x = [rng.standard_normal((2, len(A)))]
        came = rng.standard_normal((count, 2, len(A)))
        for k in range(count):
            x.append(x[k] @ A.T + commands[k + 1, :, i : i + 1] * B[:, 0] + came[k])
        states.append(x)
        wanted.append(-(x[3] @ gain + np.einsum("kni,ki->n", came[3 : 3 + AHEAD], ahead)))
    lesson._states = list(zip(*states, strict=True))
    lesson._commands = list(commands)
    best, counts = lesson.taught(np.ones((count + 1, 2), dtype=np.bool_))
    assert_allclose(best[3], np.transpose(wanted))
    assert counts.sum(axis=0).tolist() == [count - AHEAD + 1] * 2


@pytest.mark.parametrize("cell", ["lstm", "gru"])
def test_a_policy_commands_its_shares_of_what_its_network_says_of_what_it_saw_whitened(cell):
    torch.manual_seed(0)
    network = TaughtNetwork(27, 3, cell, 8, [5], "tanh")
    rng = default_rng(0)
    mixed = np.diag(np.full(27, 0.01)) + 0.1 * rng.standard_normal((1, 27))
    seen = (rng.standard_normal((40, 6, 27)) @ mixed + 1.0).astype(np.float32)
    network.whiten(seen)
    turn, mean = (x.numpy() for x in network._white)
    white = (seen.reshape(-1, 27) - mean) @ turn
    assert_allclose(np.cov(white.T), np.eye(27), atol=0.1)
    with torch.no_grad():
        said = network(torch.from_numpy(seen))[0].numpy()
    shares = np.float32([[0.4, 1.0, 0.3], [0.0, 0.5, 0.2], [-0.6, 0.0, 1.0]])
    policy = TaskPolicy(_card("WindHover", cell, MIX, 0, 0), network.policy_weights(shares))
    flown = [policy(frame * np.float32(HOVER.scales)) for frame in seen[:, 2]]
    assert_allclose(flown, said[:, 2] @ shares.T, atol=1e-4)


def test_a_linear_policy_learns_a_lagging_answer_and_flies_as_it_was_fitted():
    """The answer is a low-pass of the position error, of four decisions."""
    rng = default_rng(0)
    law = LinearLaw()
    seen = rng.standard_normal((120, 8, 27)).astype(np.float32)
    kept = seen[0]
    truth = []
    for frames in seen:
        kept = kept + 0.25 * (frames - kept)
        truth.append(kept[:, :3])
    ones = np.ones(seen.shape[:2], dtype=np.float32)
    law.fit(Sequences(seen, np.array(truth), ones))
    policy = TaskPolicy(
        _card("WindHover", "linear", MIX, 0, 0) | MEMORIES,
        law.weights(np.eye(3, dtype=np.float32)),
    )
    state = None
    for k, frames in enumerate(seen):
        said, _, state = law(torch.from_numpy(frames[None]), state)
        flown = policy(frames[2] * np.float32(HOVER.scales))
        assert_allclose(flown, said[0, 2].numpy(), atol=1e-4)
        assert_allclose(flown, truth[k][2], atol=0.05)


def test_a_mix_has_all_of_its_scenarios():
    rare = dict.fromkeys(("varied", "gusts", "wash", "fan-wall"), 1)
    assert mix_of(MIX, 16) == {"base": 2, "turbulent": 3, "noisy": 5, LATE: 2} | rare
    assert mix_of("calm", 5) == {"calm": 5}
    assert mix_of(FAN_MIX, 19) == MIXES[FAN_MIX]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("task", "scenario", "episodes", "steps"),
    [
        ("WindHover", MIX, 16, 8000),
        ("FanTracking2D", "base", 16, 8000),
        ("FanTracking", "wide", 38, 19_000),
    ],
)
def test_a_taught_network_is_the_same_again(task, scenario, episodes, steps):
    one, other = (teach(task, scenario, 0, rounds=2, episodes=episodes, epochs=1) for _ in range(2))
    for name, array in one.weights.items():
        assert_array_equal(array, other.weights[name])
    assert one.card["steps"] == steps
