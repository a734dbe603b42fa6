import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from windwrench.dynamics import InputError, load_vehicle
from windwrench.identification.logs.reading import read_log

ONBOARD = (
    "est_x_m",
    "est_y_m",
    "est_z_m",
    "est_vx_mps",
    "est_vy_mps",
    "est_vz_mps",
    "roll_rad",
    "pitch_rad",
    "yaw_rad",
    "omega_x_radps",
    "omega_y_radps",
    "omega_z_radps",
    "thrust_cmd_N",
    "torque_cmd_x_Nm",
    "torque_cmd_y_Nm",
    "torque_cmd_z_Nm",
)
TRACKED = (
    "mocap_x_m",
    "mocap_y_m",
    "mocap_z_m",
    "payload_x_m",
    "payload_y_m",
    "payload_z_m",
    "payload_vx_mps",
    "payload_vy_mps",
    "payload_vz_mps",
)


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle("crazyflie")


@pytest.fixture
def write(tmp_path):
    def to_file(count=40, columns=ONBOARD, **given):
        t = 0.004 * np.arange(count)
        values = {
            "t_s": t,
            **{name: np.zeros(count) for name in columns},
            "thrust_cmd_N": np.full(count, 0.3),
        }
        values |= {
            name: value * np.ones(count) for name, value in given.items() if value is not None
        }
        names = [name for name in values if given.get(name, 0.0) is not None]
        path = tmp_path / "log.csv"
        rows = np.column_stack([values[name] for name in names])
        path.write_text(
            "\n".join([",".join(names), *(",".join(f"{x:.9g}" for x in row) for row in rows)])
            + "\n"
        )
        return path

    return to_file


def test_commands_become_turn_rates(write, vehicle):
    path = write(torque_cmd_x_Nm=1e-3, torque_cmd_y_Nm=-5e-4, torque_cmd_z_Nm=1e-4)
    log = read_log(path, "crazyswarm2", vehicle)
    np.testing.assert_allclose(
        vehicle.rotor_wrench(log.rotor_speeds[7]), [0.3, 1e-3, -5e-4, 1e-4], rtol=1e-9
    )
    np.testing.assert_allclose(
        log.rotor_speeds[7], vehicle.rotor_speeds(0.3, np.array([1e-3, -5e-4, 1e-4]))
    )
    assert any(
        "inverse of the rotor mixing of crazyflie, clipped at zero" in note for note in log.notes
    )
    assert log.valid.all()
    assert log.voltage is None


def test_commands_out_of_reach_are_clipped_and_counted(write, vehicle):
    pull = np.zeros(40)
    pull[5:8] = 0.02
    log = read_log(write(torque_cmd_x_Nm=pull), "crazyswarm2", vehicle)
    assert log.rotor_speeds.min() == 0.0
    assert log.rotor_speeds.max() <= vehicle.omega_max
    assert any("commands of 3 sample(s)" in note for note in log.notes)


def test_attitude_turns_about_z_then_y_then_x(write, vehicle):
    log = read_log(write(roll_rad=0.3, pitch_rad=-0.2, yaw_rad=1.1), "crazyswarm2", vehicle)
    about = Rotation.from_rotvec
    expected = about([0, 0, 1.1]) * about([0, -0.2, 0]) * about([0.3, 0, 0])
    turn = Rotation.from_quat(log.quaternion[0, [1, 2, 3, 0]])
    assert (expected.inv() * turn).magnitude() < 1e-8


def test_held_positions_are_no_measurements(write, vehicle):
    held = np.repeat(np.arange(14.0), 3)[:40]
    path = write(
        columns=(*ONBOARD, *TRACKED), mocap_y_m=0.01 * held, payload_z_m=0.5, payload_vx_mps=0.1
    )
    log = read_log(path, "crazyswarm2", vehicle)
    np.testing.assert_array_equal(np.flatnonzero(log.valid), np.arange(0, 40, 3))
    np.testing.assert_allclose(log.position[3], [0, 0.01, 0])
    assert np.isnan(log.position[1]).all()
    assert any("26 of 40 rows repeat" in note for note in log.notes)
    # the attitude of the rows between is not lost
    assert np.isfinite(log.extra["onboard_angles"]).all()
    np.testing.assert_array_equal(log.extra["payload_position"], np.tile([0, 0, 0.5], (40, 1)))
    np.testing.assert_array_equal(log.extra["payload_velocity"][:, 0], 0.1)
    assert log.extra["commanded_thrust"].shape == (40,)


def test_stray_samples_are_dropped(write, vehicle):
    t = 0.004 * np.arange(40)
    t[5:] += 0.7
    log = read_log(write(t_s=t, est_x_m=np.arange(40.0)), "crazyswarm2", vehicle)
    assert len(log.t) == 35
    assert log.t[0] == 0.0
    assert log.position[0, 0] == 5.0
    assert all(len(column) == 35 for column in log.extra.values())
    assert any("dropped 5 stray sample(s) before a gap of 0.7" in note for note in log.notes)
    t = 0.004 * np.arange(40)
    t[30:] += 0.7
    log = read_log(write(t_s=t), "crazyswarm2", vehicle)  # a gap in the flight is no such thing
    assert len(log.t) == 40
    assert any("1 gap(s) in time" in note for note in log.notes)


def test_bad_logs_are_named(write, tmp_path, vehicle):
    with pytest.raises(
        InputError,
        match=r"log.csv: missing column.s. pitch_rad, torque_cmd_y_Nm; expected those of a crazysw",
    ):
        read_log(write(pitch_rad=None, torque_cmd_y_Nm=None), "crazyswarm2", vehicle)
    with pytest.raises(InputError, match=r"column thrust_cmd_N, row 1 .line 2. is empty or NaN"):
        read_log(write(thrust_cmd_N=np.nan), "crazyswarm2", vehicle)
    with pytest.raises(InputError, match=r"column t, row 2 .line 3.: 0 s repeats"):
        read_log(write(t_s=0.0), "crazyswarm2", vehicle)
    assert "reader crazyswarm2" in read_log(write()).source  # known by its columns
    with pytest.raises(InputError, match=r"absent.csv: cannot be read"):
        read_log(tmp_path / "absent.csv", "crazyswarm2")
