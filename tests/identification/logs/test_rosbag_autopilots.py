"""Bags of PX4 (px4_msgs), MAVROS and simulators (actuator_msgs), and which topic is taken where
several could be it.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from windwrench.dynamics import InputError, load_vehicle
from windwrench.identification.logs.reading import read_log

pytest.importorskip("rosbags", reason="rosbags is not installed: pip install 'windwrench[logs]'")

from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from windwrench.identification.logs.readers.ros_messages import definitions

START = 1_700_000_000_000_000_000  # ns
FLIP = np.diag([1.0, -1.0, -1.0])
T = 0.01 * np.arange(100)
OURS = np.array([301.0, 302.0, 303.0, 304.0])
PX4 = OURS[[3, 1, 0, 2]]  # 1 front-right, 2 rear-left, 3 front-left, 4 rear-right
SHARE = OURS / 1000.0  # commands


def motion(t):
    position = np.column_stack([0.5 * np.cos(t), 0.8 * np.sin(t), 1.0 + 0.1 * t])
    angles = np.column_stack([2.0 + 1.5 * t, 0.2 * np.sin(2 * t), 0.3 * np.cos(t)])
    return position, Rotation.from_euler("ZYX", angles)


def inertial(t):
    turn, after = motion(t)[1], motion(t + 1e-5)[1]
    acceleration = np.column_stack([-0.5 * np.cos(t), -0.8 * np.sin(t), np.full(len(t), 9.81)])
    return (turn.inv() * after).as_rotvec() / 1e-5, turn.inv().apply(acceleration)


class Maker:
    """Makes messages of one typestore and one variant of what is defined here."""

    def __init__(self, ros1, variant=0):
        self.ros1 = ros1
        self.store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        for name, text in definitions()[variant].items():
            self.store.register(get_types_from_msg(text, name))

    def make(self, kind, **fields):
        """Return a message; fields that are not given are zero."""
        cls = self.store.types[kind]
        names = [name for name in cls.__dataclass_fields__ if not name.startswith("__")]
        full = {name: fields.get(name, 0) for name in names}
        for name in names:
            if "covariance" in name and name not in fields:
                full[name] = np.zeros(21, np.float32)
            elif name in ("q_offset",) and name not in fields:
                full[name] = np.zeros(4, np.float32)
            elif name.endswith("_variance") or name in ("velocity", "angular_velocity"):
                full[name] = fields.get(name, np.zeros(3, np.float32))
        return cls(**full)

    def header(self, t):
        at = START + round(1e9 * t)
        stamp = self.store.types["builtin_interfaces/msg/Time"](at // 10**9, at % 10**9)
        return self.store.types["std_msgs/msg/Header"](*([0] if self.ros1 else []), stamp, "")

    def vector(self, values, kind="Vector3"):
        return self.store.types[f"geometry_msgs/msg/{kind}"](*map(float, values))

    def pose_stamped(self, t):
        (p,), turn = motion(np.array([t]))
        quaternion = self.vector(turn.as_quat()[0], "Quaternion")
        pose = self.store.types["geometry_msgs/msg/Pose"](self.vector(p, "Point"), quaternion)
        return self.store.types["geometry_msgs/msg/PoseStamped"](self.header(t), pose)

    def odometry(self, t):
        (p,), turn = motion(np.array([t]))
        p = (FLIP @ p).astype(np.float32)
        matrix = FLIP @ turn.as_matrix()[0] @ FLIP
        q = Rotation.from_matrix(matrix).as_quat(scalar_first=True).astype(np.float32)
        stamps = {"timestamp": (START // 1000) + round(1e6 * t)}
        stamps["timestamp_sample"] = stamps["timestamp"]
        kind = "px4_msgs/msg/VehicleOdometry"
        if "position" in self.store.types[kind].__dataclass_fields__:
            return self.make(kind, **stamps, pose_frame=1, position=p, q=q)
        x, y, z = map(float, p)
        return self.make(kind, **stamps, local_frame=0, x=x, y=y, z=z, q=q)

    def esc_status(self, t):
        reports = [
            self.make(
                "px4_msgs/msg/EscReport",
                esc_rpm=round(w * 30 / np.pi),
                actuator_function=101 + i,
            )
            for i, w in enumerate([*PX4, 0, 0, 0, 0])
        ]
        return self.make(
            "px4_msgs/msg/EscStatus",
            timestamp=START // 1000 + round(1e6 * t),
            esc=reports[::-1],  # each says which motor it drives
        )

    def actuator_motors(self, t):
        control = np.full(12, np.nan, np.float32)
        control[:4] = SHARE[[3, 1, 0, 2]]
        return self.make(
            "px4_msgs/msg/ActuatorMotors",
            timestamp=START // 1000 + round(1e6 * t),
            timestamp_sample=START // 1000 + round(1e6 * t),
            control=control,
        )

    def sensor_combined(self, t):
        (gyro,), (force,) = inertial(np.array([t]))
        return self.make(
            "px4_msgs/msg/SensorCombined",
            timestamp=START // 1000 + round(1e6 * t),
            gyro_rad=(FLIP @ gyro).astype(np.float32),
            accelerometer_m_s2=(FLIP @ force).astype(np.float32),
        )

    def imu(self, t):
        (gyro,), (force,) = inertial(np.array([t]))
        return self.store.types["sensor_msgs/msg/Imu"](
            self.header(t),
            self.vector([0, 0, 0, 1], "Quaternion"),
            np.zeros(9),
            self.vector(gyro),
            np.zeros(9),
            self.vector(force),
            np.zeros(9),
        )

    def rc_out(self, t):
        channels = np.array([*(1000 + 1000 * SHARE[[3, 1, 0, 2]]), 0, 0], np.uint16)
        return self.make("mavros_msgs/msg/RCOut", header=self.header(t), channels=channels)

    def mavros_esc(self, t):
        items = [
            self.make(
                "mavros_msgs/msg/ESCStatusItem", header=self.header(t), rpm=round(w * 30 / np.pi)
            )
            for w in PX4
        ]
        return self.make("mavros_msgs/msg/ESCStatus", header=self.header(t), esc_status=items)

    def actuators(self, t):
        return self.make(
            "actuator_msgs/msg/Actuators",
            header=self.header(t),
            position=np.zeros(0),
            velocity=np.array(OURS),
            normalized=np.array(SHARE),
        )

    def doubles(self, t):
        layout = self.store.types["std_msgs/msg/MultiArrayLayout"]([], 0)
        return self.store.types["std_msgs/msg/Float64MultiArray"](layout, np.array(OURS))


KINDS = {
    "pose_stamped": "geometry_msgs/msg/PoseStamped",
    "odometry": "px4_msgs/msg/VehicleOdometry",
    "esc_status": "px4_msgs/msg/EscStatus",
    "actuator_motors": "px4_msgs/msg/ActuatorMotors",
    "sensor_combined": "px4_msgs/msg/SensorCombined",
    "imu": "sensor_msgs/msg/Imu",
    "rc_out": "mavros_msgs/msg/RCOut",
    "mavros_esc": "mavros_msgs/msg/ESCStatus",
    "actuators": "actuator_msgs/msg/Actuators",
    "doubles": "std_msgs/msg/Float64MultiArray",
}


@pytest.fixture
def write(tmp_path):
    def to_bag(topics, kind="mcap", variant=0, name="flight"):
        """Write ``{topic: name of what Maker makes}`` and return the bag's path."""
        ros1 = kind == "bag"
        maker = Maker(ros1, variant)
        path = tmp_path / (f"{name}.bag" if ros1 else name)
        plugin = rosbag2.StoragePlugin.MCAP if kind == "mcap" else rosbag2.StoragePlugin.SQLITE3
        writer = (
            rosbag1.Writer(path) if ros1 else rosbag2.Writer(path, version=8, storage_plugin=plugin)
        )
        with writer:
            for topic, what in topics.items():
                connection = writer.add_connection(topic, KINDS[what], typestore=maker.store)
                for t in T:
                    message = getattr(maker, what)(t)
                    serialize = maker.store.serialize_ros1 if ros1 else maker.store.serialize_cdr
                    raw = serialize(message, KINDS[what])
                    writer.write(connection, START + round(1e9 * t), raw)
        return path

    return to_bag


