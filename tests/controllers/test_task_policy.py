"""Trained policies of the tasks beside FanTracking: read, flown in NumPy, and by name."""

import numpy as np
import pytest

from windwrench.controllers.registry import shipped_policies
from windwrench.controllers.trained_policy import TaskPolicy, load_task_policy, save_policy
from windwrench.dynamics import InputError
from windwrench.evaluation.episodes import fly_episode
from windwrench.evaluation.tasks import TASKS, make_pilot

SIZES = {"FanTracking2D": (10, 2), "WindHover": (27, 3), "WindTrajectory": (27, 3)}
CARD = {
    "task": "WindHover",
    "scale": [2.0] * 27,
    "largest": 4.0,
    "activation": "tanh",
    "squash": False,
}


def weights(rng, seen=27, state=5, size=3):
    shapes = {
        "gru_input": (3 * state, seen),
        "gru_hidden": (3 * state, state),
        "gru_input_bias": (3 * state,),
        "gru_hidden_bias": (3 * state,),
        "weight0": (size, state),
        "bias0": (size,),
    }
    return {k: rng.standard_normal(s).astype(np.float32) for k, s in shapes.items()}


def test_a_policy_comes_back_from_its_file_and_remembers(tmp_path):
    rng = np.random.default_rng(0)
    policy = TaskPolicy(CARD, weights(rng))
    again = load_task_policy(save_policy(CARD, policy.weights, tmp_path / "mine.npz"))
    seen = rng.standard_normal((4, 27)).astype(np.float32)
    said = np.array([policy(x) for x in seen])
    np.testing.assert_array_equal(said, [again(x) for x in seen])
    assert np.all(np.abs(said) <= 4.0)
    assert not np.array_equal(policy(seen[0]), said[0])  # it remembers
    policy.reset()
    np.testing.assert_array_equal(policy(seen[0]), said[0])


@pytest.mark.parametrize(
    ("change", "words"),
    [({"scale": [1.0] * 26}, "must take 26 numbers"), ({"largest": None}, "spoils an entry")],
)
def test_a_card_that_does_not_fit_is_refused(change, words):
    with pytest.raises(InputError, match=words):
        TaskPolicy(CARD | change, weights(np.random.default_rng(0)))


def test_a_policy_of_another_task_is_refused(tmp_path):
    path = save_policy(CARD, weights(np.random.default_rng(0)), tmp_path / "mine.npz")
    with pytest.raises(InputError, match="a policy of WindHover, not of WindTrajectory"):
        make_pilot(str(path), "WindTrajectory")


@pytest.mark.parametrize("task", SIZES)
def test_shipped_policies_fly_better_than_hover(task):
    shipped = shipped_policies(task)
    assert "gru-0" in shipped
    known, hover = TASKS[task], make_pilot("hover", task)
    env = known.environment("base")
    seeds = range(910_000, 910_004)
    policy = make_pilot("gru-0", task)
    least, learned = (
        np.mean([fly_episode(env, one, k, decisions=known.decisions).rmse for k in seeds])
        for one in (hover, policy)
    )
    assert learned < 0.7 * least
    seen, size = SIZES[task]
    policy.reset()
    assert policy(np.zeros(seen, dtype=np.float32)).shape == (size,)
