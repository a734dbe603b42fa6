from math import nan

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

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
from tests.support.outcomes import noted, refused
from tests.support.ulog_writer import (
    battery,
    by_axis,
    control,
    esc,
    odometry,
    sensor_combined,
    stamps,
    ulog_bytes,
)
from tests.support.vehicles import VEHICLE
from windwrench.identification.logs.reading import read_log

pytest.importorskip("pyulog", reason="pip install 'windwrench[logs]'")


T = 0.01 * np.arange(200)
WIDE = np.arange(-0.5, T[-1] + 0.5, 0.004)


def onboard(t):
    position, _ = ned(t)
    fast = np.linspace(t[0] - 0.1, t[-1] + 0.1, 4 * len(t))
    return {
        "vehicle_local_position": {
            "uint64_t timestamp": stamps(t),
            "uint64_t timestamp_sample": stamps(t),
            **by_axis(position),
            "bool xy_valid": np.ones(len(t), bool),
            "bool z_valid": np.ones(len(t), bool),
        },
        "vehicle_attitude": {
            "uint64_t timestamp": stamps(fast),
            "float q": ned(fast)[1].as_quat(scalar_first=True),
        },
    }


@pytest.fixture
def read(write):
    def of_topics(topics, parameters=None, vehicle=VEHICLE):
        return read_log(write(ulog_bytes(topics, parameters)), None, vehicle)

    return of_topics


def mocap(t):
    return {"vehicle_mocap_odometry": odometry(t)}


MOCAP = mocap(T)
FLIGHT = MOCAP | {"esc_status": esc(WIDE)}


@pytest.mark.parametrize("topic", ["vehicle_mocap_odometry", "vehicle_visual_odometry"])
@pytest.mark.parametrize("new", [True, False])
def test_motion_capture_and_turn_rates(read, topic, new):
    volts = battery(WIDE[::25], 12.0 - 0.1 * WIDE[::25])
    topics = {topic: odometry(T, new), "esc_status": esc(WIDE), "battery_status": volts}
    log = read(topics | onboard(T[::3]))
    assert_allclose(log.t, T, atol=2e-6)
    assert_motion(log, T)
    assert_allclose(log.rotor_speeds, np.multiply.outer(growth(T), OURS), atol=0.06)
    assert_allclose(log.voltage, 12.0 - 0.1 * T, atol=1e-5)
    assert f"pose: {topic}" in log.notes
    assert noted(log, "y west")
    assert noted(log, "3, 2, 4, 1")


def test_inertial_sensors_come_in_the_kits_axes(read):
    fields = sensor_combined(WIDE)
    assert_inertial(read(FLIGHT | {"sensor_combined": fields}), T)
    # half a second in which nothing was read stays empty
    lost = (WIDE > 0.7) & (WIDE < 1.2)
    fields = {name: column[~lost] for name, column in fields.items()}
    log = read(FLIGHT | {"sensor_combined": fields})
    assert 48 <= np.isnan(log.gyro).all(axis=1).sum() <= 51
    assert read(FLIGHT).gyro is None


TRUTH = {
    f"{topic}_groundtruth": {k: v for k, v in fields.items() if "valid" not in k}
    for topic, fields in onboard(T).items()
}
BARE = {"vehicle_visual_odometry": odometry(T) | {"float q": np.full((len(T), 4), nan)}}


@pytest.mark.parametrize(
    ("topics", "said"),
    [
        (onboard(T), "pose: the onboard filter's (vehicle_local_position)"),
        (BARE | onboard(T), "attitude the onboard filter's (vehicle_attitude)"),
        (onboard(T + 0.3) | TRUTH, "pose: the simulator's ground truth"),
    ],
)
def test_the_best_pose_is_taken(read, topics, said):
    log = read({"esc_status": esc(WIDE)} | topics)
    assert_motion(log, T, atol=1e-5)
    assert any(note.startswith(said) for note in log.notes)


def test_lost_positions_are_not_valid(read):
    lossy = odometry(T)
    lossy["float position"][50:60] = nan
    log = read(FLIGHT | {"vehicle_mocap_odometry": lossy})
    assert_array_equal(np.flatnonzero(~log.valid), np.arange(50, 60))


def test_esc_functions_and_rotor_places_renumber_the_motors(read):
    # ESC 1 drives motor 4 and so on; and motors 1 to 4 sit front-left, front-right, rear-right,
    # rear-left
    places = {"CA_ROTOR_COUNT": 4}
    for i, (x, right) in enumerate([(0.1, -0.1), (0.1, 0.1), (-0.1, 0.1), (-0.1, -0.1)]):
        places |= {f"CA_ROTOR{i}_PX": x, f"CA_ROTOR{i}_PY": right}
    escs = esc(WIDE, OURS[[0, 3, 2, 1]][::-1], f0=104, f1=103, f2=102, f3=101)
    log = read(MOCAP | {"esc_status": escs}, places)
    assert_allclose(log.rotor_speeds[0], OURS, atol=0.06)


SHARES = np.array([0.40, 0.42, 0.44, 0.46])  # relative thrusts of our rotors
THEIRS = SHARES[[3, 1, 0, 2]]


def assert_scaled(log, vehicle):
    """The vertical part of a thrust that stays the same carries the weight on the mean."""
    thrust = vehicle.k * log.rotor_speeds**2
    up = motion(log.t)[1].as_matrix()[:, 2, 2]
    flying = thrust.sum(axis=1) > 0.5 * thrust.sum(axis=1).max()
    vertical = (thrust.sum(axis=1) * up)[flying]
    assert_allclose(np.mean(vertical), vehicle.weight, rtol=1e-3)
    assert_allclose(thrust[100] / thrust[100].sum(), SHARES / SHARES.sum(), rtol=1e-5)
    assert noted(log, "vertical thrust in flight is the weight of ardrone2")
    assert log.commanded


