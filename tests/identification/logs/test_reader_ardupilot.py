"""ArduPilot's DataFlash logs: a real one on the ground, read as pymavlink reads it where that is
installed, and synthetic flights.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.support.autopilot_flight import assert_inertial, assert_motion, inertial, motion, ned
from tests.support.data_paths import data_file
from tests.support.dataflash_writer import (
    COMMAND,
    att,
    dataflash,
    dataflash_text,
    imu,
    micro,
    parm,
    rcou,
    xkf1,
    xkq,
)
from tests.support.outcomes import noted, refused
from tests.support.vehicles import VEHICLE
from windwrench.identification.logs.readers.ardupilot_bin import read_dataflash
from windwrench.identification.logs.reading import read_log

T = 5.0 + 0.02 * np.arange(300)
SLOW = T[::5]
FAST = 5.0 + 0.0025 * np.arange(2400)
POSE = (xkf1(T), xkq(T))


def esc(t):
    rows = [(x, i, 5000.0 + 100.0 * i) for x in t for i in range(4)]
    return (
        "ESC",
        "QBf",
        {
            "TimeUS": [micro(x) for x, _, _ in rows],
            "Instance": [i for _, i, _ in rows],
            "RPM": [rpm for _, _, rpm in rows],
        },
    )


@pytest.fixture
def read(write):
    def of_messages(*messages, vehicle=None):
        return read_log(write(dataflash(messages)), None, vehicle)

    return of_messages


def test_frames_motors_and_commands(read):
    battery = "BAT", "QBf", {"TimeUS": micro(SLOW), "Inst": 0 * SLOW, "Volt": 16.0 - 0.1 * SLOW}
    log = read(parm(), *POSE, imu(T), rcou(T), battery, vehicle=VEHICLE)
    assert "reader ardupilot_bin" in log.source
    assert_motion(log, T, 1e-5)
    assert_inertial(log, T, 1e-4)
    assert_allclose(log.command, np.tile(COMMAND, (len(T), 1)), atol=1e-9)
    assert_allclose(log.voltage[0], 16.0 - 0.5, atol=1e-5)
    # ArduPilot's own curve, scaled to the accelerometer's specific force
    a = (COMMAND - 0.1) / 0.8
    shape = 0.5 * a + 0.5 * a * a
    thrust = VEHICLE.k * log.rotor_speeds**2
    assert_allclose(thrust[9] / thrust[9].sum(), shape / shape.sum(), rtol=1e-6)
    needed = np.median(VEHICLE.mass * inertial(T)[1][:, 2])
    assert_allclose(thrust[9].sum(), needed, rtol=1e-3)
    assert log.commanded
    assert noted(log, "e = 0.5 (MOT_THST_EXPO)")


def test_a_log_as_text(read, tmp_path):
    """Of old firmware, too, whose outputs have other names; a log without times says so."""
    name, letters, sent = rcou(T)
    sent = {column.replace("C", "Chan"): x for column, x in sent.items()}
    current = "CURR", "Qh", {"TimeUS": micro(T), "Volt": 1600 - np.round(10 * T)}
    messages = parm(), *POSE, imu(T), current, (name, letters, sent)
    path = tmp_path / "2014-01-01.log"
    path.write_text(dataflash_text(messages) + "\r\nIMU, 11")  # and the last line is cut
    log = read_log(path)
    binary = read(*messages[:-1], rcou(T))
    assert "reader ardupilot_bin" in log.source
    assert_allclose(log.command, binary.command, atol=1e-9)
    assert_allclose(log.position, binary.position, atol=1e-6)
    assert_allclose(log.gyro, binary.gyro, atol=1e-6)
    assert_allclose(log.voltage, 16.0 - 0.1 * T, atol=0.01)
    path.write_text(dataflash_text(messages, "ArduPlane V3.4"))
    with refused(r"MSG 'ArduPlane V3\.4' says a fixed-wing plane"):
        read_log(path)
    motors = "MOT", "HHHH", {f"Mot{i}": np.full(len(T), 1500) for i in range(1, 5)}
    path.write_text(dataflash_text((*messages[:-1], motors)))
    with refused("MOT has the motors' outputs without their times"):
        read_log(path)


def test_a_log_of_old_px4_is_named(read):
    with refused("is a PX4 log of before 2016"):
        read(imu(T), ("TIME", "Q", {"StartTime": micro(T)}))


def test_motors_that_stand_still(read):
    """Disarmed outputs lie below the range, which is no reason to state another one."""
    name, letters, sent = rcou(T)
    sent = {column: 0.0 * x + 990.0 * ("C" in column) for column, x in sent.items()}
    with refused(r"no motors that turn: columns C9, .* from 990 to 990"):
        read(parm(), *POSE, imu(T), (name, letters, sent | {"TimeUS": micro(T)}))


def test_a_slow_pose_beside_a_fast_imu(read):
    log = read(parm(), xkf1(SLOW), att(T), imu(FAST), rcou(T))
    assert len(log.t) > 2000
    assert 50 < log.valid.sum() <= len(SLOW)
    assert_motion(log, log.t[log.valid] + 5.0, 2e-3)


def test_escs_that_report_their_speed(read):
    log = read(parm(), *POSE, rcou(T), esc(T))
    ours = np.array([5200.0, 5100.0, 5300.0, 5000.0]) * 2 * np.pi / 60  # motors 3, 2, 4, 1
    assert_allclose(log.rotor_speeds[7], ours, rtol=1e-6)
    assert not log.commanded
    assert log.command is not None


def test_without_a_position_the_imu_is_read(read):
    log = read(parm(), att(T), imu(FAST), rcou(T))
    assert not log.has_pose
    assert not log.has_rotor_speeds
    assert_allclose(log.gyro, inertial(log.t + 5.0)[0], atol=1e-3)


def test_places_on_the_globe_become_metres(read):
    position, _ = ned(T)
    lat = 52.0
    lng = 10.0
    place = {
        "TimeUS": micro(T),
        "Lat": lat + np.degrees(position[:, 0] / 6_378_137.0),
        "Lng": lng + np.degrees(position[:, 1] / 6_378_137.0 / np.cos(np.radians(lat))),
        "Alt": -position[:, 2],
    }
    log = read(parm(), ("POS", "QLLf", place), att(T), imu(T), rcou(T))
    wanted = motion(T)[0] - motion(T[:1])[0] * [1.0, 1.0, 0.0]
    assert_allclose(log.position, wanted, atol=0.02)


@pytest.mark.parametrize(
    ("kind", "order"),
    # 12 is rear-right, front-right, rear-left, front-left
    [(1, (3, 1, 0, 2)), (12, (2, 3, 1, 0)), (13, (3, 0, 1, 2)), (14, (3, 2, 1, 0))],
)
def test_frame_types_number_their_motors(read, kind, order):
    """``order``: which of our rotors, from 0, each motor of the frame is."""
    log = read(parm(FRAME_TYPE=float(kind)), *POSE, rcou(T))
    sent = COMMAND[[3, 1, 0, 2]]  # by motor, as rcou has them
    assert_allclose(log.command[0, list(order)], sent, atol=1e-9)


@pytest.mark.parametrize(
    ("messages", "expected"),
    [
        (
            (parm(), *POSE),
            "no motors that turn; expected ESC .* or RCOU .*, found XKF1, XKQ",
        ),
        ((parm(), rcou(T)), "no pose, and no accelerometer and no gyro; expected SIM2 or"),
        ((parm(FRAME_TYPE=0.0), rcou(T)), "FRAME_TYPE is 0, a plus, whose rotors do not stand as"),
        (
            (parm(MOT_PWM_MIN=1900.0), *POSE, rcou(T)),
            "MOT_PWM_MIN and MAX are 1900 and 1900 us; expected MIN below MAX",
        ),
        ((parm(), *POSE, rcou(T + 90.0)), "do not overlap"),
    ],
)
def test_what_is_missing_is_named(read, messages, expected):
    with refused(f"log03: .*{expected}"):
        read(*messages)


@pytest.mark.measured
def test_pymavlink_reads_the_same_numbers():
    dfreader = pytest.importorskip("pymavlink.DFReader", reason="pip install pymavlink")
    path = data_file("ardupilot/backend_log_80k.BIN")
    wanted = ("IMU", "ATT", "XKF1", "XKQ", "RCOU", "BAT", "POS")
    ours, _ = read_dataflash(path, wanted)
    reader = dfreader.DFReader_binary(str(path))
    theirs = {name: [] for name in wanted}
    while (message := reader.recv_msg()) is not None:
        if message.get_type() in wanted:
            theirs[message.get_type()].append(message)
    for name, messages in theirs.items():
        assert len(ours[name]["TimeUS"]) == len(messages) > 0
        for column, found in ours[name].items():
            values = [getattr(message, column) for message in messages]
            assert_allclose(found, values, rtol=1e-6)
