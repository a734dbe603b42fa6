"""Logs of vehicles that are no quadrotor, of a plus, and of outputs that are no pulses."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from tests.support.dataflash_writer import dataflash, imu, parm
from tests.support.flown import resting
from tests.support.map_tables import table_text
from tests.support.outcomes import noted, refused
from tests.support.sd_card_writer import sd_card
from tests.support.ulog_writer import sensor_combined, stamps, ulog_bytes
from windwrench.dynamics import load_vehicle
from windwrench.identification.logs.flight_phases import flew
from windwrench.identification.logs.reading import read_log
from windwrench.identification.logs.what_flew import order_by_places
from windwrench.identification.report.log_check import check_log

T = 1.0 + 0.02 * np.arange(300)
WAVES = np.sin(3.0 * T)[:, None] + 0.3 * np.sin(np.multiply.outer(T, np.arange(5.0, 13.0)))
SHARES = 0.4 + 0.05 * WAVES  # (300, 8) of motors that answer one flight
PULSES = 1000.0 + 1000.0 * SHARES  # us
SERVOS = 0.5 + 0.2 * np.sin(np.multiply.outer(T, np.arange(14.0, 18.0)))  # that do not
ARDRONE = load_vehicle("ardrone2")
ARM = 0.18
NO_SERVOS = {f"SERVO{i}_FUNCTION": None for i in range(1, 15)}
ENDS = [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]]
PLUS = replace(ARDRONE, rotor_positions=ARM * np.array(ENDS))


@pytest.fixture
def px4(write):
    def of_outputs(outputs, connected=1, **parameters):
        sent = np.zeros((len(T), 16))
        sent[:, : outputs.shape[1]] = outputs
        battery = {
            "uint64_t timestamp": stamps(T),
            "float voltage_v": np.full(len(T), 15.8 if connected else 0.05),
            "bool connected": np.full(len(T), bool(connected)),
        }
        topics = {
            "actuator_outputs": {"uint64_t timestamp": stamps(T), "float output": sent},
            "sensor_combined": sensor_combined(T),
            "battery_status": battery,
        }
        return write(ulog_bytes(topics, parameters))

    return of_outputs


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"MAV_TYPE": 13}, "MAV_TYPE = 13 says a hexarotor with 6 rotors"),
        ({"MAV_TYPE": 22}, "MAV_TYPE = 22 says a VTOL plane"),
        ({"MAV_TYPE": 1}, "MAV_TYPE = 1 says a fixed-wing plane"),
        ({"CA_AIRFRAME": 2, "CA_ROTOR_COUNT": 4}, "CA_AIRFRAME = 2 says a VTOL plane"),
        ({"CA_ROTOR_COUNT": 8}, "CA_ROTOR_COUNT says a vehicle with 8 rotors"),
        ({"SYS_AUTOSTART": 13000}, "SYS_AUTOSTART = 13000 says a VTOL plane"),
        ({"MAV_TYPE": 2, "SYS_AUTOSTART": 5001}, "a quad plus, put the rotors"),
    ],
)
def test_px4_says_what_flew(px4, parameters, said):
    with refused(said):
        read_log(px4(PULSES[:, :4], **parameters))


def test_outputs_that_run_say_it_where_nothing_else_does(px4):
    six = PULSES[:, :6]
    with refused(r"6 rotors turn \(output\[0\]"):
        read_log(px4(six))
    gimbal = np.column_stack([six[:, :4], 1000.0 + 1000.0 * SERVOS])
    assert len(read_log(px4(gimbal)).t) == len(T)
    assert len(read_log(px4(six, MAV_TYPE=2)).t) == len(T)  # the log's word counts


@pytest.mark.parametrize(
    ("scale", "parameters", "words"),
    [
        ((0.0, 1999.0), {"DSHOT_CONFIG": 600}, "DShot, 0 to 1999, as parameters state"),
        ((0.0, 1999.0), {"PWM_MAIN_TIM0": -3}, "DShot, 0 to 1999, as parameters state"),
        ((0.0, 8191.0), {}, "UAVCAN, 0 to 8191, since no pulses are like that"),
        ((0.0, 8191.0), {"UAVCAN_ENABLE": 3}, "UAVCAN, 0 to 8191, as parameters state"),
        ((0.0, 1.0), {}, "shares of 1"),
        ((1000.0, 1000.0), {}, "1000 to 2000 us"),
        ((0.0, 8191.0), {f"UAVCAN_EC_FUNC{i + 1}": 101 + i for i in range(4)}, "as parameters"),
    ],
)
def test_outputs_of_each_protocol_are_the_same_commands(px4, scale, parameters, words):
    low, span = scale
    shares = SHARES[:, :4].copy()
    shares[:20] = 0.0  # not armed yet
    log = read_log(px4(low + span * shares, MAV_TYPE=2, **parameters))
    assert_allclose(log.command, shares[:, [2, 1, 3, 0]], atol=1e-3)
    assert words in log.flown.outputs
    assert noted(log, words)


def test_a_battery_that_is_not_connected_has_no_voltage(px4):
    outputs = PULSES[:, :4]
    assert read_log(px4(outputs, MAV_TYPE=2)).voltage[0] == pytest.approx(15.8)
    log = read_log(px4(outputs, connected=0, MAV_TYPE=2))
    assert log.voltage is None
    assert noted(log, "no battery is connected")


def test_a_file_that_ends_within_a_message_says_so(px4):
    path = px4(PULSES[:, :4], MAV_TYPE=2)
    assert not noted(read_log(path), "was cut")
    path.write_bytes(path.read_bytes()[:-3])
    assert noted(read_log(path), "was cut")


def test_a_check_shows_what_flew(px4):
    found = check_log(px4(PULSES[:, :4], MAV_TYPE=2))
    assert found.as_dict()["flown"]["airframe"] == "a quadrotor"
    assert ("airframe", "quadrotor", "parameter MAV_TYPE = 2") in found.log.flown.rows()


@pytest.fixture
def ardupilot(write):
    def of_pulses(texts=(), columns="C", count=4, **parameters):
        frames = {"FRAME_CLASS": None, "FRAME_TYPE": None}
        pulses = {f"{columns}{i + 1}": PULSES[:, i] for i in range(count)}
        rows = {"TimeUS": np.round(1e6 * T), **pulses}
        messages = [parm(**frames | parameters), imu(T), ("RCOU", "Q" + "H" * count, rows)]
        for text in texts:
            padded = text.encode().ljust(16, b"\0")
            messages.append(("MSG", "QN", {"TimeUS": [1.0], "Message": [padded]}))
        return write(dataflash(messages))

    return of_pulses


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"texts": ["Frame: HEXA"], "FRAME": 1.0}, "'Frame: HEXA' says a hexarotor with 6"),
        ({"texts": ["ArduPlane V4.1"]}, "says a fixed-wing plane"),
        ({"texts": ["ArduSub V4.1.0"]}, "says a submarine"),
        ({"texts": ["APMrover2 V3"]}, "says a ground rover"),
        ({"FRAME_CLASS": 2.0}, "FRAME_CLASS = 2 says a hexarotor"),
        ({"FRAME_CONFIG": 1.0}, "FRAME_CONFIG says a submarine"),
        ({"FRAME": 1.0, "count": 6}, r"6 rotors turn \(C1, "),
        ({f"SERVO{i}_FUNCTION": 32.0 + i for i in range(1, 7)}, "with 6 rotors"),
        ({"FRAME": 0.0}, "parameter FRAME is 0, a plus"),
    ],
)
def test_ardupilot_says_what_flew(ardupilot, given, said):
    with refused(said):
        read_log(ardupilot(**NO_SERVOS | given))


def test_a_plus_is_read_for_a_vehicle_that_is_one(ardupilot):
    path = ardupilot(**NO_SERVOS, FRAME=0.0, MOT_PWM_MIN=1000.0, MOT_PWM_MAX=2000.0)
    log = read_log(path, vehicle=PLUS)
    # motors 1 right, 2 left, 3 front, 4 rear; the vehicle's rotors front, left, rear, right
    assert_allclose(log.command, SHARES[:, [2, 1, 3, 0]], atol=1e-3)


def test_pulses_of_old_copters_have_other_names(ardupilot):
    given = {"FRAME": 1.0, "MOT_PWM_MIN": 1000.0, "MOT_PWM_MAX": 2000.0}
    new, old = (read_log(ardupilot(columns=c, **NO_SERVOS, **given)).command for c in ("C", "Ch"))
    assert np.array_equal(new, old)


def test_rotors_are_found_by_their_directions():
    x = [(0.2, -0.2), (-0.2, 0.2), (0.2, 0.2), (-0.2, -0.2)]
    assert order_by_places(x) == (3, 2, 4, 1)
    plus = [(0.0, -1.0), (0.0, 1.0), (1.0, 0.0), (-1.0, 0.0)]
    assert order_by_places(plus) is None
    assert order_by_places(plus, ARDRONE) is None
    assert order_by_places(plus, PLUS) == (3, 2, 4, 1)
    assert order_by_places([(1.0, 1.0)] * 4) is None


def test_a_decoded_blackbox_of_six_motors_and_of_ten_times_the_volts(write):
    columns = {"time (us)": 1e6 * T, "vbatLatest (V)": 227.0}
    columns |= {f"{name}[{i}]": 0.0 for name in ("gyroADC", "accSmooth") for i in range(3)}
    columns |= {"accSmooth[2]": 2048.0}
    columns |= {f"motor[{i}]": 48 + 2000 * SHARES[:, i] for i in range(6)}
    with refused(r"6 rotors turn \(motor\[0\], .*motor\[5\]\); expected"):
        read_log(write(table_text(columns), "log.csv"))
    del columns["motor[4]"], columns["motor[5]"]
    log = read_log(write(table_text(columns), "log.csv"))
    assert log.voltage[0] == pytest.approx(22.7)
    assert noted(log, "taken as a tenth")


def test_voltages_of_no_battery_are_left_out(write):
    columns = {"t": T, "px": T, "py": T, "pz": T, "qw": 1.0, "qx": 0.0, "qy": 0.0, "qz": 0.0}
    columns |= {f"omega{i}": 400 + T for i in range(1, 5)}
    columns["vbat"] = np.where(np.arange(len(T)) == 50, 227.0, 11.1)
    log = read_log(write(table_text(columns), "log.csv"))
    assert_allclose(log.voltage, 11.1)
    assert noted(log, "1 of 300 voltages, 227 to 227 V, are none of a")


def test_a_log_of_motor_requests_alone_serves_to_compare(write):
    """As CrazyPAD's SD-card logs: no pitch, no gyro, no accelerometer."""
    motors = {f"motor.m{i + 1}(H)": (65535 * SHARES[:, i]).astype(int) for i in range(4)}
    place = {f"stateEstimate.{axis}(f)": np.sin(T) for axis in "xyz"}
    log = read_log(write(sd_card({"fixedFrequency": (T, motors | place)})))
    assert not log.has_pose
    assert_allclose(log.command, SHARES[:, [3, 2, 1, 0]], atol=1e-4)
    assert noted(log, "how the rotors share the work, and nothing else")


