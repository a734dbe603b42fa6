"""The map of the fan's jet, in a short form: one flight."""

import json

import numpy as np
import pytest

from windwrench.dynamics import InputError
from windwrench.paper import fig6


@pytest.fixture(scope="module")
def result():
    return fig6.run(1, lambda share: None)


def test_estimate_and_truth_agree_where_the_jet_is(result):
    assert result.figures["points_in_jet"] >= 20
    assert result.figures["correlation_force_x"] >= 0.95
    assert result.figures["correlation_torque_z"] >= 0.95
    # the disturbance that no flight of 5 s averages out still leaves a map of the fan
    assert result.figures["correlation_torque_z_with_jet_alone"] >= 0.95


def test_the_torque_is_antisymmetric_with_its_largest_near_half_a_metre(result):
    assert result.figures["torque_z_antisymmetry"] > 0.95
    assert 0.35 <= result.figures["profile_torque_peak_offset_m"] <= 0.6
    assert result.figures["profile_torque_peak_Nm"] == pytest.approx(
        result.figures["true_jet_torque_peak_Nm"], rel=0.2
    )


def test_the_page_says_that_the_peak_follows_from_the_fan(result):
    offsets = result.figures["true_jet_torque_peak_offset_m_by_fan_radius"]
    assert offsets == pytest.approx({"0.35": 0.38, "0.45": 0.47, "0.55": 0.56}, abs=0.006)
    assert any("0.38, 0.47, 0.56 m" in remark for remark in result.remarks)


def test_the_force_is_strong_on_the_axis_and_blows_away_from_the_fan(result):
    assert result.figures["profile_force_x_on_axis_N"] == pytest.approx(
        result.figures["true_force_x_on_axis_N"], abs=0.03
    )
    assert result.figures["profile_force_x_on_axis_N"] > 0.4
    assert result.figures["force_x_symmetry"] > 0.99


def test_the_position_loop_holds_the_vehicle_at_its_points(result):
    assert result.figures["hover_offset_rms_m"] < 0.1


def test_the_result_is_whole(result):
    json.dumps(result.figures)
    assert len({len(column) for column in result.data.values()}) == 1
    assert len(result.data["x"]) == 49 + 31
    assert all(row.paper and row.here for row in result.comparison)


def test_a_flight_repeats_bit_for_bit_and_bad_input_is_refused():
    points = np.array([[2.3, 0.0], [2.3, 0.5]])
    first, again = fig6.fly_points(points, 3, 0.1), fig6.fly_points(points, 3, 0.1)
    np.testing.assert_array_equal(first.estimate, again.estimate)
    assert np.any(fig6.fly_points(points, 4, 0.1).estimate != first.estimate)
    with pytest.raises(InputError, match="within 2 m"):
        fig6.fly_points(np.array([[1.0, 0.0], [4.0, 0.0]]), 0)
    with pytest.raises(InputError, match="at least one seed"):
        fig6.run(0, lambda share: None)
