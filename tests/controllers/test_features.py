"""What a learned policy sees, and the seeds that it is trained on."""

import numpy as np

from windwrench.controllers.features import Features
from windwrench.evaluation.episodes import FIRST_TEST_SEED, benchmark_seeds
from windwrench.training.seeds import FIRST_VALIDATION_SEED, training_seed, validation_seeds


def test_what_is_mirrored_is_known():
    features = Features(("torque_z", "force_x", "path_y"), 2)
    np.testing.assert_array_equal(features.mirrored, [-1, 1, -1, -1, 1, -1])


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
