"""What a film says beside its picture."""

import numpy as np
import pytest

from windwrench.dynamics import load_vehicle
from windwrench.envs.captions import Caption, scale_of, with_caption
from windwrench.envs.replay import Flight, drawn_arm
from windwrench.envs.scene_shapes import ESTIMATED, TRUE


def caption(**changes):
    given = {
        "title": "a film",
        "time": 1.0,
        "force": np.array([0.3, 0.0, 0.0]),
        "torque_z": 0.01,
        "true_force": np.array([0.4, 0.0, 0.0]),
        "true_torque_z": 0.012,
        "lines": ("offset 0.10 m",),
        "pixels_per_metre": 200.0,
        "scales": (1.6, 25.0),
    }
    return Caption(**{**given, **changes})


def count(picture, mark):
    colour = np.round(255 * mark[:3]).astype(int)
    return np.count_nonzero(np.all(picture.astype(int) == colour, axis=2))


@pytest.mark.parametrize("size", [(540, 960), (240, 320)])
def test_true_and_estimated_have_a_colour_and_a_label(size):
    grey = np.full((*size, 3), 128, np.uint8)
    both, alone = (
        with_caption(grey, caption(**changes))
        for changes in ({}, {"true_force": None, "true_torque_z": None})
    )
    assert both.shape == grey.shape
    assert count(both, ESTIMATED) > 10
    assert count(both, TRUE) > count(both, ESTIMATED)  # wide and narrow, as the arrows
    assert count(alone, TRUE) == 0
    assert count(alone, ESTIMATED) > 10
    assert np.any(with_caption(grey, caption(time=2.0)) != both)
    assert np.any(with_caption(grey, caption(lines=("offset 0.20 m",))) != both)


def test_a_scale_is_a_round_length_that_fits():
    for pixels in (20.0, 133.0, 950.0):
        length = scale_of(pixels, 190.0)
        assert length * pixels <= 190.0
        assert length * pixels > 60.0
        assert length in (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)


def test_the_scale_in_a_picture_is_as_long_as_it_says():
    grey = np.full((540, 960, 3), 128, np.uint8)
    row = with_caption(grey, caption(pixels_per_metre=200.0))[-30:]
    dark = np.all(row == (28, 36, 48), axis=2)
    longest = max(np.count_nonzero(line) for line in dark)
    assert longest == pytest.approx(0.5 * 200.0, abs=8)


def test_a_small_vehicle_on_a_long_flight_is_drawn_larger():
    vehicle = load_vehicle("crazyflie")
    for length, times in ((0.1, 1.0), (3.0, 2.0)):
        position = np.column_stack([np.linspace(0.0, length, 20), np.zeros(20), np.ones(20)])
        force = np.zeros((20, 3))
        flight = Flight(np.arange(20.0), position, np.tile([1.0, 0, 0, 0], (20, 1)), force, force)
        larger = drawn_arm(flight, vehicle) / vehicle.arm_l
        assert larger == 1.0 if times == 1.0 else larger > times
