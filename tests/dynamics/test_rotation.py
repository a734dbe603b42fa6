"""The core's rotations against scipy's, over drawn quaternions."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.linalg import norm
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from windwrench import _core
from windwrench.dynamics.rotation import matrix_of

numbers = st.floats(-1.0, 1.0, allow_nan=False, width=64)
quaternions = (
    st.tuples(numbers, numbers, numbers, numbers)
    .map(np.array)
    .filter(lambda q: norm(q) > 0.05)
    .map(lambda q: q / norm(q))
)


def scipy_of(q):
    return Rotation.from_quat(q, scalar_first=True)


def call(function, *arguments, shape=4):
    out = np.full(shape, np.nan)
    function(*arguments, out)
    return out


def mrp_of(rotation):
    """axis * tan(angle / 4), from the rotation vector."""
    vector = rotation.as_rotvec()
    angle = norm(vector)
    return np.zeros(3) if angle == 0 else vector / angle * np.tan(angle / 4)


@given(quaternions)
def test_the_matrix_takes_body_to_world(q):
    assert_allclose(matrix_of(q), scipy_of(q).as_matrix(), atol=1e-14)
    assert_allclose(matrix_of(-q), matrix_of(q), atol=0)


@given(quaternions)
def test_an_mrp_goes_there_and_back_whatever_the_quaternion_s_sign(q):
    for sign in (1.0, -1.0):
        rho = call(_core.attitude_error, sign * q, np.array([1.0, 0.0, 0.0, 0.0]), shape=3)
        assert norm(rho) <= 1 + 1e-12
        back = call(_core.quaternion_of, rho)
        assert back[0] >= -1e-15
        assert_allclose(scipy_of(back).as_matrix(), scipy_of(q).as_matrix(), atol=1e-13)


@given(quaternions, quaternions)
def test_the_attitude_error_stands_in_the_world_frame(q, reference):
    error = scipy_of(q) * scipy_of(reference).inv()
    if error.magnitude() > np.pi - 1e-6:
        return  # half a turn: two axes are right
    expected = mrp_of(error)
    for sign in (1.0, -1.0):
        rho = call(_core.attitude_error, sign * q, reference, shape=3)
        assert_allclose(rho, expected, atol=1e-12)
    # turning the reference by the error from the left gives q
    again = call(_core.multiply, call(_core.quaternion_of, expected), reference)
    assert_allclose(scipy_of(again).as_matrix(), scipy_of(q).as_matrix(), atol=1e-12)


@given(quaternions, st.tuples(numbers, numbers, numbers), st.floats(0.01, 6.0))
def test_a_turn_of_any_size_is_the_exponential_of_its_vector(q, axis, time):
    turned = call(_core.turn_body, q, np.array(axis), time)
    expected = scipy_of(q) * Rotation.from_rotvec(time * np.array(axis))
    assert_allclose(scipy_of(turned).as_matrix(), expected.as_matrix(), atol=1e-14)


@given(quaternions, st.tuples(numbers, numbers, numbers), st.floats(1e-12, 1e-3))
def test_turning_by_next_to_nothing_loses_no_digits(q, axis, angle):
    turned = call(_core.turn_body, q, np.array(axis), angle)
    change = call(_core.multiply, q * [1, -1, -1, -1], turned)
    assert_allclose(change[1:], 0.5 * angle * np.array(axis), rtol=1e-3, atol=1e-15)
