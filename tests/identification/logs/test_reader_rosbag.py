"""Bags of ROS 1 and ROS 2, of PX4, MAVROS and simulators; which topic is taken for what; and bags
that are cut, packed or hostile.
"""

import sqlite3
from contextlib import closing
from dataclasses import replace
from math import nan, pi

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
from tests.support.vehicles import VEHICLE
from windwrench.cli import app
from windwrench.identification.logs.readers import rosbag
from windwrench.identification.logs.reading import read_log
from windwrench.runtime.file_limits import LIMITS

pytest.importorskip("rosbags", reason="pip install 'windwrench[logs]'")

from rosbags import rosbag1, rosbag2
from rosbags.rosbag1 import reader

from tests.support.bag_writer import START, stamp, write_bag
from windwrench.identification.logs.readers.ros_topics import definitions

T = 0.01 * np.arange(50)
WIDE = np.arange(-0.05, 0.6, 0.004)
KINDS = ("bag", "db3", "mcap")
SHARE = OURS / 1000.0  # commands
THEIRS = [3, 1, 0, 2]  # our rotors of PX4's motors


@pytest.fixture
def write(tmp_path):
    def to_bag(topics, kind="mcap", topic_map=None, name="flight", **how):
        if topic_map is not None:
            (tmp_path / f"{name}.topics.yaml").write_text(topic_map)
        path = tmp_path / (f"{name}.bag" if kind == "bag" else name)
        return write_bag(path, topics, kind, **how)

    return to_bag


def read(path):
    return read_log(path, "rosbag", VEHICLE)


def xyz(values):
    return dict(zip("xyz", map(float, values), strict=True))


def place_and_turn(t, is_ned):
    position, turn = (ned if is_ned else motion)(np.array([t]))
    return xyz(position[0]), dict(zip("xyzw", map(float, turn.as_quat()[0]), strict=True))


def pose(kind="PoseStamped", times=T, is_ned=False, is_stamped=True):
    def fields(t):
        place, turn = place_and_turn(t, is_ned)
        header = stamp(t) if is_stamped else {}
        if kind == "TransformStamped":
            return {"header": header, "transform": {"translation": place, "rotation": turn}}
        here = {"position": place, "orientation": turn}
        return {"header": header, "pose": {"pose": here} if kind == "Odometry" else here}

    package = "nav_msgs" if kind == "Odometry" else "geometry_msgs"
    return f"{package}/msg/{kind}", times, fields


def motors(speeds=OURS, times=WIDE):
    def fields(t):
        return {"header": stamp(t), "angular_velocities": np.asarray(speeds) * growth(t)}

    return "mav_msgs/msg/Actuators", times, fields


def numbers(values, kind="Float32"):
    return f"std_msgs/msg/{kind}MultiArray", WIDE, lambda t: {"data": np.asarray(values)}


def battery():
    fields = lambda t: {"header": stamp(t), "voltage": 12.0 - t}  # noqa: E731
    return "sensor_msgs/msg/BatteryState", WIDE[::10], fields


def imu(turn=None):
    turn = np.eye(3) if turn is None else turn

    def fields(t):
        (gyro,), (force,) = inertial(np.array([t]))
        sensed = {"angular_velocity": xyz(turn @ gyro), "linear_acceleration": xyz(turn @ force)}
        return {"header": stamp(t)} | sensed

    return "sensor_msgs/msg/Imu", WIDE, fields


def actuators():
    fields = lambda t: {"header": stamp(t), "velocity": OURS, "normalized": SHARE}  # noqa: E731
    return "actuator_msgs/msg/Actuators", WIDE, fields


def of_mavros(name, **fields):
    return f"mavros_msgs/msg/{name}", WIDE, lambda t: {"header": stamp(t)} | fields


def of_px4(name, times, fields):
    def stamped(t):
        at = START // 1000 + round(1e6 * t)
        return {"timestamp": at} | fields(t, at)

    return f"px4_msgs/msg/{name}", times, stamped


