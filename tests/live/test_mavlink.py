"""MAVLink by UDP on the loopback, with pymavlink at both ends: a sender that plays a flight."""

import os
from dataclasses import replace

import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from tests.live.stream import (
    HALF,
    MOTORS,
    NED,
    VEHICLE,
    Running,
    flight,
    free_port,
    send_odometry,
    send_rotors,
)
from windwrench.dynamics import EffectSetting
from windwrench.dynamics.vehicle import MotorCurve
from windwrench.live.sources.esc_status import CHECKSUM, add_esc_status

pytest.importorskip("pymavlink", reason="pip install 'windwrench[mavlink]'")

os.environ.setdefault("MAVLINK20", "1")
from pymavlink import mavutil
from pymavlink.dialects.v20 import common

ESC_STATUS = add_esc_status(common)


class Autopilot(Running):
    """A vehicle that plays a flight into a session."""

    def __init__(self, vehicle=VEHICLE, options="?pose=ODOMETRY", **settings):
        self.port = free_port()
        super().__init__(f"mavlink:udp://127.0.0.1:{self.port}{options}", vehicle, **settings)
        self.until(lambda: self.source.link.opened is not None)
        self.link = mavutil.mavlink_connection(
            f"udpout:127.0.0.1:{self.port}", source_system=7, source_component=1, dialect="common"
        )
        self.mav = self.link.mav

    def play(self, rows, motors=None, pose="ODOMETRY", beside=lambda k: None):
        """Play rows of the flight, each taken before the next."""
        taken = self.count(pose)
        for n, k in enumerate(rows):
            (motors or self.esc)(k)
            beside(k)
            self.pose(k, pose)
            self.taken(pose, taken + n + 1)
        return self

    def pose(self, k, kind="ODOMETRY"):
        x, y, z = flight()["position"][k] * NED
        q = flight()["quaternion"][k] * HALF
        us = self.us(k)
        if kind == "ODOMETRY":
            send_odometry(self.mav, us, flight(), k)
        elif kind == "ATT_POS_MOCAP":
            self.mav.att_pos_mocap_send(us, q, x, y, z)
        elif kind == "VISION_POSITION_ESTIMATE":
            yaw, pitch, roll = Rotation.from_quat(q, scalar_first=True).as_euler("ZYX")
            self.mav.vision_position_estimate_send(us, x, y, z, roll, pitch, yaw)
        else:
            self.mav.attitude_quaternion_send(us // 1000, *q, 0, 0, 0)
            self.mav.local_position_ned_send(us // 1000, x, y, z, 0, 0, 0)

    def us(self, k):
        return round(flight()["t"][k] * 1e6)

    def esc(self, k):
        send_rotors(self.mav, ESC_STATUS, self.us(k), flight(), k)

    def end(self):
        super().end()
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


@pytest.mark.parametrize(
    "pose", ["ODOMETRY", "ATT_POS_MOCAP", "VISION_POSITION_ESTIMATE", "LOCAL_POSITION_NED"]
)
def test_each_pose_in_the_kits_frames(pose):
    pilot = Autopilot(options=f"?pose={pose}").play(range(100, 200), pose=pose).end()
    assert not pilot.failed
    assert len(pilot.outputs) == 100
    row = pilot.outputs[50].row
    flown = flight()
    k = 150
    assert_allclose(row.position, flown["position"][k], atol=1e-6)
    assert abs(row.quaternion @ flown["quaternion"][k]) == pytest.approx(1.0, abs=1e-6)
    assert_allclose(row.rotor_speeds, flown["rotor_speeds"][k], atol=0.06)


def test_a_flight_with_faults():
    """Messages lost, doubled, and bytes that are none are counted; the estimates go on."""
    pilot = Autopilot()
    pilot.play(range(300))
    pilot.mav.seq = (pilot.mav.seq + 20) % 256  # 10 rows are lost
    pilot.play(range(310, 500))
    pilot.pose(499)  # once more
    pilot.taken("ODOMETRY", 491)
    pilot.play(range(500, 600))
    pilot.link.port.sendto(b"garbage that is none", ("127.0.0.1", pilot.port))
    pilot.until(lambda: pilot.tallies.counts["malformed"] > 0)
    pilot.end()
    counts = dict(pilot.tallies.counts)
    assert counts.pop("malformed") > 0
    assert counts == {"lost": 20, "doubled": 1}
    assert not pilot.failed
    assert pilot.outputs[-1].estimate.status == "tracking"


def test_of_two_vehicles_at_one_address_one_is_listened_to():
    """The second has another number and comes from elsewhere; a ground station disturbs nobody."""
    pilot = Autopilot()
    away = flight() | {"position": flight()["position"] + [9.0, 0.0, 0.0]}
    other, station = (
        mavutil.mavlink_connection(
            f"udpout:127.0.0.1:{pilot.port}",
            source_system=number,
            source_component=component,
            dialect="common",
        )
        for number, component in ((8, 1), (255, 190))
    )

    def beside(k):
        station.mav.heartbeat_send(common.MAV_TYPE_GCS, common.MAV_AUTOPILOT_INVALID, 0, 0, 0)
        if k > 20:
            q = flight()["quaternion"][k] * HALF
            other.mav.att_pos_mocap_send(pilot.us(k), q, 9.0, 0.0, 0.0)
            send_odometry(other.mav, pilot.us(k), away, k)

    pilot.play(range(200), beside=beside)
    pilot.until(lambda: pilot.tallies.counts["other senders"] >= 179)
    pilot.end()
    other.close()
    station.close()
    assert not pilot.failed
    assert len(pilot.outputs) == 200
    assert max(abs(o.row.position[0]) for o in pilot.outputs) < 5.0
    (said,) = [line for line in pilot.tallies.news() if "send the same" in line]
    assert "system 7 at 127.0.0.1:" in said
    assert "and system 8 at 127.0.0.1:" in said


def test_the_wrench_comes_back_in_the_vehicles_own_frame():
    drag = EffectSetting("rotor_drag", {"kdx": 1.2e-4, "kdy": 1.2e-4})
    pilot = Autopilot(VEHICLE.with_effects(drag)).play(range(100))
    got = {}
    while (message := pilot.link.recv_match(blocking=True, timeout=1.0)) is not None:
        got.setdefault(message.get_type(), []).append(message)
        if len(got.get("DEBUG_FLOAT_ARRAY", [])) == 100:
            break
    last = got["DEBUG_FLOAT_ARRAY"][-1]
    output = pilot.end().outputs[-1]
    assert last.name == "wrench"
    wanted = [*output.estimate.force * NED, *output.estimate.torque * NED, *output.std]
    assert_allclose(last.data[:12], wanted, rtol=1e-5, atol=1e-8)
    assert {m.name for m in got["NAMED_VALUE_FLOAT"]} >= {"force_n", "force_d", "torque_e"}
    assert {"HEARTBEAT", "WIND_COV"} <= set(got)


def test_commands_by_the_motor_curve_and_none_without():
    speeds = flight()["rotor_speeds"]
    curve = MotorCurve((0.0, 0.0, float(VEHICLE.k[0] * 650.0**2)), command=(1000.0, 2000.0))
    for vehicle in (replace(VEHICLE, motor_curve=curve), VEHICLE):
        pilot = Autopilot(vehicle)

        def servo(k, pilot=pilot):
            pulses = [round(1000 + 1000 * w / 650.0) for w in speeds[k][MOTORS]]
            pilot.mav.servo_output_raw_send(pilot.us(k), 0, *pulses, 0, 0, 0, 0)

        pilot.play(range(400), servo).end()
        if vehicle.motor_curve is None:
            assert "states no motor_curve" in pilot.failed[0]
        else:
            row = pilot.outputs[-1].row
            assert row.commanded
            assert_allclose(row.rotor_speeds, speeds[399], atol=0.4)


def test_gyro_accelerometer_and_battery():
    flown = flight(4.0, "gentle", imu=True)
    pilot = Autopilot()

    def beside(k):
        a = flown["accelerometer"][k] * NED
        g = flown["gyro"][k] * NED
        pilot.mav.highres_imu_send(pilot.us(k), *a, *g, 0, 0, 0, 0, 0, 0, 0, 0x3F)
        if k == 10:
            pilot.mav.battery_status_send(0, 0, 0, 0, [3700] * 3 + [65535] * 7, -1, -1, -1, 90)

    pilot.play(range(200), beside=beside).end()
    assert not pilot.failed
    imu = [o.row for o in pilot.outputs if o.row.gyro is not None]
    assert_allclose(imu[-1].gyro, flown["gyro"][199], atol=1e-6)
    assert_allclose(imu[-1].accelerometer, flown["accelerometer"][199], atol=1e-5)
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
    pilot = Autopilot(wait=0.5)
    for k in range(20):
        pilot.pose(k)
    said = pilot.end_by_itself()
    assert "poses came (ODOMETRY), and no rotor speeds within 0.5 s" in said
    assert "came: ODOMETRY" in said
