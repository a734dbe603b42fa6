import sqlite3
import sys
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from windwrench.dynamics import InputError, load_vehicle
from windwrench.identification.logs.readers import rosbag, unpacking
from windwrench.identification.logs.reading import read_log
from windwrench.runtime.file_limits import LIMITS

pytest.importorskip("rosbags", reason="rosbags is not installed: pip install 'windwrench[logs]'")

from rosbags import rosbag1, rosbag2
from rosbags.rosbag1 import reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

ACTUATORS = "mav_msgs/msg/Actuators"
ACTUATORS_TEXT = (
    "std_msgs/Header header\nfloat64[] angles\nfloat64[] angular_velocities\nfloat64[] normalized\n"
)
START = 1_700_000_000_000_000_000  # ns
OURS = np.array(
    [301.0, 302.0, 303.0, 304.0]
)  # rad/s of front-left, rear-left, rear-right, front-right
PX4 = OURS[[3, 1, 0, 2]]  # 1 front-right, 2 rear-left, 3 front-left, 4 rear-right
FLIP = np.diag([1.0, -1.0, -1.0])
T = 0.01 * np.arange(50)
WIDE = np.arange(-0.05, 0.6, 0.004)
KINDS = ("bag", "db3", "mcap")


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle("ardrone2")


@pytest.fixture(scope="module")
def stores():
    made = {True: get_typestore(Stores.ROS1_NOETIC), False: get_typestore(Stores.ROS2_HUMBLE)}
    for store in made.values():
        store.register(get_types_from_msg(ACTUATORS_TEXT, ACTUATORS))
    return made


def motion(t):
    position = np.column_stack([0.5 * np.cos(t), 0.8 * np.sin(t), 1.0 + 0.1 * t])
    turn = Rotation.from_euler(
        "ZYX", np.column_stack([2.0 + 1.5 * t, 0.2 * np.sin(2 * t), 0.3 * np.cos(t)])
    )
    return position, turn


def inertial(t):
    """Angular velocity (rad/s) and specific force (m/s2), body axes forward, left, up."""
    turn, after = motion(t)[1], motion(t + 1e-5)[1]
    acceleration = np.column_stack([-0.5 * np.cos(t), -0.8 * np.sin(t), np.full(len(t), 9.81)])
    return (turn.inv() * after).as_rotvec() / 1e-5, turn.inv().apply(acceleration)


def growth(t):
    return 1.0 + 0.1 * t


