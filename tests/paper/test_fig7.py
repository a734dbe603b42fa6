"""Tracking the fan, in a short form: two gains, one filter, three seeds."""

import json

import pytest

from windwrench.controllers import Hover
from windwrench.dynamics import InputError
from windwrench.evaluation.episodes import fly_episode
from windwrench.paper import fig7

SHORT = {
    "GAINS": (12.0, 36.0),
    "SHOWN_GAINS": (18.0,),
    "RISE_TIMES": (0.45,),
    "FAN_SPEEDS": (0.2,),
    "HALVINGS": 3,
    "REPEATS": 2,
}


@pytest.fixture(scope="module")
def result():
    with pytest.MonkeyPatch.context() as patch:
        for name, value in SHORT.items():
            patch.setattr(fig7, name, value)
        return fig7.run(3, lambda share: None)


def test_the_jet_is_caught_from_0_8_m(result):
    (capture,) = result.figures["capture"]
    assert capture["captured"] == 1.0
    assert 0.5 < capture["median_time_s"] < 6.0
    assert capture["rmse_last_10_s_m"] < 0.3


def test_a_moving_fan_is_followed_where_a_vehicle_that_hovers_stays_behind(result):
    (track,) = result.figures["tracking"]
    assert track["lost"] == 0.0
    assert track["rmse_m"] < 0.35
    assert track["share_within_fan_radius"] > 0.8
    env = fig7.make_env(0.45)
    env.fan_path = fig7.triangle(0.2)
    assert fly_episode(env, Hover(), 0).rmse > 0.5


def test_the_fastest_fan_grows_with_the_gain_and_stays_behind_the_bound(result):
    low, high = result.figures["fastest"]
    for row in (low, high):
        ends = row["held_share_of_bound_ci95"]
        assert ends[0] <= row["held_share_of_bound"] <= ends[1]
        assert len(row["held_m_s_by_search"]) == 2
    assert low["bound_m_s"] == pytest.approx(12.0 * result.figures["jet_largest_torque_Nm"])
    assert 0.6 * low["bound_m_s"] < low["held_m_s"] < 1.15 * low["bound_m_s"]
    assert low["held_m_s"] < high["held_m_s"]
    # lag alone costs little, noise costs the high gain much
    for row in (low, high):
        assert 0.85 * row["bound_m_s"] < row["calm_m_s"] < 1.15 * row["bound_m_s"]
        assert row["calm_sudden_m_s"] <= row["calm_m_s"]
    assert high["held_share_of_bound"] < 0.85
    alone = result.figures["held_share_of_bound_with_one_noise"]
    assert alone["disturbance"] < alone["sensor noise"]


def test_the_result_is_whole(result):
    json.dumps(result.figures)
    assert len({len(column) for column in result.data.values()}) == 1
    assert set(result.data["part"]) == {"capture", "tracking"}
    assert all(row.paper and row.here for row in result.comparison)


def test_a_fan_beyond_the_bound_is_lost_and_a_slow_one_held():
    env = fig7.make_env(0.45, noises=())
    assert fig7.holds(env, 18.0, fig7.ramp(0.3), 0)
    assert not fig7.holds(env, 18.0, fig7.ramp(0.7), 0)


def test_the_interval_is_student_s():
    low, high = fig7.interval([0.4, 0.5, 0.6, 0.5, 0.5])
    # a standard deviation of 0.0707 over five, 2.776 of its errors of the mean
    assert (low, high) == pytest.approx((0.5 - 0.0878, 0.5 + 0.0878), abs=1e-4)
    assert fig7.interval([0.3]) == (0.3, 0.3)
    assert fig7.interval([0.0, 0.0, 0.1])[0] == 0.0


def test_bad_input_is_refused():
    with pytest.raises(InputError, match="at least one seed"):
        fig7.run(0, lambda share: None)
