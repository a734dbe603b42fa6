"""The motion that a log shows, in unbroken pieces."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.flown import recorded
from windwrench.dynamics import InputError
from windwrench.identification.motion.signals import log_signals


def test_a_gap_ends_a_piece_and_a_lost_sample_does_not():
    log = recorded(seconds=12.0)
    valid = np.ones(len(log.t), dtype=bool)
    valid[500:503] = False
    valid[1200:1300] = False
    pieces = log_signals(replace(log, valid=valid))
    assert [round(piece.t[-1] - piece.t[0], 1) for piece in pieces] == [6.0, 5.5]
    with pytest.raises(InputError, match="3 s"):
        log_signals(replace(log, valid=np.arange(len(log.t)) < 300))
