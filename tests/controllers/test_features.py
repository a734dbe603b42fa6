"""What a learned policy sees, and the seeds that it is trained on."""

import numpy as np
import pytest

from windwrench.controllers.features import Features
from windwrench.dynamics import InputError
from windwrench.evaluation.episodes import FIRST_TEST_SEED, benchmark_seeds
from windwrench.training.seeds import FIRST_VALIDATION_SEED, training_seed, validation_seeds


def test_what_is_mirrored_is_known():
    features = Features(("torque_z", "force_x", "path_y"), 2)
    np.testing.assert_array_equal(features.mirrored, [-1, 1, -1, -1, 1, -1])


@pytest.mark.parametrize(
    ("frame", "history", "scale", "words"),
    [
        ((), 1, (), "must name different"),
        (("torque_z", "torque_z"), 1, (), "must name different"),
        (("torque_z",), 0, (), "history must be at least 1"),
        (("torque_z",), 1, (0.0,), "positive numbers"),
        (("torque_z",), 1, (1.0, 1.0), "1 positive numbers"),
    ],
)
def test_features_that_cannot_be_are_named(frame, history, scale, words):
    with pytest.raises(InputError, match=words):
        Features(frame, history, scale)


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
    with pytest.raises(InputError, match="there are 100000 episodes"):
        validation_seeds(2, first=99_999)