def assert_pose(log):
    position, turn = motion(log.t)
    np.testing.assert_allclose(log.position, position, atol=1e-6)
    seen = Rotation.from_quat(log.quaternion, scalar_first=True)
    assert (turn.inv() * seen).magnitude().max() < 1e-5


def assert_inertial(log):
    gyro, force = inertial(log.t)
    np.testing.assert_allclose(log.gyro, gyro, atol=1e-5)
    np.testing.assert_allclose(log.accelerometer, force, atol=1e-4)


@pytest.mark.parametrize("kind", ["mcap", "db3"])
@pytest.mark.parametrize("variant", range(len(definitions())))
def test_messages_of_px4_of_several_years(write, kind, variant):
    topics = {
        "/fmu/out/vehicle_odometry": "odometry",
        "/fmu/out/esc_status": "esc_status",
        "/fmu/out/actuator_motors": "actuator_motors",
        "/fmu/out/sensor_combined": "sensor_combined",
    }
    log = read_log(write(topics, kind, variant))
    assert_pose(log)
    assert_inertial(log)
    np.testing.assert_allclose(log.rotor_speeds, np.tile(OURS, (len(T), 1)), atol=0.06)
    np.testing.assert_allclose(log.command, np.tile(SHARE, (len(T), 1)), atol=1e-6)
    assert any("px4-x, which the bag does not state" in note for note in log.notes)


