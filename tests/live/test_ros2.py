"""ROS 2: messages to and from this kit's, as rosbags writes and reads them; and the node, against a
stand-in for rclpy, which is not to be had without a ROS 2 installation.
"""

import importlib.util
import xml.etree.ElementTree as ElementTree
from importlib import resources

import numpy as np
import pytest

from tests.live.stream import VEHICLE, Pipeline, Running, flight
from tests.live.test_pipeline import whole
from windwrench.dynamics import InputError
from windwrench.dynamics.rotation import matrix_of
from windwrench.identification.logs.readers.ros_topics import map_of
from windwrench.live.messages import Malformed
from windwrench.live.sources.open import make_source
from windwrench.live.tallies import Tallies

pytest.importorskip("rosbags", reason="pip install 'windwrench[logs]'")

from tests.support.fake_ros import STORE, World, array, install, pose
from windwrench.live.sources.ros_conversions import (
    ACCELERATION,
    WRENCH,
    TopicReader,
    acceleration_message,
    wrench_message,
)

ARRAY = "std_msgs/msg/Float64MultiArray"


def test_a_pose_that_goes_over_the_wire():
    flown = flight()
    message = pose(1_700_000_000_123_456_789, flown["position"][7], flown["quaternion"][7])
    data = STORE.serialize_cdr(message, "geometry_msgs/msg/PoseStamped")
    again = STORE.deserialize_cdr(data, "geometry_msgs/msg/PoseStamped")
    sample = topics("/p", "geometry_msgs/msg/PoseStamped").sample(again, 5)
    assert sample.stamp == 1_700_000_000_123_456_789
    np.testing.assert_array_equal(sample.position, flown["position"][7])
    np.testing.assert_allclose(sample.quaternion, flown["quaternion"][7], rtol=1e-15)
    turned = topics("/p", "geometry_msgs/msg/PoseStamped", world="ned", body="frd")
    ned = turned.sample(again, 5)
    np.testing.assert_array_equal(ned.position, flown["position"][7] * [1, -1, -1])


def topics(name, kind, rotors=None, **given):
    """The reader of a topic beside others."""
    types = {"/p": "geometry_msgs/msg/PoseStamped", "/m": ARRAY, name: kind}
    said = {"position": "/p", "rotors": {"topic": "/m", "unit": "rad/s"}} | given
    log_map, _ = map_of(types, said | ({"rotors": rotors} if rotors else {}), "ros2", "the map")
    return TopicReader(name, kind, log_map, VEHICLE)


def test_rotors_of_a_multi_array():
    topic = topics("/m", ARRAY, {"topic": "/m", "unit": "rpm", "order": [4, 3, 2, 1]})
    sample = topic.sample(array([10, 20, 30, 40]), 0)
    np.testing.assert_allclose(sample.rotor_speeds, np.array([40, 30, 20, 10]) * np.pi / 30)
    assert sample.stamp is None
    with pytest.raises(Malformed):
        topic.sample(array([1.0, 2.0]), 0)


def test_the_wrench_and_its_twin_as_ros_writes_them():
    output = Pipeline().take(whole(flight())[:200]).outputs[-1]
    wrench = wrench_message(STORE.types.__getitem__, output, "world")
    again = STORE.deserialize_cdr(STORE.serialize_cdr(wrench, WRENCH), WRENCH)
    got = [again.wrench.force.x, again.wrench.force.y, again.wrench.force.z]
    np.testing.assert_array_equal(got, output.estimate.force)
    assert again.wrench.torque.z == output.estimate.torque[2]
    assert (again.header.stamp.sec, again.header.stamp.nanosec) == (0, 995_000_000)
    twin = acceleration_message(STORE.types.__getitem__, output, "world", VEHICLE)
    twin = STORE.deserialize_cdr(STORE.serialize_cdr(twin, ACCELERATION), ACCELERATION)
    covariance = np.array(twin.accel.covariance).reshape(6, 6)
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)[:3]), output.std[:3] / VEHICLE.mass)
    angular = twin.accel.accel.angular
    R = matrix_of(output.estimate.quaternion)
    back = R @ VEHICLE.inertia @ R.T @ [angular.x, angular.y, angular.z]
    np.testing.assert_allclose(back, output.estimate.torque)


def run(monkeypatch, world, text):
    install(monkeypatch, world)
    found = Running(text, horizon=60.0)  # however busy the machine is
    found.thread.join()
    return found


def test_a_node_reads_topics_and_publishes(monkeypatch, tmp_path):
    flown = flight()
    world = World(
        {"/vicon/drone": "geometry_msgs/msg/PoseStamped", "/m": "std_msgs/msg/Float64MultiArray"}
    )
    for k in range(300):
        ns = 1_700_000_000 * 10**9 + round(flown["t"][k] * 1e9)
        world.waiting.append(("/m", array(flown["rotor_speeds"][k])))
        world.waiting.append(
            ("/vicon/drone", pose(ns, flown["position"][k], flown["quaternion"][k]))
        )
    (tmp_path / "topics.yaml").write_text(
        "position: /vicon/drone\nrotors: {topic: /m, unit: rad/s}\n"
    )
    found = run(monkeypatch, world, f"ros2:{tmp_path / 'topics.yaml'}")
    assert len(found.outputs) > 280
    published = world.published["windwrench/wrench"]
    assert len(published) == len(world.published["windwrench/external_acceleration"])
    assert published[-1].header.stamp.sec == 1_700_000_001
    np.testing.assert_array_equal(published[-1].wrench.force.x, found.outputs[-1].estimate.force[0])


def test_a_topic_that_is_not_there_is_told(monkeypatch):
    monkeypatch.setattr("windwrench.live.sources.ros2._FOUND", 0.0)
    world = World({"/other": "geometry_msgs/msg/PoseStamped"})
    said = run(monkeypatch, world, "ros2:?pose=/p&rotors=/m").failed[0]
    assert "no topic /m, /p; found /other" in said


@pytest.mark.skipif(bool(importlib.util.find_spec("rclpy")), reason="ROS 2 is installed here")
def test_no_installation_of_ros_is_told():
    with pytest.raises(InputError, match="rclpy is not there"):
        make_source("ros2:?pose=/p&rotors=/m", VEHICLE, None, Tallies())


def test_the_package_for_ros_is_one():
    folder = resources.files("windwrench.live").joinpath("ros2_package")
    root = ElementTree.fromstring(folder.joinpath("package.xml").read_text())
    assert root.findtext("name") == "windwrench_live"
    assert f"project({root.findtext('name')})" in folder.joinpath("CMakeLists.txt").read_text()
    launch = folder.joinpath("launch/live.launch.py").read_text()
    compile(launch, "live.launch.py", "exec")
    assert "windwrench" in launch
