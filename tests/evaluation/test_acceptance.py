"""The main job at full size: 40 paired episodes a scenario, on the benchmark's own seeds."""

import numpy as np
import pytest

from windwrench.evaluation.benchmark import fly_all
from windwrench.evaluation.leaderboard import leaderboard

CONTROLLERS = ["hover", "admittance", "ratio", "oracle"]


@pytest.fixture(scope="module")
def results():
    return fly_all(CONTROLLERS, ["static", "base"], 40, seed=0)


@pytest.mark.slow
def test_the_admittance_controller_holds_the_vehicle_in_the_jet_of_a_moving_fan(results):
    rows = {(row.scenario, row.controller): row for row in leaderboard(results, CONTROLLERS, 0)}
    base = rows["base", "admittance"]
    assert base.lost_fraction == 0.0
    assert base.score >= 0.75
    assert rows["base", "oracle"].rmse_m <= 0.08
    assert rows["base", "hover"].score == 0.0


@pytest.mark.slow
def test_it_comes_in_from_0_8_m_off_within_5_seconds(results):
    at_5_s = [episode.offset[62] for episode in results["admittance", "static"]]
    after = [np.median(episode.offset[62:]) for episode in results["admittance", "static"]]
    assert np.median(at_5_s) <= 0.15
    assert np.median(after) <= 0.15
    assert np.median([episode.offset[0] for episode in results["admittance", "static"]]) > 0.7
