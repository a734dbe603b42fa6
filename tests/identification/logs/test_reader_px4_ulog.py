import sys
from dataclasses import replace

import numpy as np
import pytest

from tests.support.autopilot_flight import (
    FLIP,
    OURS,
    PX4,
    assert_inertial,
    assert_motion,
    growth,
    inertial,
    motion,
    ned,
)
from tests.support.ulog_writer import ulog_bytes
from windwrench.dynamics import InputError, load_vehicle
from windwrench.dynamics.vehicle import MotorCurve
from windwrench.identification.logs.reading import read_log

pytest.importorskip("pyulog", reason="pyulog is not installed: pip install 'windwrench[logs]'")


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle("ardrone2")


def stamps(t):
    return np.round(1e6 * (t + 10.0)).astype(np.uint64)


def odometry(t, new=True):
    position, turn = ned(t)
    head = {"uint64_t timestamp": stamps(t + 0.02), "uint64_t timestamp_sample": stamps(t)}
    if new:
        return head | {
            "uint8_t pose_frame": np.full(len(t), 2),
            "float position": position,
            "float q": turn.as_quat(scalar_first=True),
        }
    xyz = {f"float {axis}": position[:, i] for i, axis in enumerate("xyz")}
    return head | {
        "uint8_t local_frame": np.full(len(t), 0),
        **xyz,
        "float q": turn.as_quat(scalar_first=True),
    }


def esc(t, speeds=PX4, **functions):
    rpm = np.multiply.outer(growth(t), speeds) * 30.0 / np.pi
    fields = {"uint64_t timestamp": stamps(t)}
    for i in range(4):
        fields[f"int32_t esc[{i}].esc_rpm"] = np.round(rpm[:, i]).astype(int)
        if functions:
            fields[f"uint8_t esc[{i}].actuator_function"] = np.full(len(t), functions[f"f{i}"])
    return fields


def onboard(t):
    position, _ = ned(t)
    fast = np.linspace(t[0] - 0.1, t[-1] + 0.1, 4 * len(t))
    return {
        "vehicle_local_position": {
            "uint64_t timestamp": stamps(t),
            "uint64_t timestamp_sample": stamps(t),
            **{f"float {axis}": position[:, i] for i, axis in enumerate("xyz")},
            "bool xy_valid": np.ones(len(t), bool),
            "bool z_valid": np.ones(len(t), bool),
        },
        "vehicle_attitude": {
            "uint64_t timestamp": stamps(fast),
            "float q": ned(fast)[1].as_quat(scalar_first=True),
        },
    }


def sensor_combined(t):
    gyro, force = inertial(t)
    return {
        "uint64_t timestamp": stamps(t),
        "float gyro_rad": gyro @ FLIP,
        "float accelerometer_m_s2": force @ FLIP,
    }


@pytest.fixture
def t():
    return 0.01 * np.arange(200)


def wide(t):
    return np.arange(t[0] - 0.5, t[-1] + 0.5, 0.004)


@pytest.fixture
def write(tmp_path):
    def to_file(topics, parameters=None):
        path = tmp_path / "flight.ulg"
        path.write_bytes(ulog_bytes(topics, parameters))
        return path

    return to_file


@pytest.mark.parametrize("topic", ["vehicle_mocap_odometry", "vehicle_visual_odometry"])
@pytest.mark.parametrize("new", [True, False])
def test_motion_capture_and_turn_rates(write, t, topic, new, vehicle):
    path = write(
        {
            topic: odometry(t, new),
            "esc_status": esc(wide(t)),
            **onboard(t[::3]),
            "battery_status": {
                "uint64_t timestamp": stamps(wide(t)[::25]),
                "float voltage_v": 12.0 - 0.1 * wide(t)[::25],
            },
        }
    )
    log = read_log(path, "px4_ulog", vehicle)
    assert_motion(log, t)
    np.testing.assert_allclose(log.rotor_speeds, np.multiply.outer(growth(t), OURS), atol=0.06)
    np.testing.assert_allclose(log.voltage, 12.0 - 0.1 * t, atol=1e-5)
    assert f"pose: {topic}" in log.notes
    assert any("y west" in note for note in log.notes)
    assert any("3, 2, 4, 1" in note for note in log.notes)


def test_inertial_sensors_come_in_the_kits_axes(write, t, vehicle):
    times = wide(t)
    fields = sensor_combined(times)
    topics = {"vehicle_mocap_odometry": odometry(t), "esc_status": esc(times)}
    log = read_log(write(topics | {"sensor_combined": fields}), "px4_ulog", vehicle)
    assert_inertial(log, log.t)
    # half a second in which nothing was read stays empty
    lost = (times > 0.7) & (times < 1.2)
    fields = {name: column[~lost] for name, column in fields.items()}
    log = read_log(write(topics | {"sensor_combined": fields}), "px4_ulog", vehicle)
    missing = np.isnan(log.gyro).all(axis=1)
    assert 48 <= missing.sum() <= 51
    assert read_log(write(topics), "px4_ulog", vehicle).gyro is None


