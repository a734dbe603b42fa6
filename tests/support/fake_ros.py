"""As much of rclpy as our node asks for, in one process; messages are rosbags' own classes."""

import sys
import types

from tests.support.bag_writer import message, pose_fields, typestore

STORE = typestore(False)


class World:
    """The topics of a machine."""

    def __init__(self, topics, lasts=False):
        self.topics, self.lasts = topics, lasts  # name: type; whether it goes on once all was said
        self.callbacks = {}
        self.waiting = []
        self.published = {}
        self.up = True


def install(monkeypatch, world):
    """Put the modules in the place of ROS 2's."""

    class Node:
        def get_topic_names_and_types(self):
            return [(name, [kind]) for name, kind in world.topics.items()]

        def create_subscription(self, kind, topic, callback, qos):
            assert kind is STORE.types[world.topics[topic]]
            world.callbacks[topic] = callback

        def create_publisher(self, kind, topic, depth):
            got = world.published.setdefault(topic, [])
            return types.SimpleNamespace(publish=got.append)

        def destroy_node(self):
            world.callbacks.clear()

    class Executor:
        def add_node(self, node):
            pass

        def spin_once(self, timeout_sec):
            if world.waiting:
                topic, message = world.waiting.pop(0)
                world.callbacks[topic](message)
            elif world.callbacks:
                world.up = world.lasts

    def shut():
        world.up = False

    modules = {
        "rclpy": {
            "init": lambda: None,
            "create_node": lambda name: Node(),
            "ok": lambda: world.up,
            "shutdown": shut,
            "__spec__": types.SimpleNamespace(),
        },
        "rclpy.executors": {"SingleThreadedExecutor": Executor},
        "rclpy.qos": {"qos_profile_sensor_data": None},
        "rosidl_runtime_py": {},
        "rosidl_runtime_py.utilities": {"get_message": lambda name: STORE.types[name]},
    }
    for name, content in modules.items():
        module = types.ModuleType(name)
        module.__dict__.update(content)
        monkeypatch.setitem(sys.modules, name, module)


def pose(ns, position, quaternion):
    """A pose that was stamped at a time in ns."""
    header = {"stamp": {"sec": ns // 10**9, "nanosec": ns % 10**9}, "frame_id": "world"}
    fields = {"header": header, "pose": pose_fields(position, quaternion)}
    return message(STORE, "geometry_msgs/msg/PoseStamped", fields)


def array(values):
    """Numbers without a unit."""
    return message(STORE, "std_msgs/msg/Float64MultiArray", {"data": values})
