"""Vehicles identified from nothing but mass and logs."""

from dataclasses import replace

import numpy as np
import pytest

from tests.identification.vehicle_fit.flown import (
    ARM,
    FULL,
    INERTIA,
    MASS,
    REACH,
    K,
    inertial_flights,
)
from windwrench.dynamics import load_vehicle
from windwrench.dynamics.vehicle import EffectSetting
from windwrench.dynamics.vehicle_file import dump_vehicle, parse_vehicle
from windwrench.envs.recording import record_flight
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.vehicle_fit.geometry import parse_geometry
from windwrench.identification.vehicle_fit.identify import identify
from windwrench.runtime.errors import InputError


def plant_flight(vehicle, effects=(), trajectory="excite", seconds=15.0, seed=1):
    c = record_flight(vehicle, effects, trajectory, seconds, seed)
    return FlightLog(c["t"], c["position"], c["quaternion"], c["rotor_speeds"], name=trajectory)


@pytest.fixture(scope="module")
def crazyflie():
    return load_vehicle("crazyflie")


@pytest.fixture(scope="module")
def commanded(crazyflie):
    effects = (EffectSetting("motor_lag", {"tau": 0.06}),)
    return [plant_flight(crazyflie, effects, t) for t in ("excite", "shake", "yaw")]


@pytest.fixture(scope="module")
def inertial():
    return inertial_flights(range(8))


def check(found, name, truth, within):
    estimate = found[name]
    assert estimate.status == "identified", estimate
    assert estimate.value == pytest.approx(truth, rel=within), estimate
    assert estimate.low < estimate.high
    assert estimate.low - 0.02 * truth < truth < estimate.high + 0.02 * truth


def test_commanded_speeds_show_the_vehicle_and_its_lag(crazyflie, commanded):
    found = identify(commanded, crazyflie.mass, parse_geometry(str(crazyflie.arm_l)))
    check(found, "k", crazyflie.k[0], 0.05)
    check(found, "p", crazyflie.p[0], 0.05)
    for i, name in enumerate(("Jxx", "Jyy", "Jzz")):
        check(found, name, crazyflie.inertia[i, i], 0.05)
    check(found, "motor_lag", 0.06, 0.10)
    again = parse_vehicle(dump_vehicle(found.vehicle))
    assert [e.name for e in again.effects] == ["motor_lag"]
    assert again.omega_source == "commanded"


def test_a_hover_does_not_show_what_it_does_not_excite(crazyflie):
    hover = [plant_flight(crazyflie, trajectory="hover", seconds=12.0)]
    found = identify(hover, crazyflie.mass, parse_geometry(str(crazyflie.arm_l)))
    assert found["Jzz"].status == "assumed"
    assert found["motor_lag"].status == "not identifiable"
    assert any("Yaw at" in line for line in found.advice)
    parse_vehicle(dump_vehicle(found.vehicle))


def test_an_imu_and_commands_are_enough(inertial):
    found = identify([log for log, _ in inertial[:2]], MASS, parse_geometry(str(ARM)))
    assert found.sources.force == "accelerometer"
    hover = np.sqrt(MASS * 9.81 / (4 * K)) / FULL
    check(found, "hover command", hover, 0.05)
    check(found, "thrust(0.5)", K * (0.5 * FULL) ** 2, 0.05)
    check(found, "Jxx", INERTIA[0, 0], 0.05)
    check(found, "Jyy", INERTIA[1, 1], 0.05)
    check(found, "(p/k)/Jzz", REACH / INERTIA[2, 2], 0.05)
    check(found, "motor_lag", 0.05, 0.10)
    assert found["drag"].status == "not identifiable"
    vehicle = parse_vehicle(dump_vehicle(found.vehicle))
    assert vehicle.motor_curve is not None
    thrust = vehicle.commanded_thrust(np.full((1, 4), hover))
    assert thrust.sum() == pytest.approx(MASS * 9.81, rel=0.05)


def test_intervals_hold_the_truth_about_as_often_as_they_say(inertial):
    held = []
    for log, speeds in inertial:
        log = replace(log, rotor_speeds=speeds, command=None)
        found = identify([log], MASS, parse_geometry(str(ARM)))
        for name, truth in (("k", K), ("Jxx", INERTIA[0, 0]), ("Jyy", INERTIA[1, 1])):
            held.append(found[name].low <= truth <= found[name].high)
    assert sum(held) >= 20  # of 24; 95 % intervals miss more than 4 once in 170 times


def test_rotors_in_another_order_are_refused(inertial):
    log, _ = inertial[0]
    wrong = replace(log, command=log.command[:, [3, 2, 1, 0]])
    with pytest.raises(InputError, match="roll turns against"):
        identify([wrong], MASS, parse_geometry(str(ARM)))


def test_rotors_that_turn_the_other_way_are_recognised(inertial):
    log, speeds = inertial[0]
    # the same flight with the right side called the front: each place has its neighbour's rotor
    turned = replace(
        log,
        command=None,
        rotor_speeds=speeds[:, [3, 0, 1, 2]],
        gyro=np.column_stack([-log.gyro[:, 1], log.gyro[:, 0], log.gyro[:, 2]]),
    )
    found = identify([turned], MASS, parse_geometry(str(ARM)))
    assert found.vehicle.spin.tolist() == [1.0, -1.0, 1.0, -1.0]
    assert any("opposite" in note for note in found.notes)
    check(found, "Jxx", INERTIA[1, 1], 0.05)


@pytest.mark.parametrize("window", [(5.0, 5.5), (100.0, 200.0)])
def test_a_part_that_is_too_short_is_refused(inertial, window):
    with pytest.raises(InputError, match="no piece of 3 s"):
        identify([inertial[0][0]], MASS, parse_geometry(str(ARM)), [window])
