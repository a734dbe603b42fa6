"""The accelerometer's bias: three numbers a flight, known apart from everything else."""

import numpy as np

from windwrench.identification.inference.sensor_bias import (
    bias,
    bias_columns,
    biases,
    flight_and_axis,
    is_bias,
)


def test_each_flight_has_three():
    columns = bias_columns(2)
    assert len(set(columns)) == 6
    assert all(map(is_bias, columns))
    assert {flight_and_axis(name) for _, name in columns} == {
        (flight, axis) for flight in (0, 1) for axis in (0, 1, 2)
    }
    assert not is_bias(("", "rotor_time_offset"))
    assert not is_bias(("mass", columns[0][1]))


def test_a_setting_holds_them_by_flight_and_axis():
    names = {flight_and_axis(name): name for _, name in bias_columns(2)}
    setting = {"": {names[1, 2]: 0.3, "rotor_time_offset": 0.001}, "mass": {"dm": 0.1}}
    np.testing.assert_array_equal(bias(setting, 1), [0.0, 0.0, 0.3])
    np.testing.assert_array_equal(bias(setting, 0), np.zeros(3))
    assert biases(setting) == {"": {names[1, 2]: 0.3}}
    assert biases({"mass": {"dm": 0.1}}) == {}
