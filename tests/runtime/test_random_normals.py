"""NumPy's unit normals in compiled code are those of its generators, in C and through Python."""

import ctypes

import numpy as np
import pytest

from windwrench.runtime.addresses import call_at
from windwrench.runtime.compiled import compiled_without_gil
from windwrench.runtime.random_normals import normals_in_c, normals_through_python


@compiled_without_gil
def fill(function, bits, out):
    call_at(function, bits, out.size, out.ctypes.data)


@pytest.mark.parametrize("count", [1, 49, 784])
@pytest.mark.parametrize("kind", [np.random.PCG64, np.random.MT19937, np.random.SFC64])
def test_they_are_numpy_s(kind, count):
    native, plain, expected = (np.random.Generator(kind(3)) for _ in range(3))
    in_c, through_python = normals_in_c(native), normals_through_python(plain, count)
    for _ in range(3):
        numbers, out = expected.standard_normal(count), np.zeros(count)
        fill(in_c.function, in_c.bits, out)
        np.testing.assert_array_equal(out, numbers)
        out[:] = 0.0
        fill(through_python.function, through_python.bits, out)
        drawn = (ctypes.c_double * count).from_address(through_python.fixed)
        np.testing.assert_array_equal(drawn, numbers)
        assert not out.any()  # they have a place of their own
    assert native.uniform() == plain.uniform() == expected.uniform()
