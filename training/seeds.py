"""Seeds of episodes: training, validation and test have separate ranges."""

import numpy as np

from ..evaluation.episodes import FIRST_TEST_SEED
from ..runtime.errors import InputError

FIRST_VALIDATION_SEED = 900_000  # below it: training


def training_seed(seed: int, environment: int, episode: int) -> int:
    """Return the seed of a training run's episode, the same in any order of flights: 0 to
    ``FIRST_VALIDATION_SEED`` - 1.
    """
    words = np.random.SeedSequence((seed, environment, episode)).generate_state(1, np.uint64)
    # a Python number: NumPy 1 would take the remainder of a uint64 in floats, and seeds collide
    return int(words[0]) % FIRST_VALIDATION_SEED


def validation_seeds(episodes: int) -> list[int]:
    """Return the seeds of the first validation episodes.

    Raises:
        InputError: more than there are.
    """
    count = FIRST_TEST_SEED - FIRST_VALIDATION_SEED
    if not 0 < episodes <= count:
        raise InputError(f"validation: there are {count} episodes, got {episodes}")
    return list(range(FIRST_VALIDATION_SEED, FIRST_VALIDATION_SEED + episodes))
