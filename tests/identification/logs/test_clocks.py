"""Times of a recording: wrong stamps, late rows, rollovers, and a file of two boots."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.support.dataflash_writer import dataflash, imu, parm, rcou
from tests.support.outcomes import noted, refused
from windwrench.identification.logs.channels import ROLLOVER, ChannelGroup, in_order, on_one_clock
from windwrench.identification.logs.reading import read_log

T = 0.02 * np.arange(600)


def stamped(changes):
    t = T.copy()
    for row, time in changes.items():
        t[row] = time
    return t


@pytest.mark.parametrize(
    "wrong",
    [
        {100: T[100] + 40.0},
        {100: 1e12},
        {100: -1e12},
        {100: np.nan},
        {300: T[100] + 1e-3},
        {599: T[599] + 40.0},
        {0: T[0] - 40.0},
        {200: T[199]},
        {100: T[100] + 9.0, 101: T[101] + 9.0, 350: -3.0},
    ],
)
def test_a_wrong_stamp_costs_its_sample(wrong):
    rows, late = in_order(stamped(wrong))
    assert late == 0
    assert set(np.arange(600)) - set(rows.tolist()) == set(wrong)


def test_rows_that_were_written_late_are_sorted_in():
    order = np.arange(600)
    order[[100, 101]] = order[[101, 100]]
    order[[300, 303]] = order[[303, 300]]
    rows, late = in_order(T[order])
    assert late > 0
    assert np.array_equal(T[order][rows], T)


def test_a_clock_of_32_bits_goes_on_after_its_rollover():
    t = np.mod(T + ROLLOVER - 5.0, ROLLOVER)
    (found,), notes = on_one_clock("log", [ChannelGroup(t, {"x": T})])
    assert_allclose(np.diff(found.t), 0.02, atol=1e-9)
    assert any("rolled over" in note for note in notes)


def boots():
    """A DataFlash log of two boots, of 4 and 8 s; the commands of the second are higher."""
    t = np.concatenate([T[:200] + 1.0, T[:400] + 0.5])
    name, letters, columns = rcou(t)
    high = np.arange(600) >= 200
    columns = {
        key: [v + 50 * h for v, h in zip(values, high, strict=True)] if key != "TimeUS" else values
        for key, values in columns.items()
    }
    return dataflash([parm(), imu(t), (name, letters, columns)])


def test_of_two_boots_the_longest_is_read_or_the_one_that_is_asked_for(tmp_path):
    path = tmp_path / "two.BIN"
    path.write_bytes(boots())
    log = read_log(path)
    assert len(log.t) == 400
    assert noted(log, "2 pieces of 3.98, 7.98 s; the longest, piece 2, was read")
    first = read_log(path, piece=1)
    assert len(first.t) == 200
    assert first.command.mean() < log.command.mean() - 0.04
    assert noted(first, "piece 1, was read")
    with refused(r"two\.BIN: piece 3: it has 2; expected 1 to 2"):
        read_log(path, piece=3)
