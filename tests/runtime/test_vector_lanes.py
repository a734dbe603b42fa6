"""Lanes do what single numbers do, each for itself."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from numpy.testing import assert_array_equal

from windwrench.runtime.vector_lanes import WIDTH, LaneRecord, all_of, any_of, choose, corners

SINGLE = np.dtype(
    [
        ("a", "f8"),
        ("b", "f8", (2,)),
        ("out", "f8", (12,)),
        ("gain", "f8"),
        ("count", "i8"),
        ("inner", [("more", "f8", (7,)), ("shift", "f8")]),
    ]
)
INNER = LaneRecord(SINGLE["inner"], ("more",), ("shift",))
RECORD = LaneRecord(SINGLE, ("a", "b", "out"), ("gain", "count"), {"inner": INNER})
TABLE = np.arange(12.0).reshape(3, 4) ** 2
_at = RECORD.at


@njit(error_model="numpy")
def work(f):
    """Everything that lanes can do."""
    a, b, out = f.a, f.b[0], f.out
    out[0], out[1], out[2], out[3] = a + b, a - b, a * b, a / b
    out[4] = -a
    out[5] = choose(a < b, a, 1.5)
    out[6] = choose((a <= b) | (b > 0.0), 1, math.sqrt(b))
    out[7] = choose((a >= b) & math.isfinite(a), f.gain * math.cos(a), math.sin(b))
    out[8] = max(a, b)
    total = 0.0
    for i in range(f.count):
        total += f.b[i]
        out[9] -= total
        out[10] += 2
    f.b[1:][0] = 3.0
    more, shift = f.inner.more, f.inner.shift
    finite = choose(math.isfinite(b), b, 0.0)  # of another, a single number has no floor
    more[0], more[1], more[2] = min(a, b), abs(a), math.floor(finite)
    more[3] = math.atan2(a, b) + shift
    more[4] = choose(a == b, 1.0, 0.0)
    inside = (abs(a) < 2.0) & (abs(b) < 3.0)
    row = choose(inside, math.floor(abs(a)), 0.0)
    column = choose(inside, math.floor(abs(b)), 0.0)
    first, after, below, across = corners(TABLE, row, column)
    more[5] = first + 1e3 * after + 1e6 * below + 1e9 * across
    more[6] = min(a, 0.5)
    if any_of(a > 5.0):
        out[11] = 1.0
    if all_of(a > 5.0):
        out[11] = 2.0


@njit
def work_at(address):
    work(_at(address))


@njit
def work_singly(records):
    for n in range(len(records)):
        work(records[n])


numbers = st.one_of(st.floats(-10, 10), st.sampled_from([0.0, -0.0, math.nan, math.inf, -math.inf]))


@settings(max_examples=60, deadline=None)
@given(
    a=st.lists(numbers, min_size=WIDTH, max_size=WIDTH),
    b=st.lists(numbers, min_size=WIDTH, max_size=WIDTH),
)
def test_each_lane_is_a_single_number(a, b):
    lanes = RECORD.zeros(1)
    singles = np.zeros(WIDTH, SINGLE)
    for records in (lanes, singles):
        records["gain"], records["count"] = 0.7, 2
        records["inner"]["shift"] = 0.25
    lanes["a"] = a
    singles["a"] = a
    lanes["b"][0, 0] = b
    singles["b"][:, 0] = b
    work_at(lanes.ctypes.data)
    work_singly(singles)
    assert_array_equal(lanes["b"][0].T, singles["b"])
    assert_array_equal(lanes["out"][0, :11].T, singles["out"][:, :11])
    assert_array_equal(lanes["inner"]["more"][0].T, singles["inner"]["more"])
    large = [x > 5.0 for x in a]
    assert set(lanes["out"][0, 11]) == {2.0 if all(large) else float(any(large))}


@pytest.mark.parametrize("count", [1, 3])
def test_memory_lies_where_lanes_may_be_loaded(count):
    for _ in range(20):
        records = RECORD.zeros(count)
        assert records.ctypes.data % (8 * WIDTH) == 0
        assert RECORD.dtype.itemsize % (8 * WIDTH) == 0
        records["gain"] = 2.0
        again = RECORD.like(records[:1].copy())
        assert again.ctypes.data % (8 * WIDTH) == 0
        assert again["gain"][0] == 2.0


def test_in_python_a_condition_is_one_truth():
    assert choose(True, 1, 2) == 1
    assert any_of(True)
    assert not all_of(False)
    assert corners(TABLE, 1.0, 2.0) == (36.0, 49.0, 100.0, 121.0)