class Messages:
    """Makes the messages of one typestore."""

    def __init__(self, store, ros1):
        self.types, self.ros1 = store.types, ros1

    def header(self, t):
        if t is None:
            t = -1e-9 * START
        nanoseconds = START + round(1e9 * t)
        stamp = self.types["builtin_interfaces/msg/Time"](nanoseconds // 10**9, nanoseconds % 10**9)
        return self.types["std_msgs/msg/Header"](*([0] if self.ros1 else []), stamp, "world")

    def pose(self, kind, t, ned=False, stamp=True):
        (p,), turn = motion(np.array([t]))
        matrix = turn.as_matrix()[0]
        if ned:
            p, matrix = FLIP @ p, FLIP @ matrix @ FLIP
        quaternion = self.types["geometry_msgs/msg/Quaternion"](
            *Rotation.from_matrix(matrix).as_quat()
        )
        header = self.header(t if stamp else None)
        if kind == "geometry_msgs/msg/TransformStamped":
            place = self.types["geometry_msgs/msg/Vector3"](*p)
            return self.types[kind](
                header, "body", self.types["geometry_msgs/msg/Transform"](place, quaternion)
            )
        pose = self.types["geometry_msgs/msg/Pose"](
            self.types["geometry_msgs/msg/Point"](*p), quaternion
        )
        if kind == "geometry_msgs/msg/PoseStamped":
            return self.types[kind](header, pose)
        zero = self.types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
        twist = self.types["geometry_msgs/msg/Twist"](zero, zero)
        return self.types[kind](
            header,
            "body",
            self.types["geometry_msgs/msg/PoseWithCovariance"](pose, np.zeros(36)),
            self.types["geometry_msgs/msg/TwistWithCovariance"](twist, np.zeros(36)),
        )

    def actuators(self, t, speeds):
        return self.types[ACTUATORS](
            self.header(t), np.zeros(0), np.asarray(speeds) * growth(t), np.zeros(0)
        )

    def array(self, t, speeds):
        layout = self.types["std_msgs/msg/MultiArrayLayout"]([], 0)
        return self.types["std_msgs/msg/Float32MultiArray"](
            layout, (np.asarray(speeds) * growth(t)).astype(np.float32)
        )

    def imu(self, t):
        make = self.types["geometry_msgs/msg/Vector3"]
        zero, turn = np.zeros(9), self.types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
        (gyro,), (force,) = inertial(np.array([t]))
        return self.types["sensor_msgs/msg/Imu"](
            self.header(t), turn, zero, make(*(FLIP @ gyro)), zero, make(*(FLIP @ force)), zero
        )

    def battery(self, t):
        kind = self.types["sensor_msgs/msg/BatteryState"]
        names = {
            name: 0 if "power" in name else 0.0
            for name in kind.__dataclass_fields__
            if not name.startswith("__")
        }
        names |= {
            "header": self.header(t),
            "voltage": 12.0 - t,
            "present": True,
            "location": "",
            "serial_number": "",
            "cell_voltage": np.zeros(0, np.float32),
            "cell_temperature": np.zeros(0, np.float32),
        }
        return kind(**names)


@pytest.fixture
def write(tmp_path, stores):
    def to_bag(kind, topics, topic_map=None, delay=0.0, packed=()):
        """Write ``{topic: (type, times, make(messages, t), definition)}`` into a bag and return its
        path.
        """
        ros1 = kind == "bag"
        store, path = stores[ros1], tmp_path / ("flight.bag" if ros1 else "flight")
        messages = Messages(store, ros1)
        if ros1:
            writer = rosbag1.Writer(path)
        else:
            plugin = rosbag2.StoragePlugin.MCAP if kind == "mcap" else rosbag2.StoragePlugin.SQLITE3
            writer = rosbag2.Writer(path, version=9, storage_plugin=plugin)
        if packed:
            writer.set_compression(*packed)
        with writer:
            for topic, (name, times, make, *definition) in topics.items():
                how = (
                    {"msgdef": definition[0], "md5sum": 32 * "0"}
                    if definition
                    else {"typestore": store}
                )
                connection = writer.add_connection(topic, name, **how)
                for t in times:
                    message = make(messages, t)
                    raw = (
                        store.serialize_ros1(message, name)
                        if ros1
                        else store.serialize_cdr(message, name)
                    )
                    writer.write(connection, START + round(1e9 * (t + delay)), raw)
        if topic_map is not None:
            (tmp_path / "flight.topics.yaml").write_text(topic_map)
        return path

    return to_bag


def pose_topic(kind="geometry_msgs/msg/PoseStamped", times=T, **options):
    return kind, times, lambda messages, t: messages.pose(kind, t, **options)


def actuator_topic(speeds=OURS, times=WIDE):
    return ACTUATORS, times, lambda messages, t: messages.actuators(t, speeds)


def array_topic(speeds):
    return "std_msgs/msg/Float32MultiArray", WIDE, lambda messages, t: messages.array(t, speeds)


def battery_topic():
    return "sensor_msgs/msg/BatteryState", WIDE[::10], lambda messages, t: messages.battery(t)


def assert_motion(log, atol=1e-7):
    position, turn = motion(T)
    np.testing.assert_allclose(log.t, T, atol=1e-8)
    np.testing.assert_allclose(log.position, position, atol=atol)
    assert (
        turn.inv() * Rotation.from_quat(log.quaternion[:, [1, 2, 3, 0]])
    ).magnitude().max() < 10 * atol
    np.testing.assert_allclose(log.rotor_speeds, np.multiply.outer(growth(T), OURS), rtol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_the_only_topics_that_fit_are_taken(write, kind, vehicle):
    path = write(
        kind,
        {"/vicon/drone": pose_topic(), "/motors": actuator_topic(), "/battery": battery_topic()},
        delay=0.01,
    )
    log = read_log(path, "rosbag", vehicle)
    assert_motion(log)
    np.testing.assert_allclose(log.voltage, 12.0 - T, atol=1e-5)
    assert log.name == "flight"
    assert any(
        "pose: topic /vicon/drone (geometry_msgs/msg/PoseStamped)" in note for note in log.notes
    )
    if kind != "bag":
        inside = next(path.glob(f"*.{kind}"))
        assert_motion(read_log(inside, "rosbag", vehicle))


@pytest.mark.parametrize("kind", ["bag", "mcap"])
@pytest.mark.parametrize(
    "pose",
    [
        "geometry_msgs/msg/PoseStamped",
        "geometry_msgs/msg/TransformStamped",
        "nav_msgs/msg/Odometry",
    ],
)
def test_a_map_states_topics_frames_units_and_order(write, kind, pose, vehicle):
    path = write(
        kind,
        {
            "/a": pose_topic(pose, ned=True),
            "/b": pose_topic(),
            "/rpm": array_topic(PX4 * 30 / np.pi),
        },
        "pose: {topic: /a, frame: ned}\nrotors: {topic: /rpm, unit: rpm, order: [3, 2, 4, 1]}\n",
    )
    log = read_log(path, "rosbag", vehicle)
    assert_motion(log)
    assert log.voltage is None
    assert any("elements 3, 2, 4, 1" in note for note in log.notes)
    assert any("half a turn about x" in note for note in log.notes)


@pytest.mark.parametrize("kind", ["bag", "mcap"])
def test_an_imu_is_taken_in_the_frame_that_the_map_states(write, kind, vehicle):
    topics = {
        "/a": pose_topic(),
        "/motors": actuator_topic(),
        "/imu": ("sensor_msgs/msg/Imu", WIDE, lambda messages, t: messages.imu(t)),
    }
    path = write(kind, topics)
    log = read_log(path, None, vehicle)  # REP 145 has an IMU forward, left, up
    np.testing.assert_allclose(log.gyro, inertial(log.t)[0] @ FLIP, atol=2e-3)
    assert "imu: body forward, left, up, as the bag has it" in log.notes
    path.with_name("flight.topics.yaml").write_text("imu: {topic: /imu, frame: ned}")
    log = read_log(path, "rosbag", vehicle)
    gyro, force = inertial(log.t)
    np.testing.assert_allclose(log.gyro, gyro, atol=2e-3)
    np.testing.assert_allclose(log.accelerometer, force, atol=2e-3)


def test_a_map_may_lie_elsewhere(write, tmp_path, vehicle):
    path = write("bag", {"/a": pose_topic(), "/b": pose_topic(), "/motors": actuator_topic()})
    (tmp_path / "other.yaml").write_text("pose: /b\n")
    assert_motion(read_log(path, f"rosbag:{tmp_path / 'other.yaml'}", vehicle))
    with pytest.raises(InputError, match=r"reader 'nanobench' takes no option, got 'x'"):
        read_log(path, "nanobench:x", vehicle)
    with pytest.raises(InputError, match=r"absent.yaml: cannot be read as a topic map"):
        read_log(path, f"rosbag:{tmp_path / 'absent.yaml'}", vehicle)


def test_an_order_picks_four_of_more(write, vehicle):
    six = np.concatenate([[1.0], OURS[:2], [2.0], OURS[2:]])
    path = write("bag", {"/a": pose_topic(), "/motors": actuator_topic(six)})
    with pytest.raises(
        InputError, match=r"topic /motors, message 1: 6 rotor speed.s.; expected 4, or an order"
    ):
        read_log(path, "rosbag", vehicle)
    path.with_name("flight.topics.yaml").write_text("rotors: {order: [2, 3, 5, 6]}\n")
    assert_motion(read_log(path, "rosbag", vehicle))
    path.with_name("flight.topics.yaml").write_text("rotors: {order: [2, 3, 5, 7]}\n")
    with pytest.raises(InputError, match="expected at least 7"):
        read_log(path, "rosbag", vehicle)


def test_stamps_of_another_clock_are_not_mixed_with_the_bags(write, vehicle):
    path = write("bag", {"/a": pose_topic(), "/motors": actuator_topic()}, delay=5.0)
    log = read_log(path, "rosbag", vehicle)
    assert_motion(log)
    assert any("of another clock" in note for note in log.notes)


def test_poses_without_stamps_take_the_time_of_recording(write, vehicle):
    log = read_log(
        write("mcap", {"/a": pose_topic(stamp=False), "/motors": actuator_topic()}),
        "rosbag",
        vehicle,
    )
    assert_motion(log)
    assert any("no time stamps" in note for note in log.notes)


def test_messages_out_of_order_are_left_out(write, vehicle):
    path = write(
        "bag",
        {"/a": pose_topic(), "/motors": actuator_topic(times=[*WIDE[:50], WIDE[20], *WIDE[50:]])},
    )
    log = read_log(path, "rosbag", vehicle)
    assert_motion(log)
    assert any("1 of 164 samples repeat or go back" in note for note in log.notes)


@pytest.mark.parametrize(
    ("topic_map", "expected"),
    [
        ("pose: /nowhere", r"unknown topic '/nowhere'; expected one of /a, /motors, /n"),
        (
            "pose: /motors",
            "pose: topic /motors is of type mav_msgs/msg/Actuators; expected "
            "geometry_msgs/msg/PoseStamped",
        ),
        ("pos: /a", "unknown key 'pos'; expected one of command, imu, pose, rotors, voltage"),
        (
            "pose: {topic: /a, frames: ned}",
            "pose: unknown key 'frames'; expected one of frame, topic",
        ),
        (
            "pose: {topic: /a, frame: enu}",
            "pose: frame: unknown frame 'enu'; expected one of flu, ned",
        ),
        ("pose: {topic: [1]}", r"pose: topic must be a name such as /motors, got \[1\]"),
        ("pose: 3", "pose: expected a mapping of fields such as topic, frame, got int"),
        ("rotors: {unit: [rpm]}", "rotors: unit: unknown unit"),
        ("rotors: {order: [1, 2, 3, 3]}", "order: expected four different elements"),
        ("rotors: {order: [0, 1, 2, 3]}", "order: expected four different elements"),
        ("rotors: {order: 5}", "order: expected four different elements"),
        ("rotors: /n", "states no unit; expected unit: rad/s, rpm, Hz"),
        ("- pose", "expected a mapping of pose, rotors, command, voltage, imu to topics, got list"),
        ("pose: [", "not valid YAML"),
    ],
)
def test_a_wrong_map_is_named(write, topic_map, expected, vehicle):
    path = write(
        "bag", {"/a": pose_topic(), "/motors": actuator_topic(), "/n": array_topic(OURS)}, topic_map
    )
    with pytest.raises(
        InputError, match=f"flight.(bag|topics.yaml): .*{expected}|flight.topics.yaml: {expected}"
    ):
        read_log(path, "rosbag", vehicle)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("topics", "expected"),
    [
        (
            {"/motors": actuator_topic()},
            "pose: no topic of a type that fits; expected one of geometry_msgs/msg/PoseStamped",
        ),
        (
            {"/a": pose_topic()},
            r"rotors: no topic .* in \S*flight.topics.yaml. The bag's topics: /a",
        ),
        (
            {"/a": pose_topic(), "/b": pose_topic(), "/motors": actuator_topic()},
            r"pose: 2 topics could be it \(/a, /b\)",
        ),
        (
            {"/a": pose_topic(times=[]), "/motors": actuator_topic()},
            "pose: topic /a has no messages",
        ),
        (
            {"/a": pose_topic(times=[0.0]), "/motors": actuator_topic()},
            r"/a: 1 message\(s\); expected at least two",
        ),
        ({"/a": pose_topic(), "/motors": actuator_topic(times=WIDE + 9)}, "do not overlap"),
        (
            {"/a": pose_topic(), "/motors": actuator_topic([1, 2, np.nan, 3])},
            "no two samples have four finite rotor speeds",
        ),
    ],
)
def test_what_is_missing_is_named(write, kind, topics, expected, vehicle):
    with pytest.raises(InputError, match=f"flight.*: .*{expected}"):
        read_log(write(kind, topics), "rosbag", vehicle)


@pytest.mark.parametrize("kind", KINDS)
def test_an_empty_bag_is_refused(write, kind, vehicle):
    with pytest.raises(
        InputError, match=r"flight.*(cannot be read as a ROS|The bag's topics: none)"
    ):
        read_log(write(kind, {}), "rosbag", vehicle)


@pytest.mark.parametrize("name", ["flight.bag", "flight.db3", "flight.mcap"])
@pytest.mark.parametrize(
    "content",
    [b"", b"#ROSBAG V1.2\n", b"PK\x03\x04" + bytes(200), b"#ROSBAG V2.0\n", b"\x89MCAP0\r\n"],
)
def test_what_is_no_bag_is_refused(tmp_path, name, content, vehicle):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=rf"{name}: cannot be read as a ROS"):
        read_log(tmp_path / name, "rosbag", vehicle)


