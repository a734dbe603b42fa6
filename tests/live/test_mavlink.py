"""MAVLink by UDP on the loopback, with pymavlink at both ends: a sender that plays a flight."""

import os
import threading
from dataclasses import replace

import numpy as np
import pytest

from tests.live.stream import flight
from windwrench.dynamics import EffectSetting, InputError, load_vehicle
from windwrench.dynamics.vehicle import MotorCurve
from windwrench.live.session import Session, SessionSettings
from windwrench.live.sources.esc_status import CHECKSUM, add_esc_status
from windwrench.live.sources.open import make_source
from windwrench.live.tallies import Tallies

pytest.importorskip(
    "pymavlink", reason="pymavlink is not installed: pip install windwrench[mavlink]"
)

os.environ.setdefault("MAVLINK20", "1")
from pymavlink import mavutil
from pymavlink.dialects.v20 import common

VEHICLE = load_vehicle("ardrone2")
ESC_STATUS = add_esc_status(common)
NED = np.array([1.0, -1.0, -1.0])
HALF = np.array([1.0, 1.0, -1.0, -1.0])
MOTORS = [3, 1, 0, 2]  # the kit's rotors that are PX4's motors 1 to 4
IDENTITY = [0.0] * 21


class Autopilot:
    """A vehicle that plays a flight into a session."""

    def __init__(self, vehicle=VEHICLE, options="", **settings):
        self.tallies, self.outputs, self.failed = Tallies(), [], []
        self.port = _free_port()
        source = make_source(
            f"mavlink:udp://127.0.0.1:{self.port}{options}", vehicle, None, self.tallies
        )
        self.session = Session(
            source,
            vehicle,
            self.tallies,
            settings=SessionSettings(**{"wait": 0.0} | settings),
            tell=self.outputs.append,
        )
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()
        while source.link.opened is None and self.thread.is_alive():
            self.thread.join(0.005)
        self.link = mavutil.mavlink_connection(
            f"udpout:127.0.0.1:{self.port}", source_system=7, source_component=1, dialect="common"
        )
        self.mav = self.link.mav
        self.sent = 0

    def _run(self):
        try:
            self.session.run()
        except InputError as error:
            self.failed.append(str(error))

    def pose(self, flown, k, clock=0, kind="odometry"):
        x, y, z = flown["position"][k] * NED
        q = flown["quaternion"][k] * HALF
        us = round(flown["t"][k] * 1e6) + clock
        if kind == "odometry":
            self.mav.odometry_send(
                us, 1, 12, x, y, z, q, 0, 0, 0, 0, 0, 0, IDENTITY, IDENTITY, 0, 0, 0
            )
        elif kind == "mocap":
            self.mav.att_pos_mocap_send(us, q, x, y, z)
        elif kind == "vision":
            from scipy.spatial.transform import Rotation

            yaw, pitch, roll = Rotation.from_quat(q, scalar_first=True).as_euler("ZYX")
            self.mav.vision_position_estimate_send(us, x, y, z, roll, pitch, yaw)
        elif kind == "local":
            self.mav.attitude_quaternion_send(us // 1000, *q, 0, 0, 0)
            self.mav.local_position_ned_send(us // 1000, x, y, z, 0, 0, 0)

    def esc(self, flown, k, clock=0):
        rpm = [round(w * 30 / np.pi) for w in flown["rotor_speeds"][k][MOTORS]]
        us = round(flown["t"][k] * 1e6) + clock
        self.mav.send(ESC_STATUS(0, us, rpm, [11.0] * 4, [1.0] * 4))

    def settle(self, kind, count):
        """Wait until so many messages of a kind were taken."""
        rates = self.tallies.rates
        while self.thread.is_alive() and not (kind in rates and rates[kind].count >= count):
            self.thread.join(0.002)

    def end(self):
        self.session.stop()
        self.thread.join()
        self.link.close()
        return self


def test_the_checksum_of_esc_status_is_that_of_its_definition():
    from pymavlink.generator.mavcrc import x25crc

    crc = x25crc()
    crc.accumulate_str("ESC_STATUS ")
    for kind, name, length in (
        ("uint64_t", "time_usec", 0),
        ("int32_t", "rpm", 4),
        ("float", "voltage", 4),
        ("float", "current", 4),
        ("uint8_t", "index", 0),
    ):
        crc.accumulate_str(f"{kind} {name} ")
        if length:
            crc.accumulate(bytearray([length]))
    assert (crc.crc & 0xFF) ^ (crc.crc >> 8) == CHECKSUM


def _free_port():
    import socket

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("odometry", "ODOMETRY"),
        ("mocap", "ATT_POS_MOCAP"),
        ("vision", "VISION_POSITION_ESTIMATE"),
        ("local", "LOCAL_POSITION_NED"),
    ],
)
def test_each_pose_in_the_kits_frames(kind, name):
    flown, pilot = flight(), Autopilot(options=f"?pose={name}")
    for k in range(100, 200):
        pilot.esc(flown, k)
        pilot.pose(flown, k, kind=kind)
        pilot.settle(name, k - 99)
    pilot.end()
    assert not pilot.failed
    assert len(pilot.outputs) == 100
    row, k = pilot.outputs[50].row, 150
    np.testing.assert_allclose(row.position, flown["position"][k], atol=1e-6)
    assert abs(row.quaternion @ flown["quaternion"][k]) == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_allclose(row.rotor_speeds, flown["rotor_speeds"][k], atol=0.06)