def test_whether_anything_flew():
    """By the motors and what was measured, whatever the vehicle."""
    t = 0.01 * np.arange(2000)
    hover = np.full((2000, 4), 390.0)
    still = np.zeros((2000, 3))
    noise = default_rng(0).standard_normal((2000, 3))
    moving = 0.3 * np.sin(np.outer(t, [0.5, 0.7, 0.9]))
    way = still + np.outer(t, [0.3, 0.0, 0.0])

    def answer(position=still, speeds=hover, **sensors):
        return flew(resting(t, position=position, rotor_speeds=speeds, **sensors))[0]

    assert answer(moving) == "yes, 20 s"
    assert answer(moving, 0.0 * hover) == "no"
    assert answer(1e-3 * noise) == "not shown"  # on a bench
    assert answer(way) == "not shown"  # it drove
    blown = np.exp(2.0 * t)[:, None] * moving
    assert answer(blown) == "not shown"  # a simulation that left all numbers
    missing = np.full((2000, 3), np.nan)
    assert answer(missing, gyro=moving) == "yes, 20 s"
    assert answer(missing, gyro=0.05 * noise) == "unknown"  # vibration alone
    assert answer(missing) == "unknown"
    lost = 0.0 * hover + np.nan
    assert answer(moving, lost, command=np.full((2000, 4), 0.4)) == "yes, 20 s"
    assert answer(moving, lost) == "unknown"
    crash = np.full((2000, 4), 0.27)
    crash[1800:] = [0.5, 0.2, 0.3, 0.9]
    assert answer(moving, lost, command=crash) == "yes, 20 s"