def test_what_is_not_there_is_refused(tmp_path, vehicle):
    with pytest.raises(InputError, match=r"absent.bag: cannot be read as a ROS bag"):
        read_log(tmp_path / "absent.bag", "rosbag", vehicle)
    (tmp_path / "flight.csv").write_text("t")
    with pytest.raises(
        InputError, match=r"flight.csv: unknown kind of bag; expected .bag, .db3, .mcap"
    ):
        read_log(tmp_path / "flight.csv", "rosbag", vehicle)
    with pytest.raises(InputError, match=r"cannot be read as a ROS 2 bag: .*metadata"):
        read_log(tmp_path, "rosbag", vehicle)
    with pytest.raises(
        InputError, match=r"is a folder; expected a file, or .* ROS 2 bag, .*; found flight.csv"
    ):
        read_log(tmp_path, None, vehicle)


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("kind", KINDS)
def test_a_cut_or_spoiled_bag_reads_or_is_refused(write, kind, vehicle):
    path = write(kind, {"/a": pose_topic(), "/motors": actuator_topic()})
    file = path if kind == "bag" else next(path.glob(f"*.{kind}"))
    data = file.read_bytes()
    rng = np.random.default_rng(0)
    for k in range(40):
        spoiled = bytearray(data[: rng.integers(0, len(data))] if k % 2 else data)
        for place in rng.integers(0, len(spoiled) + 1, 10 if k % 2 == 0 else 0):
            spoiled[place % len(spoiled)] = rng.integers(256)
        file.write_bytes(spoiled)
        try:
            log = read_log(file, "rosbag", vehicle)
        except InputError:
            continue
        assert np.isfinite(log.rotor_speeds).all()