def test_a_flight_with_faults():
    """Messages lost, doubled, reordered, and a source that stops and comes back: counted, and the
    wrench is right again.
    """
    flown, pilot = flight(), Autopilot(options="?pose=ODOMETRY")
    lost = set(range(300, 310))
    rows = [k for k in range(1400) if not 800 <= k < 920]  # 0.6 s of silence
    swapped = {500: 501, 501: 500}
    taken = 0
    for k in rows:
        if k in lost:
            pilot.mav.seq = (pilot.mav.seq + 2) % 256
            continue
        pilot.esc(flown, k)
        pilot.pose(flown, swapped.get(k, k))
        taken += 1
        if k == 600:
            pilot.pose(flown, k)
            taken += 1
        pilot.settle("ODOMETRY", taken)
    pilot.end()
    counts = dict(pilot.tallies.counts)
    assert counts.pop("late") >= 1
    counts.pop("stops", None)  # of the sender, on a busy machine
    assert counts == {"lost": 20, "doubled": 1}
    assert not pilot.failed
    found = np.mean([o.estimate.force for o in pilot.outputs if o.t > 6.0], axis=0)
    assert np.abs(found - flown["force"][1200:1400].mean(axis=0)).max() < 0.1


def test_the_wrench_comes_back_in_the_vehicles_own_frame():
    flown = flight()
    drag = EffectSetting("rotor_drag", {"kdx": 1.2e-4, "kdy": 1.2e-4})
    pilot = Autopilot(VEHICLE.with_effects(drag), options="?pose=ODOMETRY")
    for k in range(100):
        pilot.esc(flown, k)
        pilot.pose(flown, k)
        pilot.settle("ODOMETRY", k + 1)
    got = {}
    while (message := pilot.link.recv_match(blocking=True, timeout=1.0)) is not None:
        got.setdefault(message.get_type(), []).append(message)
        if len(got.get("DEBUG_FLOAT_ARRAY", [])) == 100:
            break
    pilot.end()
    last, output = got["DEBUG_FLOAT_ARRAY"][-1], pilot.outputs[-1]
    assert last.name == "wrench"
    np.testing.assert_allclose(last.data[:3], output.estimate.force * NED, rtol=1e-5, atol=1e-8)
    np.testing.assert_allclose(last.data[3:6], output.estimate.torque * NED, rtol=1e-5, atol=1e-8)
    np.testing.assert_allclose(last.data[6:12], output.std, rtol=1e-5)
    assert {m.name for m in got["NAMED_VALUE_FLOAT"]} >= {"force_n", "force_d", "torque_e"}
    assert {"HEARTBEAT", "WIND_COV"} <= set(got)


