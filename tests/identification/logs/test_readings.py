"""Readings of a flight's columns: a sentence's advice is what the reading does."""

import re

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from windwrench.identification.logs.readings import DECLARED, log_readings, rotations

POSES = [r for r in log_readings(has_pose=True) if r.moves != DECLARED.moves and r.length == "m"]


def taken(reading, what, columns):
    """The columns combined as the sentence says; unchanged where it says nothing of them."""
    found = re.search(rf"(?:0\.7071 )?(\([^()]*\)) as the {what}", reading.says)
    text = found[1] if found else f"({', '.join(columns)})"
    return np.array(eval(text, {}, columns))  # names of columns and signs alone


@pytest.mark.parametrize("first", range(0, len(POSES), 10))
def test_the_advice_of_a_sentence_makes_the_pose_that_the_reading_means(first):
    """90 ways to write a pose, each undone by its own advice."""
    rng = default_rng(first)
    for reading in POSES[first : first + 10]:
        position = rng.standard_normal(3)
        quaternion = Rotation.random(None, rng).as_quat()
        columns = dict(zip(("px", "py", "pz"), position, strict=True))
        assert_allclose(taken(reading, "position", columns), reading.frames.position @ position)
        columns = dict(zip(("qw", "qx", "qy", "qz"), quaternion, strict=True))
        made = Rotation.from_quat(taken(reading, "quaternion", columns), scalar_first=True)
        meant = rotations(quaternion[None], reading)[1][0]
        assert (made.inv() * meant).magnitude() < 1e-6


def test_every_reading_of_a_log_says_something_of_its_own():
    """No two readings share a sentence, and the one as declared has nothing to say."""
    for has_pose in (True, False):
        declared, *others = log_readings(has_pose)
        assert declared.says == ""
        said = [reading.says for reading in others]
        assert len(set(said)) == len(said)
        assert all(said)
