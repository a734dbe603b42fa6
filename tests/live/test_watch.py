"""What a user is told of a stream and of a log whose poses are noisier or calmer than declared."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.commands.conftest import call, recorded
from tests.live.stream import VEHICLE, Pipeline, flight
from tests.live.test_pipeline import whole
from windwrench.estimator import UKFTuning, WrenchEstimate
from windwrench.estimator.noise_scale import noise_warning

__all__ = ["call"]  # a fixture


def shown(scales):
    """Noise of attitudes and positions as an estimate, or a series of them, says it."""
    return property(lambda estimate: np.ones((*np.shape(estimate.nis), 2)) * scales)


@pytest.mark.parametrize(
    ("scales", "file", "said"),
    [
        ((1.0, 1.0), True, ""),
        ((0.6, 1.9), True, ""),
        (
            (1.0, 2.3),
            True,
            "Position noise is 2.3 times the vehicle file's 1 mm: set mocap sigma_pos_m to 0.0023",
        ),
        (
            (0.2, 1.0),
            True,
            "Attitude noise is 0.2 times the vehicle file's 0.005 rad: set mocap sigma_att_rad to "
            "0.001",
        ),
        ((1.0, 3.0), False, "Position noise is 3 times the tuning's 1 mm: set position_noise to "),
        ((4.0, 3.0), True, "sigma_pos_m to 0.003. Attitude noise is 4 times"),
    ],
)
def test_the_words_say_what_to_set(scales, file, said):
    words = noise_warning(scales, UKFTuning.for_vehicle(VEHICLE), file)
    assert said in words
    assert bool(words) == bool(said)


@pytest.mark.parametrize(("scales", "warned"), [((1.0, 2.3), True), ((1.0, 1.0), False)])
def test_a_stream_warns_once_of_its_noise(monkeypatch, scales, warned):
    monkeypatch.setattr(WrenchEstimate, "noise_scales", shown(scales), raising=False)
    live = Pipeline().take(whole(flight()))
    assert_allclose(live.session.watch.noise_scales, scales)
    said = [line for line in live.tallies.news() if "noise" in line]
    assert len(said) == warned
    assert bool(live.session.watch.words) == warned


def test_a_burst_of_noise_is_no_word(monkeypatch):
    """It is the median of 5 s; 2 s are less than half of them."""
    live = Pipeline()
    now = [0.0]
    scales = property(lambda e: np.array([1.0, 3.0 if 3.0 < now[0] < 5.0 else 1.0]))
    monkeypatch.setattr(WrenchEstimate, "noise_scales", scales, raising=False)
    for sample in whole(flight()):
        now[0] = 1e-9 * sample.stamp
        live.take([sample])
    assert not live.tallies.news()


def test_a_log_with_another_noise_is_told(tmp_path, call, monkeypatch):
    log = recorded(tmp_path / "flight.csv", seconds=6)
    monkeypatch.setattr(WrenchEstimate, "noise_scales", shown((1.0, 2.5)), raising=False)
    code, out, said = call("estimate", log, "--no-tune", "--json")
    assert code == 0
    assert json.loads(out)["result"]["noise_scale"] == {"attitude": 1.0, "position": 2.5}
    assert "Position noise is 2.5 times the vehicle file's 1 mm" in " ".join(said.split())