def test_level_and_facing_north_is_the_unit_quaternion(write, t, vehicle):
    ones = np.ones((len(t), 1))
    still = odometry(t) | {"float q": ones * [1.0, 0, 0, 0], "float position": ones * [1.0, 2, -3]}
    log = read_log(
        write({"vehicle_mocap_odometry": still, "esc_status": esc(wide(t))}), "px4_ulog", vehicle
    )
    np.testing.assert_allclose(log.quaternion[0], [1, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(log.position[0], [1, -2, 3], atol=1e-12)


def test_the_onboard_pose_where_there_is_no_other(write, t, vehicle):
    log = read_log(write({"esc_status": esc(wide(t)), **onboard(t)}), "px4_ulog", vehicle)
    assert_motion(log, t, atol=1e-5)
    assert any("onboard filter's" in note for note in log.notes)


def test_odometry_without_attitude_takes_the_onboard_one(write, t, vehicle):
    bare = odometry(t) | {"float q": np.full((len(t), 4), np.nan)}
    log = read_log(
        write({"vehicle_visual_odometry": bare, "esc_status": esc(wide(t)), **onboard(t)}),
        "px4_ulog",
        vehicle,
    )
    assert_motion(log, t, atol=1e-5)
    assert "pose: vehicle_visual_odometry" in log.notes
    assert any("attitude the onboard filter's" in note for note in log.notes)


def test_lost_positions_are_not_valid(write, t, vehicle):
    lossy = odometry(t)
    lossy["float position"][50:60] = np.nan
    log = read_log(
        write({"vehicle_mocap_odometry": lossy, "esc_status": esc(wide(t))}), "px4_ulog", vehicle
    )
    np.testing.assert_array_equal(np.flatnonzero(~log.valid), np.arange(50, 60))


def test_esc_functions_and_rotor_places_renumber_the_motors(write, t, vehicle):
    # ESC 1 drives motor 4 and so on; and motors 1 to 4 sit front-left, front-right, rear-right,
    # rear-left
    places = {"CA_ROTOR_COUNT": 4}
    for i, (x, right) in enumerate([(0.1, -0.1), (0.1, 0.1), (-0.1, 0.1), (-0.1, -0.1)]):
        places |= {f"CA_ROTOR{i}_PX": x, f"CA_ROTOR{i}_PY": right}
    motors = OURS[[0, 3, 2, 1]]
    path = write(
        {
            "vehicle_mocap_odometry": odometry(t),
            "esc_status": esc(wide(t), motors[::-1], f0=104, f1=103, f2=102, f3=101),
        },
        places,
    )
    log = read_log(path, "px4_ulog", vehicle)
    np.testing.assert_allclose(log.rotor_speeds[0], OURS, atol=0.06)


def relative(vehicle):
    return np.array([0.40, 0.42, 0.44, 0.46]), np.array([0.46, 0.42, 0.40, 0.44])  # ours, PX4's


def assert_scaled(log, ours, vehicle):
    """The vertical part of a thrust that stays the same carries the weight on the mean."""
    thrust = vehicle.k * log.rotor_speeds**2
    up = motion(log.t)[1].as_matrix()[:, 2, 2]
    flying = thrust.sum(axis=1) > 0.5 * thrust.sum(axis=1).max()
    vertical = (thrust.sum(axis=1) * up)[flying]
    np.testing.assert_allclose(np.mean(vertical), vehicle.weight, rtol=1e-3)
    np.testing.assert_allclose(thrust[100] / thrust[100].sum(), ours / ours.sum(), rtol=1e-5)
    assert any("vertical thrust in flight is the weight of ardrone2" in note for note in log.notes)
    assert log.commanded


def test_relative_thrust_is_scaled_to_the_weight(write, t, vehicle):
    ours, theirs = relative(vehicle)
    at = wide(t)
    control = np.full((len(at), 12), np.nan)
    control[:, :4] = theirs
    control[:20, :4] = np.nan  # disarmed
    path = write(
        {
            "vehicle_mocap_odometry": odometry(t),
            "esc_status": esc(at, 0 * PX4),
            "actuator_motors": {"uint64_t timestamp": stamps(at), "float control": control},
        },
        {"THR_MDL_FAC": 0.3},
    )
    assert_scaled(read_log(path, "px4_ulog", vehicle), ours, vehicle)
    alone = read_log(path, "px4_ulog")  # without a vehicle commands stay what they are
    assert not alone.has_rotor_speeds
    np.testing.assert_allclose(alone.command[100], ours, rtol=1e-6)
    curve = MotorCurve(thrust=(0.0, 1.0, 2.0), voltage_exponent=0.0, command=(0.0, 1.0))
    stated = read_log(path, None, replace(vehicle, motor_curve=curve))
    np.testing.assert_allclose(
        vehicle.k * stated.rotor_speeds[100] ** 2, ours + 2.0 * ours**2, rtol=1e-5
    )


def test_a_tilted_flight_needs_more_thrust_than_its_weight(write, t, vehicle):
    """The accelerometer says how much: here half as much again."""
    at = wide(t)
    force = np.tile([0.0, 0.0, -1.5 * vehicle.gravity], (len(at), 1))  # forward, right, down
    path = write(
        {
            "vehicle_mocap_odometry": odometry(t),
            "sensor_combined": {
                "uint64_t timestamp": stamps(at),
                "float gyro_rad": np.sin(np.multiply.outer(at, [1.0, 2.0, 3.0])),
                "float accelerometer_m_s2": force + 1e-3 * np.sin(at)[:, None],
            },
            "actuator_motors": {
                "uint64_t timestamp": stamps(at),
                "float control": np.full((len(at), 12), 0.5),
            },
        }
    )
    with pytest.warns(UserWarning, match="gyro|gx"):
        log = read_log(path, None, vehicle)
    thrust = np.sum(vehicle.k * log.rotor_speeds**2, axis=1)
    np.testing.assert_allclose(thrust, 1.5 * vehicle.weight, rtol=1e-3)


def test_without_a_pose_the_inertial_sensors_are_read(write, t, vehicle):
    times = wide(t)
    gyro, force = inertial(times)
    combined = sensor_combined(times)
    step = np.full(len(times), 4000)  # us
    integrated = {
        "uint64_t timestamp": stamps(times + 0.002),  # the end of what they were gained over
        "float delta_angle": gyro @ FLIP * 0.004,
        "float delta_velocity": force @ FLIP * 0.004,
        "int32_t delta_angle_dt": step,
        "int32_t delta_velocity_dt": step,
    }
    for topic, fields in (("sensor_combined", combined), ("vehicle_imu", integrated)):
        log = read_log(write({"esc_status": esc(times), topic: fields}), None, vehicle)
        assert not log.has_pose
        at = log.t + times[0]
        assert 0.9 * len(times) < len(at)
        assert_inertial(log, at, 2e-2)
        np.testing.assert_allclose(log.rotor_speeds[5], growth(at[5]) * OURS, atol=0.3)


def test_a_slow_pose_stands_in_rows_of_the_inertial_sensors(write, vehicle):
    slow, times = 0.1 * np.arange(40), np.arange(-0.2, 4.2, 0.004)
    topics = {"sensor_combined": sensor_combined(times), "esc_status": esc(times)}
    for pose in ({"vehicle_mocap_odometry": odometry(slow)}, onboard(slow)):
        log = read_log(write(topics | pose), None, vehicle)
        assert log.valid.sum() == len(slow)
        assert len(log.t) > 1000
        assert_motion(log, log.t[log.valid] + times[0], 1e-3)
        np.testing.assert_allclose(log.gyro, inertial(log.t + times[0])[0], atol=2e-2)


def test_a_simulators_ground_truth_comes_first(write, t, vehicle):
    truth = {
        f"{topic}_groundtruth": {k: v for k, v in fields.items() if "valid" not in k}
        for topic, fields in onboard(t).items()
    }
    log = read_log(write({**onboard(t + 0.3), **truth, "esc_status": esc(wide(t))}), None, vehicle)
    assert_motion(log, t, atol=1e-5)
    assert any("ground truth" in note for note in log.notes)


@pytest.mark.parametrize("pulses", [True, False])
def test_outputs_go_through_the_thrust_curve(write, t, vehicle, pulses):
    ours, theirs = relative(vehicle)
    factor = 0.6
    x = (-(1 - factor) + np.sqrt((1 - factor) ** 2 + 4 * factor * theirs)) / (2 * factor)
    at = wide(t)
    output = np.zeros((len(at), 16))
    output[:, 2:6] = 1100.0 + 800.0 * x if pulses else x
    output[:10, 2:6] = 900.0 if pulses else 0.0
    landed = {
        "uint64_t timestamp": stamps(np.array([-0.5, -0.3])),
        "bool landed": np.array([True, False]),
    }
    limits = {
        f"PWM_AUX_{end}{i}": value
        for end, value in (("MIN", 1100), ("MAX", 1900))
        for i in range(3, 7)
    }
    functions = {f"PWM_AUX_FUNC{i + 3}": 101 + i for i in range(4)}
    fields = {"uint64_t timestamp": stamps(at), "float output": output}
    path = write(
        {
            "vehicle_mocap_odometry": odometry(t),
            "actuator_outputs": fields | {"float output": 0 * output},
            "actuator_outputs#1": fields,
            "vehicle_land_detected": landed,
        },
        {"THR_MDL_FAC": factor, **limits, **functions},
    )
    log = read_log(path, "px4_ulog", vehicle)
    assert_scaled(log, ours, vehicle)
    assert any("f = 0.6" in note and "outputs 3, 4, 5, 6" in note for note in log.notes)


def test_bad_pulse_limits_are_named(write, t, vehicle):
    at = wide(t)
    output = 1500.0 + np.multiply.outer(np.sin(at), np.ones(16))
    topics = {
        "vehicle_mocap_odometry": odometry(t),
        "actuator_outputs": {"uint64_t timestamp": stamps(at), "float output": output},
    }
    with pytest.raises(InputError, match="expected MIN below MAX"):
        read_log(write(topics, {"PWM_MAIN_MIN2": 2100}), "px4_ulog", vehicle)
    log = read_log(write(topics, {"THR_MDL_FAC": np.nan}), "px4_ulog", vehicle)
    assert any("f = 0;" in note and "1000 to 2000 us" in note for note in log.notes)


@pytest.mark.parametrize(
    ("topics", "parameters", "expected"),
    [
        ([], {}, "no motors that turn; expected esc_status .* found nothing"),
        (["esc"], {}, "no pose, and no accelerometer and no gyro; .* vehicle_local_position, with"),
        (["pose"], {}, "no motors that turn; expected esc_status .* found vehicle_mocap_odometry"),
        (["pose", "esc"], {"CA_ROTOR_COUNT": 6}, "CA_ROTOR_COUNT is 6; expected a quadrotor's 4"),
        (
            ["pose", "esc"],
            {"CA_ROTOR_COUNT": 4, "CA_ROTOR0_PX": 0.1},
            "expected one in each quadrant",
        ),
        (["pose", "late"], {}, "do not overlap; expected both over the same flight"),
        (["pose", "short"], {}, r"esc_status: 1 message\(s\); expected at least two"),
        (["long", "esc"], {}, "a quaternion of length 2; expected 1"),
    ],
)
def test_what_is_missing_is_named(write, t, vehicle, topics, parameters, expected):
    long = odometry(t)
    long["float q"] = 2 * long["float q"]
    known = {
        "pose": ("vehicle_mocap_odometry", odometry(t)),
        "long": ("vehicle_mocap_odometry", long),
        "esc": ("esc_status", esc(wide(t))),
        "late": ("esc_status", esc(wide(t) + 60)),
        "short": ("esc_status", esc(t[:1])),
    }
    with pytest.raises(InputError, match=f"flight.ulg: .*{expected}"):
        read_log(write(dict(known[name] for name in topics), parameters), "px4_ulog", vehicle)


@pytest.mark.parametrize(
    "content", [b"", b"ULog", b"PK\x03\x04" + bytes(100), b"ULog\x01\x12\x35\x01" + bytes(8)]
)
def test_what_is_no_ulog_is_refused(tmp_path, content, vehicle):
    (tmp_path / "flight.ulg").write_bytes(content)
    with pytest.raises(InputError, match=r"flight.ulg: (cannot be read as a ULog|no motors)"):
        read_log(tmp_path / "flight.ulg", "px4_ulog", vehicle)
    with pytest.raises(InputError, match=r"absent.ulg: cannot be read"):
        read_log(tmp_path / "absent.ulg", "px4_ulog", vehicle)


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_cut_or_spoiled_log_reads_or_is_refused(write, t, vehicle, capsys):
    path = write({"vehicle_mocap_odometry": odometry(t), "esc_status": esc(wide(t))})
    data = path.read_bytes()
    rng = np.random.default_rng(0)
    read = 0
    for k in range(60):
        if k % 2:
            spoiled = bytearray(data)
            for place in rng.integers(0, len(data), 20):
                spoiled[place] = rng.integers(256)
        else:
            spoiled = data[: rng.integers(0, len(data))]
        path.write_bytes(spoiled)
        try:
            log = read_log(path, "px4_ulog", vehicle)
        except InputError:
            continue
        read += 1
        assert np.isfinite(log.rotor_speeds).all()
    assert read > 5
    assert capsys.readouterr().out == ""


def test_without_pyulog_a_ulog_says_what_to_install(tmp_path, monkeypatch):
    (tmp_path / "flight.ulg").write_bytes(b"ULog\x01\x12\x35\x01")
    monkeypatch.setitem(sys.modules, "pyulog", None)
    with pytest.raises(
        InputError, match=r"pip install 'windwrench\[logs\]', or pip install pyulog"
    ):
        read_log(tmp_path / "flight.ulg")
