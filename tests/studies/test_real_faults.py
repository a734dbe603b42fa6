"""The study of real faults: its truth, its counts and its page."""

import numpy as np
import pytest

from windwrench.dynamics import InputError
from windwrench.identification.comparison.change import NOWHERE
from windwrench.studies.real_faults.page import write_page
from windwrench.studies.real_faults.study import drawn_changes, truth_of, wilson
from windwrench.studies.real_faults.trims import draw_change


def test_a_files_name_tells_the_place():
    assert truth_of("cut_propeller_M3_3mm__E8_log01.csv.gz") == "rotor 2 (rear-left)"
    assert truth_of("add_weight_W1_near_M3_M4__E8_log00.csv.gz") == "left"
    assert truth_of("normal_flight__E9_log00.csv.gz") == NOWHERE
    with pytest.raises(InputError, match="tells no place"):
        truth_of("payload__E9_log00.csv.gz")


def test_an_interval_is_wilsons():
    np.testing.assert_allclose(wilson(8, 10), [0.490, 0.943], atol=0.001)
    assert wilson(0, 0) == [0.0, 1.0]


def test_drawn_changes_are_as_they_say():
    """The balance of statics: a weight to the left asks more of the left rotors."""
    places = []
    for seed in range(60):
        after, before, place = draw_change(seed)
        places.append(place)
        if place == "left":
            assert (
                np.mean([t.shares[0] for t in after])
                > np.mean([t.shares[0] for t in before]) - 0.05
            )
    assert 15 < places.count(NOWHERE) < 45


def test_stated_probabilities_of_drawn_changes_are_kept():
    found = drawn_changes(80, 10_000, lambda *_: None)
    assert sum(one["count"] for one in found["bins"]) == 80
    for one in found["bins"]:
        if one["count"] >= 20:
            assert one["ci95"][0] - 0.05 < one["mean"] < one["ci95"][1] + 0.05
    assert found["sure_of_a_wrong_place"] <= 1


def test_the_page_is_written_from_results_alone(tmp_path):
    row = {
        "flight": "cut_propeller_M3_3mm__E8_log01",
        "truth": "rotor 2 (rear-left)",
        "place": NOWHERE,
        "probability": 0.6,
        "if_changed": "rotor 2 (rear-left)",
        "difference": [0.01, -0.01, 0.0, 0.02],
        "sure": False,
        "right": False,
        "right_if_changed": True,
        "sure_and_wrong": False,
    }
    fault = {
        "seed": 1,
        "event": "fault",
        "rotor": 2,
        "loss": 0.3,
        "likeliest": "2",
        "probability": 0.99,
        "sure": True,
        "named": 2,
        "onset_inside": True,
        "remaining_inside": False,
    }
    log = {
        "log": "a.ulg",
        "found": "rotor 4",
        "motor": "PX4 motor 1",
        "probabilities": {"rotor 4": 0.99, "nothing": 0.01},
        "onset_s": 3.0,
        "onset_ci95_s": [2.9, 3.1],
        "remaining": 0.1,
        "remaining_ci95": [0.0, 0.3],
        "commanded": {"motors": {"PX4 motor 1": 0.2}, "between_s": [2.95, 3.05]},
    }
    result = {
        "changes": 10,
        "flights": 2,
        "seed": 0,
        "commit": "abc",
        "version": "1",
        "crazypad": [row],
        "drawn_changes": drawn_changes(10, 0, lambda *_: None),
        "motor_faults": [log],
        "drawn_faults": {"rows": [fault]},
    }
    page = tmp_path / "real-faults.md"
    write_page(result, tmp_path / "real-faults" / "results.json", page)
    text = page.read_text(encoding="utf-8")
    assert "on 1 of 1 changed flights *nothing* is likelier" in text
    assert "PX4 motor 1 to 20 %, 2.950 to 3.050" in text
    assert "| 20 to 50 % | 1 of 1 (100 %" in text
