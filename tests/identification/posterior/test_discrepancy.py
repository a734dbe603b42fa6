"""The dictionary's columns are of one standard deviation each, and stand on what they say."""

import numpy as np
import pytest

from windwrench.identification.posterior.causal_filter import Track
from windwrench.identification.posterior.discrepancy import DISCREPANCY, discrepancy_columns

WEIGHT, ARM = 4.0, 0.1
INERTIAS = np.array([0.4, 0.4, 0.4, 2e-3, 2e-3, 4e-3])


def track(n, rng):
    level = np.broadcast_to(np.eye(3), (n, 3, 3)).copy()
    return Track(
        rng.standard_normal((n, 3)),
        level,
        rng.standard_normal((n, 3)),
        rng.standard_normal((n, 3)),
        np.zeros((n, 6)),
        np.zeros((n, 6)),
        rng.standard_normal((n, 4)),
        np.zeros((n, 7)),
        np.zeros((n, 6)),
    )


def test_columns_are_of_a_share_of_the_weight():
    rng = np.random.default_rng(0)
    tracks = [track(300, rng), track(200, rng)]
    times = [np.arange(300) * 0.01, 5.0 + np.arange(200) * 0.01]
    found = discrepancy_columns(tracks, times, WEIGHT, ARM, INERTIAS)
    assert {group for group, _ in found} == {"velocity", "place", "time", "rotors"}
    for (_, name), pieces in found.items():
        assert [len(x) for x in pieces] == [300, 200]
        whole = np.concatenate(pieces)
        channel = int(name[-1])
        size = 1.0 if channel < 3 else DISCREPANCY.torque_arm * ARM
        assert whole[:, channel].std() == pytest.approx(WEIGHT * size / INERTIAS[channel])
        others = np.delete(whole, channel, axis=1)
        assert not others.any()  # the vehicle is level: a body axis is a world axis


def test_what_does_not_change_is_no_column():
    still = track(50, np.random.default_rng(1))
    still.velocity[:] = 0.0
    found = discrepancy_columns([still], [np.arange(50) * 0.01], WEIGHT, ARM, INERTIAS)
    assert not [name for group, name in found if group == "velocity"]