def px4_topics(is_new):
    def odometry(t, at):
        (place,), turn = ned(np.array([t]))
        q = turn.as_quat(scalar_first=True)[0]
        if is_new:
            return {"timestamp_sample": at, "pose_frame": 1, "position": place, "q": q}
        return {"q": q} | xyz(place)

    def escs(t, at):
        rpm = [*(PX4 * growth(t) * 30 / pi), 0, 0, 0, 0]
        each = [{"esc_rpm": round(w), "actuator_function": 101 + i} for i, w in enumerate(rpm)]
        return {"esc": each[::-1]}  # each says which motor it drives

    def control(t, at):
        return {"timestamp_sample": at, "control": [*SHARE[THEIRS], *[nan] * 8]}

    def sensed(t, at):
        (gyro,), (force,) = inertial(np.array([t]))
        return {"gyro_rad": FLIP @ gyro, "accelerometer_m_s2": FLIP @ force}

    return {
        "/fmu/out/vehicle_odometry": of_px4("VehicleOdometry", T, odometry),
        "/fmu/out/esc_status": of_px4("EscStatus", WIDE, escs),
        "/fmu/out/actuator_motors": of_px4("ActuatorMotors", WIDE, control),
        "/fmu/out/sensor_combined": of_px4("SensorCombined", WIDE, sensed),
    }


FLIGHT = {"/a": pose(), "/motors": motors()}


