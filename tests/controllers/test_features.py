"""What a learned policy sees, and the seeds that it is trained on."""

import numpy as np
import pytest

from windwrench.controllers.features import Features, History
from windwrench.dynamics import InputError
from windwrench.evaluation.episodes import FIRST_TEST_SEED, benchmark_seeds
from windwrench.training.seeds import FIRST_VALIDATION_SEED, training_seed, validation_seeds


def test_frames_are_scaled_columns_of_the_observation():
    features = Features(("torque_z", "force_x", "command"), 1, (0.03, 0.5, 1.0))
    observations = np.arange(16.0).reshape(2, 8)
    np.testing.assert_allclose(
        features.frames(observations * 0.01, {}),
        np.array([[0.05 / 0.03, 0.0, 0.07], [0.13 / 0.03, 0.16, 0.15]]),
        rtol=1e-6,
    )


def test_truth_comes_from_info():
    features = Features(("true_torque_z", "true_force_x"), 1, (1.0, 1.0))
    assert features.sources == {"torque", "force"}
    info = {"torque": np.array([[0.1, 0.2, 0.3]]), "force": np.array([[1.0, 2.0, 3.0]])}
    np.testing.assert_allclose(features.frames(np.zeros((1, 8)), info), [[0.3, 1.0]], rtol=1e-6)


def test_what_is_mirrored_is_known():
    features = Features(("torque_z", "force_x", "path_y"), 2)
    np.testing.assert_array_equal(features.mirrored, [-1, 1, -1, -1, 1, -1])


def test_a_history_is_oldest_first_and_starts_with_its_first_frame():
    history = History(Features(("torque_z",), 3), 2)
    history.restart(np.array([[1.0], [2.0]], dtype=np.float32), [0, 1])
    history.push(np.array([[3.0], [4.0]], dtype=np.float32))
    np.testing.assert_array_equal(history.flat(), [[1, 1, 3], [2, 2, 4]])
    history.restart(np.array([[9.0], [8.0]], dtype=np.float32), np.array([False, True]))
    np.testing.assert_array_equal(history.flat(), [[1, 1, 3], [8, 8, 8]])


def test_a_path_is_the_sum_of_the_velocities_since_the_start():
    features = Features(("path_y", "velocity_y"), 2)
    history = History(features, 2)

    def frames(*speeds):
        observations = np.zeros((2, 8))
        observations[:, 6] = speeds
        return features.frames(observations, {})

    history.restart(frames(0.5, 0.2), [0, 1])
    history.push(frames(0.3, -0.1))
    history.push(frames(0.1, 0.1))
    # 80 ms at 0.3 and 0.1 m/s; velocities are seen in halves of a m/s
    np.testing.assert_allclose(
        history.flat(), [[0.024, 0.6, 0.032, 0.2], [-0.008, -0.2, 0.0, 0.2]], atol=1e-7
    )
    history.restart(frames(0.4, 0.4), np.array([False, True]))
    np.testing.assert_allclose(history.flat()[:, 2], [0.032, 0.0], atol=1e-7)


@pytest.mark.parametrize(
    ("frame", "history", "scale", "words"),
    [
        (("torque",), 1, (), "unknown quantity"),
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