def test_another_definition_of_a_known_type_is_refused(write, vehicle):
    path = write(
        "bag",
        {"/a": pose_topic(), "/motors": (*actuator_topic(), "float64[] angular_velocities\n")},
    )
    with pytest.raises(
        InputError, match=r"topic /motors: its mav_msgs/msg/Actuators has another definition"
    ):
        read_log(path, "rosbag", vehicle)


def test_a_voltage_that_nobody_asked_for_may_be_unreadable(write, vehicle):
    topics = {
        "/a": pose_topic(),
        "/motors": actuator_topic(),
        "/battery": (*battery_topic(), "float32 voltage\n"),
    }
    path = write("bag", topics)
    log = read_log(path, "rosbag", vehicle)
    assert_motion(log)
    assert log.voltage is None
    assert any("no voltage: " in note and "another definition" in note for note in log.notes)
    path.with_name("flight.topics.yaml").write_text("voltage: /battery")
    with pytest.raises(InputError, match="another definition"):
        read_log(path, "rosbag", vehicle)


PACKED = {
    "bz2": ("bag", (rosbag1.Writer.CompressionFormat.BZ2,)),
    "lz4": ("bag", (rosbag1.Writer.CompressionFormat.LZ4,)),
    "zstd": ("mcap", (rosbag2.CompressionMode.STORAGE, rosbag2.CompressionFormat.ZSTD)),
}