@pytest.mark.parametrize("kind", ["bag", "mcap"])
def test_messages_of_mavros(write, kind):
    topics = {
        "/mavros/local_position/pose": "pose_stamped",
        "/mavros/setpoint_position/local": "pose_stamped",
        "/mavros/imu/data": "imu",
        "/mavros/imu/data_raw": "imu",
        "/mavros/rc/out": "rc_out",
    }
    log = read_log(write(topics, kind))
    assert_pose(log)
    assert_inertial(log)
    np.testing.assert_allclose(log.command, np.tile(SHARE, (len(T), 1)), atol=1e-3)
    assert not log.has_rotor_speeds
    text = " ".join(log.notes)
    assert "pulses of 1000 to 2000 us" in text
    assert "/mavros/imu/data (sensor_msgs/msg/Imu), chosen by its name before" in text
    topics |= {"/mavros/esc_status": "mavros_esc"}
    log = read_log(write(topics | {"/vrpn/drone/pose": "pose_stamped"}, kind, name="second"))
    np.testing.assert_allclose(log.rotor_speeds[0], OURS, atol=0.06)
    assert any("/vrpn/drone/pose" in n and "chosen by its name before" in n for n in log.notes)


def test_actuators_of_gazebo_and_a_named_order(write):
    path = write({"/pose": "pose_stamped", "/motors": "actuators"})
    log = read_log(path)
    np.testing.assert_allclose(log.rotor_speeds[0], OURS)
    np.testing.assert_allclose(log.command[0], SHARE)
    path.with_name("flight.topics.yaml").write_text("rotors: {topic: /motors, order: crazyflie}")
    np.testing.assert_allclose(read_log(path).rotor_speeds[0], OURS[::-1])
    path.with_name("flight.topics.yaml").write_text("rotors: {topic: /motors, order: dji}")
    with pytest.raises(InputError, match=r"expected four different elements|unknown order 'dji'"):
        read_log(path)


def test_without_a_pose_an_imu_will_do(write):
    log = read_log(write({"/imu": "imu", "/motors": "actuators"}))
    assert not log.has_pose
    assert_inertial(log)
    with pytest.raises(InputError, match="pose: no topic of a type that fits"):
        read_log(write({"/motors": "actuators"}, "bag"))


def test_an_array_without_a_unit_is_named_with_what_to_write(write):
    path = write({"/pose": "pose_stamped", "/motors": "doubles"})
    with pytest.raises(
        InputError,
        match=r"rotors: /motors could be it, but a multi-array states no unit; expected in \S+"
        r"flight.topics.yaml the line rotors: {topic: /motors, unit: rad/s}",
    ):
        read_log(path)
    lines = {
        "rotors: {topic: /motors, unit: rad/s}": OURS,
        "command: {topic: /motors, unit: normalized, range: [0, 1000]}": SHARE,
    }
    for line, wanted in lines.items():
        path.with_name("flight.topics.yaml").write_text(line)
        log = read_log(path, None, load_vehicle("ardrone2"))
        found = log.command if log.command is not None else log.rotor_speeds
        np.testing.assert_allclose(found[0], wanted)
    path.with_name("flight.topics.yaml").write_text(
        "command: {topic: /motors, unit: us, range: [2, 1]}"
    )
    with pytest.raises(
        InputError, match=r"range: \[2, 1\]; expected the values of the commands 0 and 1"
    ):
        read_log(path)


def test_several_poses_that_no_rule_tells_apart_are_listed(write):
    topics = {"/a": "pose_stamped", "/b": "pose_stamped", "/motors": "actuators"}
    with pytest.raises(InputError, match=r"pose: 2 topics could be it \(/a, /b\); expected one"):
        read_log(write(topics | {"/imu": "imu"}))
    only = {"/goal_pose": "pose_stamped", "/motors": "actuators"}
    with pytest.raises(InputError, match=r"no topic but set-points by their names \(/goal_pose\)"):
        read_log(write(only, "bag"))
