"""A Crazyflie's SD-card logs and tables of its log variables, written here; real ones are in
``tests/golden/logs.json``.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.support.autopilot_flight import assert_inertial, assert_motion, inertial, motion
from tests.support.map_tables import table_text
from tests.support.outcomes import noted, refused
from tests.support.sd_card_writer import sd_card, sd_card_before_2021
from windwrench.dynamics import load_vehicle
from windwrench.identification.logs.readers import crazyflie_sd
from windwrench.identification.logs.reading import read_log
from windwrench.identification.report.log_check import check_log
from windwrench.runtime.file_limits import LIMITS

T = 30.0 + 0.002 * np.arange(1000)
SLOW = 30.0 + 0.008 * np.arange(250)
MOTORS = np.array([40000, 41000, 42000, 43000])  # m1 front-right to m4 front-left
OURS = MOTORS[::-1]


def fast(t):
    """Variables of gyro, accelerometer and motors, as the firmware logs them."""
    gyro, force = inertial(t)
    out = {f"gyro.{a}(f)": np.degrees(gyro[:, i]) for i, a in enumerate("xyz")}
    out |= {f"acc.{a}(f)": force[:, i] / 9.80665 for i, a in enumerate("xyz")}
    return out | {f"motor.m{i + 1}(H)": np.full(len(t), m) for i, m in enumerate(MOTORS)}


def slow(t):
    """Variables of the onboard filter: legacy Euler angles, nose up positive."""
    position, turn = motion(t)
    yaw, pitch, roll = turn.as_euler("ZYX", degrees=True).T
    out = {f"stateEstimate.{a}(f)": position[:, i] for i, a in enumerate("xyz")}
    out |= {"stateEstimate.roll(f)": roll, "stateEstimate.pitch(f)": -pitch}
    return out | {"stateEstimate.yaw(f)": yaw, "pm.vbat(f)": 4.1 - 0.01 * (t - t[0])}


IMU = sd_card({"imu": (T, fast(T))})


@pytest.mark.parametrize("version", [1, 2])
def test_events_of_several_rates(write, version):
    log = read_log(write(sd_card({"imu": (T, fast(T)), "pose": (SLOW, slow(SLOW))}, version)))
    assert "reader crazyflie_sd" in log.source
    # the inertial sensor is four times as fast as the pose: it has no rows of its own yet
    assert log.valid.all()
    assert_motion(log, log.t + SLOW[0], 2e-3, 2e-3)
    assert_inertial(log, log.t + SLOW[0], 5e-3)
    assert_allclose(log.command, np.tile(OURS / 65535, (len(log.t), 1)), atol=1e-9)
    assert_allclose(log.voltage, 4.1 - 0.01 * log.t, atol=1e-4)
    assert not noted(log, "damaged")
    assert noted(log, "stood at 30 s at the first event")


def test_a_log_before_2021(write):
    """All variables share their rows; a block that is cut or spoiled ends the log with a note."""
    data = sd_card_before_2021(T, fast(T) | slow(T))
    log = read_log(write(data))
    assert noted(log, "firmware before 2021")
    assert not noted(log, "damaged")
    position, _ = motion(log.t + T[0])
    assert_allclose(log.position, position, atol=1e-6)
    assert_allclose(log.gyro, inertial(log.t + T[0])[0], atol=1e-6)
    assert_allclose(log.command[5], OURS / 65535, atol=1e-9)
    spoiled = bytearray(data)
    spoiled[-3000] ^= 1
    log = read_log(write(bytes(spoiled)))
    assert noted(log, "is damaged or was cut")
    assert 0.9 * len(T) < len(log.t) < len(T)


def test_set_points_become_rotor_speeds(write):
    path = write(IMU)
    vehicle = load_vehicle("crazyflie")
    log = read_log(path)  # the log names its vehicle
    assert log.vehicle == "crazyflie"
    counts = OURS * vehicle.voltage_ref / 4.2
    thrust = (2.130295e-11 * counts + 1.032633e-6) * counts + 5.484560e-4
    assert_allclose(vehicle.k * log.rotor_speeds[5] ** 2, thrust, rtol=1e-9)
    assert log.commanded
    found = check_log(path)  # judges the log as a diagnosis reads it
    assert found.log.has_rotor_speeds
    assert not any("motor_curve" in text for text in found.doubts)


@pytest.mark.parametrize("thrust", ["thrustSI", "thrustSi"])
def test_a_controller_that_logs_its_wrench(write, thrust):
    """As crazyswarm2's: attitude, angular velocity and commanded wrench are the controller's."""
    position, turn = motion(T)
    gyro, _ = inertial(T)
    variables = {f"stateEstimateZ.{a}(f)": 1e3 * position[:, i] for i, a in enumerate("xyz")}
    yaw, pitch, roll = turn.as_euler("ZYX").T
    angles = zip("xyz", (roll, pitch, yaw), strict=True)
    variables |= {f"ctrlLee.rpy{a}(f)": angle for a, angle in angles}
    variables |= {f"ctrlLee.omega{a}(f)": gyro[:, i] for i, a in enumerate("xyz")}
    variables |= {f"ctrlLee.{thrust}(f)": np.full(len(T), 0.3)}
    variables |= {f"ctrlLee.torque{a}(f)": np.zeros(len(T)) for a in "xyz"}
    log = read_log(write(sd_card({"fixedFrequency": (T, variables)})))
    assert_motion(log, log.t + T[0], 2e-3, 2e-3)
    assert_allclose(log.gyro, gyro, atol=1e-4)
    assert_allclose(load_vehicle("crazyflie").k.sum() * log.rotor_speeds[:, 0] ** 2, 0.3, rtol=1e-6)


def test_measured_rotor_speeds_come_first(write):
    variables = fast(T) | {f"rpm.m{i + 1}(H)": np.full(len(T), 20000 + i) for i in range(4)}
    log = read_log(write(sd_card({"imu": (T, variables)})))
    wanted = np.array([20003, 20002, 20001, 20000]) * 2 * np.pi / 60
    assert_allclose(log.rotor_speeds[0], wanted, rtol=1e-12)
    assert not log.commanded


def test_a_log_that_was_cut_or_spoiled(write):
    log = read_log(write(IMU[:-3000]))
    assert 0.8 * len(T) < len(log.t) < len(T)
    assert noted(log, "is damaged or was cut")
    wrong = IMU[:-1] + bytes([IMU[-1] ^ 1])
    assert noted(read_log(write(wrong)), "is damaged or was cut")


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (sd_card({"imu": (T[:1], fast(T[:1]))}), "no event twice"),
        (
            sd_card({"pose": (SLOW, slow(SLOW))}),
            "no motors that turn; expected rpm.m1 .*motor.m1 .* found stateEstimate.x",
        ),
    ],
)
def test_what_is_no_log_is_named(write, data, expected):
    with refused(f"log03: .*({expected})"):
        read_log(write(data))


def test_events_are_counted(write, monkeypatch):
    monkeypatch.setattr(crazyflie_sd, "LIMITS", replace(LIMITS, table_rows=100))
    with refused("more than 100 events; expected one flight"):
        read_log(write(IMU))


@pytest.mark.parametrize(("time", "unit"), [("timestamp", 1e3), ("Timestamp", 1e3), ("t", 1.0)])
def test_a_table_of_log_variables(write, time, unit):
    """As cflib's examples write them: blocks of two rates, empty where one has no sample."""
    columns = {time: unit * T[::2]}
    columns |= {key[:-3]: values for key, values in fast(T[::2]).items()}
    for key, values in slow(T[::10]).items():
        columns[key[:-3]] = np.full(len(T[::2]), np.nan)
        columns[key[:-3]][::5] = values
    log = read_log(write(table_text(columns).replace(b"nan", b""), "cf.csv"))
    assert "reader crazyflie_csv" in log.source
    assert_motion(log, log.t[log.valid] + T[0], 3e-3, 3e-3)
    assert_allclose(log.command[0], OURS / 65535, atol=1e-6)
