"""Small runs that a Ray cluster and this machine both do, and what must be the same of them."""

import numpy as np

# settings of a training run of seconds, with checkpoints in its middle
TINY = [
    "steps=240",
    "environments=2",
    "net=[8]",
    "learner.learning_starts=40",
    "learner.batch_size=16",
    "checkpoint=60",
    "validation.every=120",
    "validation.episodes=1",
]


def assert_same_runs(jobs, there, here, folder):
    """Hold runs done in ``folder``/there to those in ``folder``/here, byte for byte."""
    assert [r["run"] for r in there] == [r["run"] for r in here]
    assert [r["validation_rmse_m"] for r in there] == [r["validation_rmse_m"] for r in here]
    for job in jobs:
        for name in ("best.npz", "last.npz"):
            assert (folder / "there" / job.name / name).read_bytes() == (
                folder / "here" / job.name / name
            ).read_bytes()


def assert_same_flights(there, here):
    """Hold the episodes of one benchmark to those of another, number for number."""
    assert list(there) == list(here)
    for key, flown in here.items():
        for a, b in zip(flown, there[key], strict=True):
            np.testing.assert_array_equal(a.y, b.y)
            assert (a.rmse, a.seed, a.lost) == (b.rmse, b.seed, b.lost)
