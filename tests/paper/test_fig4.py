import json

import numpy as np
import pytest

from windwrench.paper import fig4


@pytest.fixture(scope="module")
def result():
    shares = []
    outcome = fig4.run(2, shares.append, sweep=(0.5, 1.0))
    assert shares[-1] == 1.0
    return outcome


def test_the_requirement(result):
    assert result.figures["rise_within_bounds"]
    assert result.figures["lateral_within_bounds"]
    for row in result.figures["sweep"]:
        assert row["lateral_N"] < 0.08, row
        assert row["made_up_lateral_N"] < 0.03, row


def test_rise_time_follows_the_tuning_and_buys_noise(result):
    rows = result.figures["sweep"]
    for fast, slow in zip(rows[::2], rows[1::2], strict=True):
        assert slow["tuned_rise_s"] == 2 * fast["tuned_rise_s"]
        for name in ("force_rise_s", "torque_rise_s"):
            assert fast[name] == pytest.approx(0.5, abs=0.1)
            assert slow[name] == pytest.approx(1.0, abs=0.2)
        assert slow["force_std_N"] < fast["force_std_N"]
        assert slow["torque_std_Nm"] < fast["torque_std_Nm"]


def test_contract(result):
    json.dumps(result.figures, allow_nan=False)
    assert len({len(column) for column in result.data.values()}) == 1
    result.picture.canvas.draw()


def test_what_a_first_order_lag_shows_of_a_swing():
    time = np.arange(0.01, 20.0, 0.01)
    since = np.maximum(time - 7.0, 0.0)
    step, lag, rate = -0.52 * (1.0 - np.exp(-since / 0.4)), 0.4, 3.0
    shown = fig4.as_shown(time, step, np.sin(rate * since)[:, None])[:, 0]
    # of the lag's differential equation, from rest
    gain = 1.0 / (1.0 + (lag * rate) ** 2)
    expected = gain * (
        np.sin(rate * since) - lag * rate * (np.cos(rate * since) - np.exp(-since / lag))
    )
    np.testing.assert_allclose(shown, expected, atol=0.01)
    np.testing.assert_array_equal(shown[time < 7.0], 0.0)


def test_rise_time_of_a_first_order_lag():
    time = np.arange(0.01, 20.0, 0.01)
    response = -0.52 * np.where(time < 7.0, 0.0, 1.0 - np.exp(-(time - 7.0) / 0.4))
    assert fig4.rise_time(time, response) == pytest.approx(0.4 * np.log(9.0), abs=1e-3)
