"""CrazyPAD flights: what is read, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from windwrench.dynamics import InputError, load_vehicle
from windwrench.dynamics.vehicle import MotorCurve
from windwrench.identification.logs.reading import read_log


@pytest.fixture
def write(tmp_path):
    def to_file(**given):
        t = 0.01 * np.arange(50)
        columns = {"t_s": t} | {f"motor_m{i}_0to65535": np.full(50, 1e4 * i) for i in range(1, 5)}
        columns |= {name: value for name, value in given.items() if value is not None}
        for name in (name for name, value in given.items() if value is None):
            del columns[name]
        path = tmp_path / "flight.csv"
        rows = np.column_stack(list(columns.values()))
        np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="")
        return path

    return to_file


def test_requests_become_commands_in_this_order_of_rotors(write):
    log = read_log(write(est_ax_g=np.full(50, 0.5), roll_deg=np.full(50, 90.0)), "crazypad")
    expected = np.array([4e4, 3e4, 2e4, 1e4]) / 65535.0
    np.testing.assert_allclose(log.command, np.tile(expected, (50, 1)))
    assert not log.has_pose
    assert not log.has_rotor_speeds
    assert log.vehicle == "crazyflie"
    np.testing.assert_allclose(log.extra["roll"], np.pi / 2)
    assert "onboard_acceleration" not in log.extra  # two of its three columns are missing


def test_a_motor_curve_turns_requests_into_speeds(write):
    vehicle = replace(load_vehicle("crazyflie"), motor_curve=MotorCurve((0.0, 0.2)))
    log = read_log(write(), "crazypad", vehicle)
    assert log.commanded
    np.testing.assert_allclose(np.square(log.rotor_speeds) * vehicle.k, 0.2 * log.command)


def test_what_is_no_request_is_refused(write):
    with pytest.raises(
        InputError,
        match=r"motor_m2_0to65535, row 1 .*70000; expected a motor command from 0 to 65535",
    ):
        read_log(write(motor_m2_0to65535=np.full(50, 7e4)), "crazypad")
    with pytest.raises(InputError, match=r"missing column.s. motor_m3_0to65535; expected those of"):
        read_log(write(motor_m3_0to65535=None), "crazypad")
    with pytest.raises(InputError, match=r"vbat_V, row 1 .* is empty or NaN"):
        read_log(write(vbat_V=np.full(50, np.nan)), "crazypad")
