"""The diagnosis on measured flights, each judged on flights that the fit never saw.

The NanoBench fold is B5 from B2 and B3; the page of ``studies.measured_flights`` has all seven and
what each misses.
"""

import numpy as np
import pytest

from tests.support.data_paths import crazyswarm2_file, data_file
from windwrench.dynamics import load_vehicle
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.inference.commanded_rotors import in_flight
from windwrench.identification.logs.reading import read_log
from windwrench.studies.measured_flights import (
    CARRIER,
    compare,
    imu_check,
    linear_drag,
    names_of,
    nanobench_fold,
    payload_vehicle,
    swing,
    unmet,
)

# wind, a moved centre of mass, inflow, ground, payload and fan are not among these
EXPECTED = {"thrust_scale", "battery_sag", "thrust_curvature", "thrust_fade", "latency"}
EXPECTED |= {"rotor_drag", "body_drag", "world_tilt", "thrust_axis_tilt", "constant_force"}
EXPECTED |= {"marker_offset"}
SAME_DAY = ("B2_circle_fast_rep3", "B3_figure8_medium_rep3", "B5_helix_fast_rep2")


def by_name(diagnosis):
    return {e.name: e for e in diagnosis.effects}


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle("crazyflie")


@pytest.fixture(scope="module")
def nanobench(vehicle):
    paths = [data_file(f"nanobench/{name}.csv") for name in SAME_DAY]
    logs = [read_log(path, "nanobench", vehicle) for path in paths]
    diagnosis, (row,) = nanobench_fold(logs[:2], logs[2:], vehicle)
    return paths[2], logs[2], diagnosis, row


@pytest.mark.measured
def test_nanobench_residual_on_a_flight_not_seen(nanobench):
    path, log, diagnosis, row = nanobench
    assert row["after_rms"][2] < 0.18  # m/s2, with the thrust scale of other flights
    assert row["before_rms"][2] > 5 * row["after_rms"][2]
    assert row["after_std"][2] < row["constant_thrust_std"][2]
    assert row["before_std"][0] > 1.9 * row["after_std"][0]
    assert row["before_std"][1] > 4.0 * row["after_std"][1]
    assert row["norm_before"] > 4 * row["norm_after"]
    assert row == compare(log, diagnosis)
    assert unmet({**row, "effects": names_of(diagnosis)}) == []
    imu = imu_check(path, log, diagnosis)
    assert imu["model_std"] < imu["constant_std"]


@pytest.mark.measured
def test_nanobench_names(nanobench):
    _, _, diagnosis, _ = nanobench
    named = by_name(diagnosis)
    assert set(named) <= EXPECTED
    assert 0.8 < named["battery_sag"].coefficients["n"] < 2.0
    assert named["battery_sag"].indistinguishable_from == ()
    drag = named.get("rotor_drag") or named["body_drag"]
    assert {drag.name, *drag.indistinguishable_from} >= {"rotor_drag", "body_drag"}
    assert np.all(
        (np.array(linear_drag(diagnosis)) > 0.0090) & (np.array(linear_drag(diagnosis)) < 0.0125)
    )
    delay = named["latency"]
    assert delay.indistinguishable_from == ("motor_lag", "clock_offset")
    assert 0.030 < delay.coefficients["d"] < 0.055
    assert delay.std["d"] < 0.01
    lean = next(
        named[n] for n in ("world_tilt", "constant_force", "thrust_axis_tilt") if n in named
    )
    assert {lean.name, *lean.indistinguishable_from} >= {"world_tilt", "constant_force"}


@pytest.mark.measured
@pytest.mark.parametrize("number", ["202", "201", "165"])
def test_slung_payload(number):
    carrier = payload_vehicle(0.032 if number == "165" else CARRIER)
    log = read_log(crazyswarm2_file(number), "crazyswarm2", carrier)
    diagnosis = diagnose([log], carrier)
    named = by_name(diagnosis)
    if number == "165":
        assert "slung_payload" not in named
        assert all("slung_payload" not in e.indistinguishable_from for e in diagnosis.effects)
        return
    load = named["slung_payload"]
    assert 0.002 < load.coefficients["m"] < 0.009
    assert load.coefficients["l"] == 0.5
    if number == "202":
        assert load.indistinguishable_from == ()
        sideways = swing(log, diagnosis)
        assert np.all(np.array(sideways["law_std"]) / sideways["tracked_std"] > 0.4)
        assert np.all(np.array(sideways["law_std"]) / sideways["tracked_std"] < 2.5)
    else:
        assert {"mass", "thrust_scale", "constant_force"} <= set(load.indistinguishable_from)


@pytest.mark.measured
def test_only_the_time_in_the_air_counts(vehicle):
    log = read_log(data_file("nanobench/B2_circle_fast_rep3.csv"), "nanobench", vehicle)
    flight = in_flight(log, vehicle)
    assert 29 < flight.t[-1] - flight.t[0] < 33
    assert flight.position[:, 2].min() > 0.4
    assert len(flight.voltage) == len(flight.t) == len(flight.valid)