def test_commands_by_the_motor_curve_and_none_without():
    flown = flight()
    curve = MotorCurve((0.0, 0.0, float(VEHICLE.k[0] * 650.0**2)), command=(1000.0, 2000.0))
    for vehicle in (replace(VEHICLE, motor_curve=curve), VEHICLE):
        pilot = Autopilot(vehicle, options="?pose=ODOMETRY")
        for k in range(400):
            us = round(flown["t"][k] * 1e6)
            pulses = [round(1000 + 1000 * w / 650.0) for w in flown["rotor_speeds"][k][MOTORS]]
            pilot.mav.servo_output_raw_send(us, 0, *pulses, 0, 0, 0, 0)
            pilot.pose(flown, k)
            pilot.settle("ODOMETRY", k + 1)
        pilot.end()
        if vehicle.motor_curve is None:
            assert "states no motor_curve" in pilot.failed[0]
        else:
            row = pilot.outputs[-1].row
            assert row.commanded
            np.testing.assert_allclose(row.rotor_speeds, flown["rotor_speeds"][399], atol=0.4)


def test_gyro_accelerometer_and_battery():
    flown = flight(4.0, "gentle", imu=True)
    pilot = Autopilot(options="?pose=ODOMETRY")
    for k in range(200):
        us = round(flown["t"][k] * 1e6)
        pilot.esc(flown, k)
        a, g = flown["accelerometer"][k] * NED, flown["gyro"][k] * NED
        pilot.mav.highres_imu_send(us, *a, *g, 0, 0, 0, 0, 0, 0, 0, 0x3F)
        pilot.pose(flown, k)
        if k == 10:
            pilot.mav.battery_status_send(0, 0, 0, 0, [3700] * 3 + [65535] * 7, -1, -1, -1, 90)
        pilot.settle("ODOMETRY", k + 1)
    pilot.end()
    assert not pilot.failed
    imu = [o.row for o in pilot.outputs if o.row.gyro is not None]
    np.testing.assert_allclose(imu[-1].gyro, flown["gyro"][199], atol=1e-6)
    np.testing.assert_allclose(imu[-1].accelerometer, flown["accelerometer"][199], atol=1e-5)
    assert imu[-1].voltage == pytest.approx(11.1)


def test_the_autopilot_is_asked_for_its_messages():
    pilot = Autopilot(options="?rate=100")
    pilot.mav.heartbeat_send(common.MAV_TYPE_QUADROTOR, common.MAV_AUTOPILOT_PX4, 0, 0, 0)
    asked = set()
    while (m := pilot.link.recv_match(type="COMMAND_LONG", blocking=True, timeout=2.0)) is not None:
        asked.add((m.command, m.param1, m.param2))
        if (common.MAV_CMD_SET_MESSAGE_INTERVAL, 147.0, 10_000.0) in asked:
            break
    pilot.end()
    assert (common.MAV_CMD_SET_MESSAGE_INTERVAL, 331.0, 10_000.0) in asked  # ODOMETRY


def test_a_stream_without_motors_says_what_came():
    flown, pilot = flight(), Autopilot(options="?pose=ODOMETRY", wait=0.5)
    for k in range(20):
        pilot.pose(flown, k)
    pilot.thread.join()
    pilot.end()
    assert "poses came (ODOMETRY), and no rotor speeds within 0.5 s" in pilot.failed[0]
    assert "came: ODOMETRY" in pilot.failed[0]


def test_bytes_that_are_no_mavlink_are_counted():
    flown, pilot = flight(), Autopilot(options="?pose=ODOMETRY")
    for k in range(60):
        pilot.esc(flown, k)
        pilot.pose(flown, k)
        if k == 30:
            pilot.link.port.sendto(b"\xfd\x05garbage that is none", ("127.0.0.1", pilot.port))
        pilot.settle("ODOMETRY", k + 1)
    pilot.end()
    assert pilot.tallies.counts["malformed"] > 0
    assert len(pilot.outputs) == 60


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("mavlink:udp://127.0.0.1", "no port"),
        ("mavlink:/dev/no-such-port", "no such port"),
        ("mavlink:", "expected mavlink:udp"),
        ("mavlink:udp://127.0.0.1:14550?pose=GPS", "pose=GPS: expected one of"),
    ],
)
def test_no_autopilot(text, said):
    with pytest.raises(InputError, match=said):
        make_source(text, VEHICLE, None, Tallies())
