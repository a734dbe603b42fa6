"""As much of rclpy as our node asks for, in one process; messages are rosbags' own classes."""

import sys
import types

from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)


class World:
    """The topics of a machine."""

    def __init__(self, topics):
        self.topics = topics  # name: type
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
                world.up = False  # all was said

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


def header(ns, frame="world"):
    t = STORE.types
    time = t["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
    return t["std_msgs/msg/Header"](stamp=time, frame_id=frame)


def pose(ns, position, quaternion):
    t = STORE.types
    w, x, y, z = map(float, quaternion)
    return t["geometry_msgs/msg/PoseStamped"](
        header=header(ns),
        pose=t["geometry_msgs/msg/Pose"](
            position=t["geometry_msgs/msg/Point"](*map(float, position)),
            orientation=t["geometry_msgs/msg/Quaternion"](x=x, y=y, z=z, w=w),
        ),
    )


def array(values):
    import numpy as np

    t = STORE.types
    layout = t["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    return t["std_msgs/msg/Float64MultiArray"](layout=layout, data=np.array(values, dtype=float))
