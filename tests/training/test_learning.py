"""A policy learns the task from scratch: the check that most drone kits lack."""

import numpy as np
import pytest

from windwrench.evaluation.benchmark import fly_all
from windwrench.training.configuration import load_config

pytest.importorskip(
    "stable_baselines3", reason="stable_baselines3 is not installed: pip install 'windwrench[rl]'"
)
from windwrench.training.run import read_progress
from windwrench.training.train import train


def test_sac_learns_to_track_the_fan_in_four_thousand_decisions(tmp_path):
    config = load_config(
        "sac", ["steps=4000", "validation.every=1000", "validation.episodes=10", "checkpoint=4000"]
    )
    path = str(train(config, "base", 0, tmp_path))
    assert read_progress(tmp_path).steps == [1000, 2000, 3000, 4000]
    results = fly_all([path], ["base"], 20, seed=0, jobs=1)
    hover, oracle, learned = (
        np.mean([e.rmse for e in results[name, "base"]]) for name in ("hover", "oracle", path)
    )
    assert learned < hover - 0.5 * (hover - oracle)
    assert not any(e.lost for e in results[path, "base"])
