"""Normals that are drawn in compiled code are NumPy's, bit for bit."""

import numpy as np
import pytest

from windwrench.runtime import pcg_normals
from windwrench.runtime.compiled import compiled_without_gil
from windwrench.runtime.pcg_normals import draw_normals, pcg_state
from windwrench.runtime.random_normals import bits_address, normals_address


@compiled_without_gil
def fill(state, function, bits, out):
    draw_normals(state, function, bits, out)


@pytest.mark.parametrize("seed", [0, 7, 2**40])
def test_they_are_numpys_and_the_generator_goes_on(seed):
    ours, theirs = (np.random.default_rng(seed) for _ in range(2))
    out, block = np.zeros(100_000), np.zeros((49, 3))
    given = pcg_state(ours), normals_address(), bits_address(ours)
    assert given[0] != 0
    fill(*given, out)
    np.testing.assert_array_equal(out, theirs.standard_normal(out.size))
    assert ours.uniform() == theirs.uniform()
    fill(*given, block[:, 1])
    np.testing.assert_array_equal(block[:, 1], theirs.standard_normal(49))
    assert not block[:, [0, 2]].any()
    assert np.abs(out).max() > 3.66  # the tail was drawn from


def test_another_generator_has_none():
    assert pcg_state(np.random.Generator(np.random.MT19937(0))) == 0
    assert pcg_state(np.random.Generator(np.random.PCG64DXSM(0))) == 0


def test_a_numpy_of_another_make_is_noticed(monkeypatch):
    monkeypatch.setattr(pcg_normals, "_fill", lambda *given: given[-1].fill(0.0))
    assert not pcg_normals._is_numpys.__wrapped__()
