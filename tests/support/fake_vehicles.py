"""As much of cflib and rclpy as the examples ask for: each plays the rows of a flight."""

import sys
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np


def _install(monkeypatch, modules):
    for name, content in modules.items():
        monkeypatch.setitem(sys.modules, name, SimpleNamespace(**content))


def install_cflib(monkeypatch, flown):
    """A Crazyflie with rpm sensors logs every other row, and takes no set point."""

    def refuse(*setpoint):
        raise AssertionError(f"set point {setpoint}")

    @contextmanager
    def connect(uri):
        toc = SimpleNamespace(get_element=lambda group, name: (group, name) == ("rpm", "m1"))
        commander = SimpleNamespace(send_setpoint=refuse)
        cf = SimpleNamespace(commander=commander, log=SimpleNamespace(toc=toc))
        yield SimpleNamespace(cf=cf)
        commander.send_setpoint(0, 0, 0, 0)  # as cflib ends

    class LogConfig:
        def __init__(self, name, period_in_ms):
            self.names = []
            self.period = period_in_ms

        def add_variable(self, name, fetched):
            self.names.append(name)

    def rows(block):
        for k in range(0, len(flown["t"]), block.period // 5):
            rpm = flown["rotor_speeds"][k][[3, 2, 1, 0]] * 30.0 / np.pi
            values = {f"rpm.m{i + 1}": round(float(x)) for i, x in enumerate(rpm)}
            position = zip("xyz", flown["position"][k].tolist(), strict=True)
            values |= {f"stateEstimate.{axis}": x for axis, x in position}
            values |= {"stateEstimateZ.quat": k, "pm.vbat": 3.9}
            yield round(1e3 * flown["t"][k]), {name: values[name] for name in block.names}, block

    @contextmanager
    def log(crazyflie, block):
        yield rows(block)

    crtp = SimpleNamespace(init_drivers=lambda: None)
    _install(
        monkeypatch,
        {
            "cflib": {"crtp": crtp},
            "cflib.crtp": vars(crtp),
            "cflib.crazyflie": {},
            "cflib.crazyflie.log": {"LogConfig": LogConfig},
            "cflib.crazyflie.syncCrazyflie": {"SyncCrazyflie": connect},
            "cflib.crazyflie.syncLogger": {"SyncLogger": log},
            "cflib.utils": {},
            "cflib.utils.encoding": {
                "decompress_quaternion": lambda k: flown["quaternion"][k][[1, 2, 3, 0]]
            },
        },
    )


def install_rclpy(monkeypatch, flown):
    """Rotor speeds of each row and then its pose, by the topics /m and /p."""
    callbacks = {}

    def subscribe(kind, topic, callback, qos):
        callbacks[topic] = callback

    def spin(node):
        for k, t in enumerate(flown["t"]):
            callbacks["/m"](SimpleNamespace(data=flown["rotor_speeds"][k]))
            stamp = SimpleNamespace(sec=1_700_000_000 + int(t), nanosec=round(1e9 * (t % 1.0)))
            px, py, pz = flown["position"][k].tolist()
            w, x, y, z = flown["quaternion"][k].tolist()
            pose = SimpleNamespace(
                position=SimpleNamespace(x=px, y=py, z=pz),
                orientation=SimpleNamespace(w=w, x=x, y=y, z=z),
            )
            callbacks["/p"](SimpleNamespace(header=SimpleNamespace(stamp=stamp), pose=pose))

    node = SimpleNamespace(create_subscription=subscribe)
    _install(
        monkeypatch,
        {
            "rclpy": {"init": lambda: None, "create_node": lambda name: node, "spin": spin},
            "rclpy.qos": {"qos_profile_sensor_data": None},
            "geometry_msgs": {},
            "geometry_msgs.msg": {"PoseStamped": None},
            "std_msgs": {},
            "std_msgs.msg": {"Float64MultiArray": None},
        },
    )