def assert_flight(log, atol=1e-7):
    assert_allclose(log.t, T, atol=1e-8)
    assert_motion(log, T, atol)
    assert_allclose(log.rotor_speeds, np.multiply.outer(growth(T), OURS), rtol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_the_only_topics_that_fit_are_taken(write, kind):
    topics = {"/vicon/drone": pose(), "/motors": motors(), "/battery": battery()}
    path = write(topics, kind, delay=0.01)
    log = read_log(path, None, VEHICLE)
    assert_flight(log)
    assert_allclose(log.voltage, 12.0 - T, atol=1e-5)
    assert log.name == "flight"
    assert "position: topic /vicon/drone (geometry_msgs/msg/PoseStamped)" in log.notes
    if kind != "bag":
        assert_flight(read(next(path.glob(f"*.{kind}"))))


@pytest.mark.parametrize(
    ("kind", "shape"),
    [("bag", "PoseStamped"), ("mcap", "TransformStamped"), ("bag", "Odometry")],
)
def test_a_map_states_topics_frames_units_and_order(write, kind, shape):
    def rpm(t):
        return {"data": PX4 * growth(t) * 30 / pi}

    topics = {
        "/a": pose(shape, is_ned=True),
        "/b": pose(),
        "/rpm": ("std_msgs/msg/Float32MultiArray", WIDE, rpm),
    }
    lines = "world: ned\nbody: frd\nposition: /a\nrotors: {topic: /rpm, unit: rpm, order: px4-x}\n"
    log = read(write(topics, kind, lines))
    assert_flight(log)
    assert log.voltage is None
    assert noted(log, "/rpm, rpm, motors 1 front-right")
    assert "frames: world ned, body frd" in log.notes


def test_an_imu_is_taken_in_the_frame_that_the_map_states(write):
    path = write(FLIGHT | {"/imu": imu(FLIP)})
    log = read_log(path, None, VEHICLE)  # REP 145 has an IMU forward, left, up
    assert_allclose(log.gyro, inertial(log.t)[0] @ FLIP, atol=2e-3)
    assert "frames: world enu, body flu" in log.notes
    path.with_name("flight.topics.yaml").write_text(
        "accelerometer: {topic: /imu, body: frd}\ngyro: {body: frd}\n"
    )
    log = read(path)
    assert_inertial(log, log.t, 2e-3)


@pytest.mark.parametrize("variant", range(len(definitions())))
def test_messages_of_px4_of_several_years(write, variant):
    log = read_log(write(px4_topics(variant == 0), variant=variant))
    assert_motion(log, log.t)
    assert_inertial(log, log.t)
    assert_allclose(log.rotor_speeds[0], OURS, atol=0.06)
    assert_allclose(log.command, np.tile(SHARE, (len(T), 1)), atol=1e-6)
    assert noted(log, "motors as on px4-x, which the bag does not state")


def test_messages_of_mavros(write):
    pulses = np.array([*(1000 + 1000 * SHARE[THEIRS]), 0, 0])
    topics = {
        "/mavros/local_position/pose": pose(),
        "/mavros/setpoint_position/local": pose(),
        "/mavros/imu/data": imu(),
        "/mavros/imu/data_raw": imu(),
        "/mavros/rc/out": of_mavros("RCOut", channels=np.round(pulses)),
    }
    log = read_log(write(topics, "bag"))
    assert_motion(log, log.t)
    assert_inertial(log, log.t)
    assert_allclose(log.command, np.tile(SHARE, (len(T), 1)), atol=1e-3)
    assert not log.has_rotor_speeds
    text = " ".join(log.notes)
    assert "us, 1000 to 2000 taken as 0 to 1" in text
    assert "/mavros/imu/data (sensor_msgs/msg/Imu), chosen by its name before" in text
    items = [{"rpm": round(w * 30 / pi)} for w in PX4]
    topics |= {"/mavros/esc_status": of_mavros("ESCStatus", esc_status=items)}
    log = read_log(write(topics | {"/vrpn/drone/pose": pose()}, name="second"))
    assert_allclose(log.rotor_speeds[0], OURS, atol=0.06)
    assert noted(log, "/vrpn/drone/pose", "chosen by its name before")


def test_actuators_of_gazebo_and_a_named_order(write):
    path = write({"/pose": pose(), "/motors": actuators()})
    log = read_log(path)
    assert_allclose(log.rotor_speeds[0], OURS)
    assert_allclose(log.command[0], SHARE)
    path.with_name("flight.topics.yaml").write_text("rotors: {topic: /motors, order: crazyflie}")
    assert_allclose(read_log(path).rotor_speeds[0], OURS[::-1])


def test_each_field_of_a_message_is_read_for_itself(write):
    """As of Gazebo's bridge: speeds without commands, and none before the simulation runs."""

    def fields(t):
        i = round(100 * t) % 10
        return {"header": stamp(t), "velocity": OURS[: 0 if t < 0.1 or i == 7 else 4]}

    log = read_log(
        write({"/pose": pose(), "/motors": ("actuator_msgs/msg/Actuators", WIDE, fields)})
    )
    assert_allclose(log.rotor_speeds, np.tile(OURS, (len(log.t), 1)))
    assert log.command is None
    assert noted(log, "no commands: /motors has no normalized[0] ...")


def test_topics_that_may_hold_motors_are_said_where_they_are_left_out(write):
    more = {"/esc/rpm": numbers(OURS), "/battery": battery(), "/counts": numbers(OURS)}
    log = read_log(write({"/pose": pose(), "/motors": actuators()} | more))
    assert noted(log, "topics that may hold motors were left out: /esc/rpm")
    assert not noted(log, "/counts")


def test_without_a_pose_an_imu_will_do(write):
    log = read_log(write({"/imu": imu(), "/motors": actuators()}))
    assert not log.has_pose
    assert_inertial(log, log.t + WIDE[0])


def test_a_map_may_lie_elsewhere(write, tmp_path):
    path = write(FLIGHT | {"/b": pose()}, "bag")
    (tmp_path / "other.yaml").write_text("position: /b\n")
    assert_flight(read_log(path, f"rosbag:{tmp_path / 'other.yaml'}", VEHICLE))
    assert_flight(read_log(path, vehicle=VEHICLE, map=tmp_path / "other.yaml"))


def test_columns_pick_four_of_more(write):
    six = np.concatenate([OURS[3:], OURS[:2], OURS[:1], OURS[2:]])
    path = write({"/a": pose(), "/motors": motors(six)}, "bag")
    with refused(r"6 rotors turn \(angular_velocities\[0\], .*; expected the four"):
        read(path)
    four = [f"angular_velocities[{i}]" for i in (1, 2, 4, 5)]
    path.with_name("flight.topics.yaml").write_text(f"rotors: {{columns: {four}}}\n")
    assert_flight(read(path))
    path.with_name("flight.topics.yaml").write_text(
        f"rotors: {{columns: {four}}}\n".replace("5", "6")
    )
    with refused(r"no field angular_velocities\[6\] in its mav_msgs"):
        read(path)


@pytest.mark.parametrize(
    ("topics", "delay", "said"),
    [
        ({}, 5.0, "of another clock"),
        ({"/a": pose(is_stamped=False)}, 0.0, "/a: no time stamps"),
        ({"/motors": motors(times=[*WIDE[:50], WIDE[20], *WIDE[50:]])}, 0.0, "1 of 164 samples"),
    ],
)
def test_times_that_are_no_use_are_replaced_or_left_out(write, topics, delay, said):
    log = read(write(FLIGHT | topics, "bag", delay=delay))
    assert_flight(log)
    assert noted(log, said)


@pytest.mark.parametrize(
    ("topics", "expected"),
    [
        ({"/a": pose()}, r"rotors: no topic .* in \S*flight.topics.yaml. The topics: /a"),
        (FLIGHT | {"/a": pose(times=[])}, "topic /a has no messages"),
        (FLIGHT | {"/a": pose(times=[0.0])}, r"/a: 1 message\(s\); expected at least two"),
        (FLIGHT | {"/motors": motors(times=WIDE + 9)}, "do not overlap"),
        (FLIGHT | {"/motors": motors([1, 2, nan, 3])}, "no two samples have four finite"),
        ({}, "The topics: none"),
    ],
)
def test_what_is_missing_is_named(write, topics, expected):
    """What is wrong with topics and maps alone is in the golden lines of Python's errors."""
    with refused(f"flight.*: .*{expected}"):
        read(write(topics, "mcap"))


def logged(name):
    return name, WIDE, lambda t: {"header": stamp(t), "values": OURS}


@pytest.mark.parametrize(
    ("kind", "array", "line", "wanted"),
    [
        ("mcap", numbers(OURS, "Float64"), "rotors: {topic: /m, unit: rad/s}", OURS),
        ("mcap", numbers(OURS), "rotors: {topic: /m, unit: rev/s}", OURS * 2 * pi),
        ("mcap", numbers(OURS), "commands: {topic: /m, unit: normalized, range: [0, 1000]}", SHARE),
        ("bag", logged("crazyswarm/msg/GenericLogData"), "rotors: {topic: /m, unit: rad/s}", OURS),
        (
            "mcap",
            logged("crazyflie_interfaces/msg/LogDataGeneric"),
            "rotors: {topic: /m, unit: rad/s}",
            OURS,
        ),
    ],
)
def test_an_array_is_what_the_map_says(write, kind, array, line, wanted):
    log = read_log(write({"/a": pose(), "/m": array}, kind, line))
    found = log.command if log.command is not None else log.rotor_speeds
    assert_allclose(found[0], wanted, rtol=1e-6)


def test_what_is_not_there_is_refused(tmp_path):
    (tmp_path / "flight.csv").write_text("t")
    for path, reader_name, expected in (
        (tmp_path / "absent.bag", "rosbag", r"absent.bag: cannot be read as a ROS bag"),
        (tmp_path, "rosbag", r"no metadata\.yaml, and 0 \.db3"),
        (tmp_path, None, r"is a folder; expected a file, or .* ROS 2 bag, .*; found flight.csv"),
    ):
        with refused(expected):
            read_log(path, reader_name, VEHICLE)


def test_another_definition_of_a_known_type_is_refused(write):
    path = write(FLIGHT | {"/motors": (*motors(), "float64[] angular_velocities\n")}, "bag")
    with refused(r"/motors: its mav_msgs/msg/Actuators has another defin"):
        read(path)


def test_a_voltage_that_nobody_asked_for_may_be_unreadable(write):
    path = write(FLIGHT | {"/battery": (*battery(), "float32 voltage\n")}, "bag")
    log = read(path)
    assert_flight(log)
    assert log.voltage is None
    assert noted(log, "no battery: ", "another definition")
    path.with_name("flight.topics.yaml").write_text("battery: /battery")
    with refused("another definition"):
        read(path)


PACKED = {
    "bz2": ("bag", (rosbag1.Writer.CompressionFormat.BZ2,)),
    "lz4": ("bag", (rosbag1.Writer.CompressionFormat.LZ4,)),
    "zstd": ("mcap", (rosbag2.CompressionMode.STORAGE, rosbag2.CompressionFormat.ZSTD)),
}


@pytest.mark.parametrize("way", PACKED)
def test_packed_chunks_are_unpacked_up_to_a_limit(way, write, monkeypatch):
    kind, packed = PACKED[way]
    path = write(FLIGHT, kind, packed=packed)
    assert_flight(read(path))
    before = dict(reader.decompressors)
    monkeypatch.setattr(rosbag, "LARGEST", 1000)
    with refused(r"flight.*a chunk unpacks to more than 1000 bytes"):
        read(path)
    assert reader.decompressors == before  # rosbags is left as it was


CHUNKS = {"bag_unpacked": 20_000}, "its chunks unpack to more than 20000 bytes"


@pytest.mark.parametrize(
    ("kind", "packed", "limit", "expected"),
    [
        *((*way, *CHUNKS) for way in PACKED.values()),
        ("bag", None, {"bag_index": 100}, "its index has more than 100 entries"),
        ("mcap", None, {"table_rows": 10}, "topic /a: more than 10 messages; expected one flight"),
    ],
)
def test_what_a_bag_holds_is_counted(kind, packed, limit, expected, write, monkeypatch):
    path = write(FLIGHT, kind, packed=packed)
    monkeypatch.setattr(rosbag, "LIMITS", replace(LIMITS, **limit))
    with refused(expected):
        read(path)


@pytest.mark.parametrize(
    "change",
    [
        "CREATE VIEW schema AS SELECT 1 AS schema_version",
        "ALTER TABLE messages ADD COLUMN more BLOB GENERATED ALWAYS AS (zeroblob(1000000000))",
    ],
)
def test_a_database_that_computes_what_it_holds_is_refused(change, write):
    path = write(FLIGHT, "db3")
    (file,) = path.glob("*.db3")
    with closing(sqlite3.connect(file)) as database:
        if "VIEW" in change:
            database.execute("DROP TABLE IF EXISTS schema")
        database.execute(change)
        database.commit()
    with refused(r"\.db3: its (view|table) '\w+' is computed"):
        read(path)


@pytest.mark.parametrize("mode", [rosbag2.CompressionMode.FILE, rosbag2.CompressionMode.MESSAGE])
def test_files_and_messages_packed_one_by_one_are_refused(mode, write):
    path = write(FLIGHT, "db3", packed=(mode, rosbag2.CompressionFormat.ZSTD))
    with refused(rf"metadata.yaml: compression_mode {mode.name.lower()}: expected a bag that"):
        read(path)


@pytest.mark.parametrize(("kind", "has_metadata"), [("db3", False), ("mcap", True)])
def test_the_folder_one_stands_in_is_a_bag(kind, has_metadata, write, monkeypatch):
    """With the map beside the folder, and without the metadata where one file is all there is."""
    path = write({"/a": pose(), "/b": pose(), "/m": motors()}, kind, topic_map="position: /b")
    whole = read_log(path, None, VEHICLE)
    if not has_metadata:
        (path / "metadata.yaml").unlink()
    (path / "inner").mkdir()
    for folder, given in ((path, "."), (path / "inner", "..")):
        monkeypatch.chdir(folder)
        assert_array_equal(read_log(given, None, VEHICLE).position, whole.position)


def broken_database(folder):
    (folder / "x.db3").write_bytes(b"SQLite format 3\0" + bytes(5000))


def two_files(folder):
    for name in ("a.db3", "b.mcap"):
        (folder / name).touch()


def another_database(folder):
    with closing(sqlite3.connect(folder / "x.db3")) as database:
        database.execute("CREATE TABLE a (b INTEGER)")


def metadata_alone(folder):
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information: {version: 5, version: 6}")


FOLDERS = {
    lambda folder: None: r"^\.: is a folder; .*found nothing in it",
    lambda folder: (folder / "x.db3").touch(): r"^x\.db3: cannot be read as a ROS 2 bag",
    lambda folder: (folder / "x.db3").mkdir(): r"^\.: no metadata\.yaml, and 0 \.db3 or \.mcap",
    lambda folder: (folder / "metadata.yaml").mkdir(): r"^metadata\.yaml: is a folder",
    lambda folder: (folder / "x.db3").symlink_to("gone"): r"^x\.db3: cannot be read .*No such file",
    broken_database: r"^x\.db3: cannot be read as a ROS 2 bag: .*; expected a whole bag",
    another_database: r"^x\.db3: cannot be read as a ROS 2 bag: .*missing tables",
    two_files: r"^\.: no metadata\.yaml, and 2 \.db3 or \.mcap files; expected metadata\.yaml",
    metadata_alone: r"^\.: cannot be read as a ROS 2 bag: ",
}


@pytest.mark.parametrize("make", FOLDERS)
def test_a_folder_that_is_no_bag_is_refused_in_one_line(make, tmp_path, monkeypatch):
    make(tmp_path)
    monkeypatch.chdir(tmp_path)
    with refused(FOLDERS[make]) as raised:
        app(["check", "."], standalone_mode=False)
    assert "\n" not in str(raised.value)