def test_relative_thrust_is_scaled_to_the_weight(read):
    values = np.full((len(WIDE), 12), nan)
    values[20:, :4] = THEIRS  # disarmed before
    topics = MOCAP | {"esc_status": esc(WIDE, 0 * PX4)} | {"actuator_motors": control(WIDE, values)}
    assert_scaled(read(topics, {"THR_MDL_FAC": 0.3}), VEHICLE)
    alone = read(topics, vehicle=None)  # without a vehicle commands stay what they are
    assert not alone.has_rotor_speeds
    assert_allclose(alone.command[100], SHARES, rtol=1e-6)


def test_motors_that_are_left_out_are_said(read):
    stopped = control(WIDE, np.zeros((len(WIDE), 12)))
    log = read(FLIGHT | {"actuator_motors": stopped})
    assert log.command is None
    assert noted(log, "actuator_motors: not of four motors that turn; left out")


@pytest.mark.parametrize("topic", ["sensor_combined", "vehicle_imu"])
def test_without_a_pose_the_inertial_sensors_are_read(read, topic):
    fields = sensor_combined(WIDE)
    if topic == "vehicle_imu":
        gyro, force = inertial(WIDE)
        step = np.full(len(WIDE), 4000)  # us
        fields = {
            "uint64_t timestamp": stamps(WIDE + 0.002),  # the end of what they were gained over
            "float delta_angle": gyro @ FLIP * 0.004,
            "float delta_velocity": force @ FLIP * 0.004,
            "int32_t delta_angle_dt": step,
            "int32_t delta_velocity_dt": step,
        }
    log = read({"esc_status": esc(WIDE), topic: fields})
    assert not log.has_pose
    at = log.t + WIDE[0]
    assert 0.9 * len(WIDE) < len(at)
    assert_inertial(log, at, 2e-2)
    assert_allclose(log.rotor_speeds[5], growth(at[5]) * OURS, atol=0.3)


@pytest.mark.parametrize("pose", [mocap, onboard])
def test_a_slow_pose_stands_in_rows_of_the_inertial_sensors(read, pose):
    slow = 0.1 * np.arange(40)
    times = np.arange(-0.2, 4.2, 0.004)
    sensors = {"sensor_combined": sensor_combined(times), "esc_status": esc(times)}
    log = read(pose(slow) | sensors)
    assert log.valid.sum() == len(slow)
    assert len(log.t) > 1000
    assert_motion(log, log.t[log.valid] + times[0], 1e-3)
    assert_inertial(log, log.t + times[0], 2e-2)


@pytest.mark.parametrize("pulses", [True, False])
def test_outputs_go_through_the_thrust_curve(read, pulses):
    factor = 0.6
    x = (-(1 - factor) + np.sqrt((1 - factor) ** 2 + 4 * factor * THEIRS)) / (2 * factor)
    output = np.zeros((len(WIDE), 16))
    output[:, 2:6] = 1100.0 + 800.0 * x if pulses else x
    output[:10, 2:6] = 900.0 if pulses else 0.0
    landed = {
        "uint64_t timestamp": stamps(np.array([-0.5, -0.3])),
        "bool landed": np.array([True, False]),
    }
    parameters = {"THR_MDL_FAC": factor} | {f"PWM_AUX_FUNC{i + 3}": 101 + i for i in range(4)}
    for end, value in (("MIN", 1100), ("MAX", 1900)):
        parameters |= {f"PWM_AUX_{end}{i}": value for i in range(3, 7)}
    fields = {"uint64_t timestamp": stamps(WIDE), "float output": output}
    topics = {
        "actuator_outputs": fields | {"float output": 0 * output},
        "actuator_outputs#1": fields,
        "vehicle_land_detected": landed,
    }
    log = read(MOCAP | topics, parameters)
    assert_scaled(log, VEHICLE)
    assert noted(log, "f = 0.6", "outputs 3, 4, 5, 6")


def test_bad_pulse_limits_are_named(read):
    output = 1500.0 + np.multiply.outer(np.sin(WIDE), np.arange(16) < 4)
    fields = {"uint64_t timestamp": stamps(WIDE), "float output": output}
    topics = MOCAP | {"actuator_outputs": fields}
    with refused("expected MIN below MAX"):
        read(topics, {"PWM_MAIN_MIN2": 2100})
    assert noted(read(topics, {"THR_MDL_FAC": nan}), "f = 0;", "1000 to 2000 us")


LONG = odometry(T) | {"float q": 2 * odometry(T)["float q"]}


@pytest.mark.parametrize(
    ("topics", "parameters", "expected"),
    [
        ({"esc_status": esc(WIDE)}, {}, "no pose, and no accel.* vehicle_local_position, with"),
        (MOCAP, {}, "no motors that turn; expected esc_status .* found vehicle_mocap_odometry"),
        (FLIGHT, {"CA_ROTOR_COUNT": 4, "CA_ROTOR0_PX": 0.1}, "expected one in each quadrant"),
        (MOCAP | {"esc_status": esc(WIDE + 60)}, {}, "do not overlap; expected both over the same"),
        (MOCAP | {"esc_status": esc(T[:1])}, {}, r"esc_status: 1 message\(s\); expected at least"),
        (FLIGHT | {"vehicle_mocap_odometry": LONG}, {}, "a quaternion of length 2; expected 1"),
    ],
)
def test_what_is_missing_is_named(read, topics, parameters, expected):
    with refused(f"log03: .*{expected}"):
        read(topics, parameters)
