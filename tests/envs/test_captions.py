"""What a film says beside its picture."""

import numpy as np
import pytest

from windwrench.envs.captions import Caption, with_caption
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
