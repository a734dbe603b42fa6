import numpy as np
import pytest
from scipy.signal import butter, filtfilt
from scipy.spatial.transform import Rotation

from tests.support.data_paths import crazyswarm2_file
from windwrench.dynamics import InputError, load_vehicle
from windwrench.identification.logs.reading import read_log
from windwrench.identification.wrench_series import estimate_log

FLIGHTS = (100, 130, 140, 146, 160, 165, 170, 172, 176, 178, 201, 202, 204)
LOADED = (201, 202, 204)
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


def test_an_unknown_reader_is_told_all():
    with pytest.raises(
        InputError,
        match=r"unknown reader 'ros'; expected one of ardupilot_bin, .*px4_ulog, racer, rosbag",
    ):
        read_log("flight.bag", "ros")


# measured flights


@pytest.mark.measured
@pytest.mark.parametrize("number", FLIGHTS)
def test_measured_flights_read(number, vehicle):
    log = read_log(crazyswarm2_file(number), "crazyswarm2", vehicle)
    assert np.diff(log.t).max() < 0.025
    assert log.period == pytest.approx(0.004, rel=0.02)
    assert ("payload_position" in log.extra) == (number in LOADED)
    rate = log.valid.sum() / log.t[-1]
    assert 70 < rate < 100 if number in LOADED else log.valid.all()
    # torque commanded turns the vehicle, 50 ms later, and thrust pushes it where its z axis points:
    # signs and axes
    attitude = Rotation.from_euler("ZYX", log.extra["onboard_angles"][:, ::-1])
    b, a = butter(2, np.array([0.5, 10.0]) * 2 * log.period, "band")
    turning = np.gradient(filtfilt(b, a, log.gyro, axis=0), log.period, axis=0)
    torque = filtfilt(b, a, vehicle.rotor_wrench(log.rotor_speeds)[:, 1:], axis=0)
    b, a = butter(2, 3.0 * 2 * log.period)
    push = (
        filtfilt(b, a, vehicle.rotor_wrench(log.rotor_speeds)[:, :1], axis=0)
        * attitude.as_matrix()[:, :, 2]
    )
    acceleration = np.gradient(
        filtfilt(b, a, log.extra["onboard_velocity"], axis=0), log.period, axis=0
    )
    for axis, (lag, least) in enumerate(((12, 0.65), (12, 0.65), (7, 0.35))):
        assert np.corrcoef(turning[lag:, axis], torque[:-lag, axis])[0, 1] > least
        assert np.corrcoef(acceleration[50:-50, axis], push[50:-50, axis])[0, 1] > (
            0.7 if axis < 2 else 0.25
        )


@pytest.mark.measured
def test_a_measured_flight_has_a_sane_wrench(vehicle):
    log = read_log(crazyswarm2_file(201), "crazyswarm2", vehicle)
    series = estimate_log(log, vehicle)
    flying = series.t > 2.0
    # the controller lifts a vehicle of 0.0419 kg, payload and all; the preset's has 0.027 kg
    force = series.force[flying]
    assert force[:, 2].mean() == pytest.approx(-(0.0406 - vehicle.mass) * 9.81, abs=0.005)
    assert np.abs(force[:, :2]).max() < 0.02
    assert np.abs(series.torque[flying]).max() < 1e-3
    # the cable pulls towards the payload: the smoothed force goes with where that hangs, without a
    # delay
    force = estimate_log(log, vehicle, smooth=True).force[flying]
    lean = (log.extra["payload_position"] - log.extra["onboard_position"])[flying]
    for axis in range(2):
        assert np.corrcoef(lean[:, axis], force[:, axis])[0, 1] > 0.8