@pytest.mark.parametrize("way", PACKED)
def test_packed_chunks_are_unpacked_up_to_a_limit(way, write, vehicle, monkeypatch):
    kind, packed = PACKED[way]
    path = write(kind, {"/pose": pose_topic(), "/motors": actuator_topic()}, packed=packed)
    assert_motion(read_log(path, "rosbag", vehicle))
    before = dict(reader.decompressors)
    monkeypatch.setattr(unpacking, "LARGEST", 1000)
    with pytest.raises(InputError, match=r"flight.*a chunk unpacks to more than 1000 bytes"):
        read_log(path, "rosbag", vehicle)
    assert reader.decompressors == before  # rosbags is left as it was


@pytest.mark.parametrize("way", PACKED)
def test_chunks_are_counted_over_the_whole_bag(way, write, vehicle, monkeypatch):
    kind, packed = PACKED[way]
    path = write(kind, {"/pose": pose_topic(), "/motors": actuator_topic()}, packed=packed)
    monkeypatch.setattr(unpacking, "LIMITS", replace(LIMITS, bag_unpacked=20_000))
    with pytest.raises(InputError, match="its chunks unpack to more than 20000 bytes"):
        read_log(path, "rosbag", vehicle)


def test_the_index_of_a_bag_is_counted(write, vehicle, monkeypatch):
    path = write("bag", {"/pose": pose_topic(), "/motors": actuator_topic()})
    monkeypatch.setattr(unpacking, "LIMITS", replace(LIMITS, bag_index=100))
    with pytest.raises(InputError, match="its index has more than 100 entries"):
        read_log(path, "rosbag", vehicle)


