"""Measured flights, in every clone: each is read, screened, its wrench estimated, and two are
diagnosed.

The excerpts lie in ``tests/data``, with where they come from; the whole flights are in
``tests/evidence/test_measured_flights.py``.
"""

import numpy as np
import pytest

from tests.support.data_paths import excerpt
from tests.support.outcomes import noted, refused
from windwrench.dynamics import EffectSetting, load_vehicle
from windwrench.evidence.measured_flights import compare, imu_check, linear_drag
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.logs.reading import read_log
from windwrench.identification.logs.screening import screen_log
from windwrench.identification.wrench_series import estimate_log

VEHICLE = load_vehicle("crazyflie")
NANOBENCH = ("B2_circle_fast_rep3", "B5_helix_fast_rep2")

pytestmark = pytest.mark.measured


@pytest.fixture(scope="module")
def logs():
    return {
        name: read_log(excerpt(f"nanobench/{name}.csv.gz"), "nanobench", VEHICLE)
        for name in NANOBENCH
    }


@pytest.mark.parametrize("name", NANOBENCH)
def test_a_nanobench_flight_lacks_the_lift_of_a_full_battery(name, logs):
    log = logs[name]
    assert log.t[-1] == pytest.approx(18.0, abs=0.02)
    assert log.valid.all()
    assert 3.0 < log.voltage.min() < log.voltage.max() < 4.2  # V
    assert noted(log, "voltage")
    assert screen_log(log, VEHICLE)[1] == ()
    series = estimate_log(log, VEHICLE)
    settled = series.t > 2.0
    weight = VEHICLE.weight
    assert np.isfinite(series.nis[1:]).all()
    assert -0.85 * weight < series.force[settled, 2].mean() < -0.65 * weight
    assert abs(series.force[settled, :2]).max() < 0.25 * weight
    assert abs(series.torque[settled]).max() < 0.2 * weight * VEHICLE.arm_l
    # what a diagnosis of the whole flights finds, declared: next to nothing is left
    known = VEHICLE.with_effects(
        EffectSetting("battery_sag", {"n": 1.5}), EffectSetting("thrust_scale", {"s": -0.28})
    )
    assert np.abs(estimate_log(log, known).force[settled, 2].mean()) < 0.05 * weight


@pytest.mark.parametrize(("number", "load"), [(165, 0.0), (202, 0.005)])
def test_a_crazyswarm2_flight_carries_what_hangs_from_it(number, load):
    log = read_log(excerpt(f"crazyswarm2/log{number}.csv.gz"), "crazyswarm2", VEHICLE)
    assert log.period == pytest.approx(0.004, rel=0.02)
    assert ("payload_position" in log.extra) == (load > 0.0)
    assert screen_log(log, VEHICLE, least_seconds=3.0)[1] == ()
    with refused("expected at least 10 s"):
        screen_log(log, VEHICLE)  # short as it is
    series = estimate_log(log, VEHICLE)
    settled = series.t > 2.0
    # by the mass that those who flew it state, and with the load that they weighed
    expected = -((0.0369 if load else 0.032) + load - VEHICLE.mass) * 9.81
    assert series.force[settled, 2].mean() == pytest.approx(expected, rel=0.4)
    assert abs(series.force[settled, :2]).max() < 0.04
    assert abs(series.torque[settled]).max() < 1e-3


def test_a_diagnosis_of_one_flight_explains_another(logs):
    """Fitted on a circle, judged on a helix, by motion capture and by an accelerometer that nothing
    else looks at.
    """
    trained, test = (logs[name] for name in NANOBENCH)
    found = diagnose([trained], VEHICLE, [test])
    row = compare(test, found)
    assert row["before_rms"][2] > 10 * row["after_rms"][2]
    assert row["norm_before"] > 10 * row["norm_after"]
    assert (np.array(row["before_std"]) > 3.5 * np.array(row["after_std"])).all()
    assert (abs(np.array(linear_drag(found)) - 0.0100) < 0.0025).all()  # N per m/s
    named = {e.name: e for e in found.effects}
    assert 0.8 < named["battery_sag"].coefficients["n"] < 2.5
    delay = named["latency"]
    assert delay.indistinguishable_from == ("motor_lag", "clock_offset")
    assert 0.030 < delay.coefficients["d"] < 0.055
    imu = imu_check(excerpt(f"nanobench/{NANOBENCH[1]}.csv.gz"), test, found)
    assert imu["model_std"] < 0.8 * imu["constant_std"]
