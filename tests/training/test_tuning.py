"""Tuned gains of the designed laws."""

import numpy as np
import pytest
import yaml

from tests.support.outcomes import refused
from windwrench.controllers import CONTROLLERS, LAWS, make_controller
from windwrench.controllers.registry import tuned_gains
from windwrench.evaluation.tasks import TASKS
from windwrench.training.tune import RANGES, first_gains, keep_gains, tune


def test_tuned_laws_fly_with_the_gains_in_the_file():
    gains = tuned_gains()
    assert set(gains) == set(LAWS)
    for law, scenarios in gains.items():
        assert {"base", "fast"} <= set(scenarios) <= {"base", "fast", "wide"}
        for scenario, found in scenarios.items():
            controller = make_controller(
                f"{law}-tuned" if scenario == "base" else f"{law}-tuned-{scenario}"
            )
            assert {name: getattr(controller, name) for name in found["gains"]} == found["gains"]
            assert found["rmse_m"] <= found["default_rmse_m"]
            command = f"windwrench train tune --scenario {scenario} --set controller={law} "
            assert found["command"].startswith(command)
    assert {"admittance-tuned", "ratio-tuned-fast"} <= set(CONTROLLERS)


@pytest.mark.parametrize("task", TASKS)
def test_every_search_begins_inside_its_ranges(task):
    for law, ranges in RANGES[task].items():
        start = first_gains(task, law)
        TASKS[task].laws[law](**start)
        assert all(low <= start[name] <= high for name, (low, high) in ranges.items())


def test_a_search_finds_gains_no_worse_than_the_default_and_keeps_the_others(tmp_path):
    pytest.importorskip("optuna", reason="pip install 'windwrench[rl]'")
    other = tune("admittance", "base", trials=2, episodes=1, task="FanTracking2D")
    assert other["rmse_m"] <= other["default_rmse_m"]
    keep_gains(other, tmp_path / "tuned.yaml", "the command")
    kept = yaml.safe_load((tmp_path / "tuned.yaml").read_text(encoding="utf-8"))
    assert kept["FanTracking2D"]["admittance"]["gains"].keys() == {"gain", "gain_z"}
    found = tune("admittance", "static", trials=2, episodes=2, seed=1)
    assert found == tune("admittance", "static", trials=2, episodes=2, seed=1)
    assert found["rmse_m"] <= found["default_rmse_m"]
    path = tmp_path / "tuned.yaml"
    path.write_text("ratio: {base: {gains: {gain: 5.0}}}\n", encoding="utf-8")
    keep_gains(found, path, "the command")
    kept = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert kept["ratio"]["base"]["gains"]["gain"] == 5.0
    assert kept["admittance"]["static"]["gains"]["gain"] == pytest.approx(
        found["gains"]["gain"], rel=1e-3
    )
    assert np.isfinite(kept["admittance"]["static"]["rmse_m"])
    path.write_text("- 1\n", encoding="utf-8")
    with refused(r"tuned.yaml: expected laws"):
        keep_gains(found, path, "the command")