def test_messages_of_a_topic_are_counted(write, vehicle, monkeypatch):
    path = write("mcap", {"/pose": pose_topic(), "/motors": actuator_topic()})
    monkeypatch.setattr(rosbag, "LIMITS", replace(LIMITS, table_rows=10))
    with pytest.raises(InputError, match="topic /pose: more than 10 messages; expected one flight"):
        read_log(path, "rosbag", vehicle)


@pytest.mark.parametrize(
    "change",
    [
        "CREATE VIEW schema AS SELECT 1 AS schema_version",
        "ALTER TABLE messages ADD COLUMN more BLOB GENERATED ALWAYS AS (zeroblob(1000000000))",
    ],
)
def test_a_database_that_computes_what_it_holds_is_refused(change, write, vehicle):
    path = write("db3", {"/pose": pose_topic(), "/motors": actuator_topic()})
    (file,) = path.glob("*.db3")
    with closing(sqlite3.connect(file)) as database:
        if "VIEW" in change:
            database.execute("DROP TABLE IF EXISTS schema")
        database.execute(change)
        database.commit()
    with pytest.raises(InputError, match=r"\.db3: its (view|table) '\w+' is computed"):
        read_log(path, "rosbag", vehicle)


@pytest.mark.parametrize("mode", [rosbag2.CompressionMode.FILE, rosbag2.CompressionMode.MESSAGE])
def test_files_and_messages_packed_one_by_one_are_refused(mode, write, vehicle):
    path = write(
        "db3",
        {"/pose": pose_topic(), "/motors": actuator_topic()},
        packed=(mode, rosbag2.CompressionFormat.ZSTD),
    )
    with pytest.raises(
        InputError,
        match=rf"metadata.yaml: compression_mode {mode.name.lower()}: expected a bag that is not",
    ):
        read_log(path, "rosbag", vehicle)


def test_without_rosbags_a_bag_says_what_to_install(tmp_path, monkeypatch, vehicle):
    (tmp_path / "flight.bag").write_bytes(b"#ROSBAG V2.0\n")
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(
        InputError, match=r"pip install 'windwrench\[logs\]', or pip install rosbags"
    ):
        read_log(tmp_path / "flight.bag", "rosbag", vehicle)
