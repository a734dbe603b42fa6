"""The rows of flights with measured rotors: torques, a pose that was filtered, and an IMU alone."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.linalg import lstsq
from numpy.random import default_rng
from numpy.testing import assert_allclose

from tests.support.flown import VEHICLE, resting, without_pose
from tests.support.imu_flights import imu_flight, pose_removed
from tests.support.outcomes import refused
from windwrench.dynamics.vehicle import EffectSetting
from windwrench.evidence.trials.logged_poses import FILTERS
from windwrench.evidence.trials.practice_flights import fly_practice
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.diagnosis.column import Column, Part
from windwrench.identification.diagnosis.ranking import rank
from windwrench.identification.diagnosis.regression import RegressedFlights
from windwrench.identification.diagnosis.row_nuisances import answered, followers
from windwrench.identification.diagnosis.rows import Rows
from windwrench.identification.diagnosis.worth import worth
from windwrench.identification.motion.pose_clock import on_pose_clock

LIBRARY = ["com_offset", "rate_damping", "thrust_scale", "rotor_efficiency", "constant_torque"]
OFFSET = EffectSetting("com_offset", {"cx": 0.01, "cy": 0.0, "cz": 0.0})
WEAK = EffectSetting("rotor_efficiency", {"e1": 0.0, "e2": -0.06, "e3": 0.0, "e4": 0.0})


@pytest.fixture(scope="module")
def offset():
    return RegressedFlights(
        [FILTERS["causal 5 Hz"](fly_practice(VEHICLE, (OFFSET,), "excite", 20.0, 1), VEHICLE)],
        VEHICLE,
    )


@pytest.fixture(scope="module")
def weak():
    return RegressedFlights([pose_removed(imu_flight(VEHICLE, (WEAK,), seconds=20.0))], VEHICLE)


def test_a_simulator_may_have_no_noise():
    """An exact pose looks like a filtered one; what is left of it counts for none."""
    load = (EffectSetting("mass", {"dm": 0.03}),)
    log = fly_practice(VEHICLE, load, "hover", 12.0, 1, turbulence=0.0, sensor=0.0)
    # of thrust and mass a flight shows the ratio
    (effect,) = diagnose([log], VEHICLE).effects
    assert effect.name in ("mass", "thrust_scale")


def test_a_still_flight_without_noise_is_diagnosed():
    """Columns that do not vary carry nothing; what is known to the last digit is no more."""
    rng = default_rng(0)
    count = 2101
    pose = [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0] + 1e-9 * rng.standard_normal((count, 7))
    log = resting(0.005 * np.arange(count), position=pose[:, :3], quaternion=pose[:, 3:])
    found = diagnose([log], VEHICLE)
    assert all(e.tentative for e in found.effects)


def test_an_imu_that_was_read_along_some_axes_counts_as_not_read():
    log = pose_removed(imu_flight(VEHICLE, seconds=15.0, trajectory="gentle"))
    gyro = log.gyro.copy()
    gyro[1::2, 1] = np.nan
    assert np.isnan(replace(log, gyro=gyro).gyro[1::2]).all()
    assert diagnose([replace(log, gyro=gyro)], VEHICLE).verdict == "nothing to explain"


def test_rows_hold_forces_and_torques(offset):
    """An effect leaves the residual by as much as its columns say, torques among them."""
    rows = Rows(offset, {})
    assert rows.channels == 6
    without = rows.residual({})
    found = rows.residual({"com_offset": dict(OFFSET.coefficients)})
    assert np.square(found[:, 4]).mean() < 0.2 * np.square(without[:, 4]).mean()
    (column,) = rows.columns({}, [Column("com_offset", "cx")]).values()
    assert_allclose(without - found, 0.01 * column, atol=0.03 * abs(without).max())


def test_a_centre_of_mass_is_found_behind_a_filter(offset):
    found = rank(offset, LIBRARY, print)
    best = found.ranking.sets[0]
    assert best.effects == ("com_offset",)
    assert found.ranking.probability["com_offset"] > 0.95
    assert best.coefficients["com_offset"]["cx"] == pytest.approx(0.01, abs=0.001)
    assert worth(offset, {}, (), found.needed)["com_offset"] > 1.0


def test_a_weak_rotor_is_found_by_an_imu_alone(weak):
    found = rank(weak, LIBRARY, print)
    best = found.ranking.sets[0]
    assert best.effects == ("rotor_efficiency",)
    assert best.coefficients["rotor_efficiency"]["e2"] == pytest.approx(
        -0.06, abs=3.0 * best.std["rotor_efficiency"]["e2"]
    )
    assert set(found.sensors) >= {f"accelerometer bias {axis} 0" for axis in "xyz"}


def test_a_bias_hides_steady_forces_along_the_body():
    """In a calm hover they show by little else, and torques do not look like a bias."""
    log = pose_removed(imu_flight(VEHICLE, seconds=15.0, trajectory="gentle"))
    flights = RegressedFlights([log], VEHICLE)
    found = rank(flights, [*LIBRARY, "thrust_axis_tilt"], print)
    assert found.ranking.sets[0].effects == ()
    biases = [c._replace(part=Part.NUISANCE) for c in flights.biases]
    shown = found.posterior.shown()
    known = found.posterior.shown(biases)
    assert {e for e, x in shown.items() if x < 13.0} <= {"thrust_scale"}  # as a vertical gust does
    assert {e for e, x in shown.items() if x < 200.0 <= known[e]} == {
        "thrust_scale",
        "thrust_axis_tilt",
    }


def test_a_share_of_what_follows_disturbances_counts_as_one(weak):
    """All of the rotors' answers where disturbances are as large, and a tenth where disturbances
    are a tenth.
    """
    rows = Rows(weak, {})
    ones = np.tile((-1.0) ** np.arange(len(rows.t))[:, None], rows.channels)  # deviation of one
    for name, (signal, channels) in followers(rows).items():
        spread = signal[rows.fit].std()
        calm, rough = (
            answered(rows, {name: (signal, channels)}, x * spread * ones)[f"answer by {name} 0"]
            for x in (0.1, 1.0)
        )
        moved = signal - signal[rows.fit].mean()
        assert_allclose(rough[:, channels[0]], moved, rtol=0.05)
        assert_allclose(calm, 0.1 * rough, rtol=0.1)


def test_a_disturbance_that_thrust_answers_by_its_change_counts_as_one(weak):
    """A flight loop with a rate gain answers a vertical disturbance sooner than thrust shows it."""
    rows = Rows(weak, {})
    disturbance = np.zeros((len(rows.t), rows.channels))
    disturbance[:, 2] = rows.at_rows(np.gradient(weak.rotor_wrench({})[:, 0]))
    disturbance[:, 2] *= rows.residual({})[rows.fit, 2].std() / disturbance[:, 2].std()
    columns = answered(rows, followers(rows), disturbance)
    X = np.stack([x[rows.fit, 2] for x in columns.values()], axis=1)
    y = disturbance[rows.fit, 2]
    left = y - X @ lstsq(X, y, rcond=None)[0]
    assert left.std() < 0.1 * y.std()


def test_what_a_few_positions_add():
    """Drag is identifiable beside ten positions a second, and not by the IMU alone; effects on the
    pose itself are in neither.
    """
    log = imu_flight(VEHICLE, seconds=15.0, trajectory="fast")
    alone, placed = (RegressedFlights([pose_removed(log, n)], VEHICLE) for n in (0, 20))
    pose_effects = {"world_tilt", "marker_offset", "clock_offset", "attitude_gain"}
    assert pose_effects <= alone.needs_pose & placed.needs_pose
    assert {"rotor_drag", "wind", "fan_jet"} <= alone.needs_pose
    assert "rotor_drag" not in placed.not_identifiable
    assert not {"rotor_efficiency", "motor_lag", "inertia"} & alone.not_identifiable


def test_rare_poses_leave_the_rows_of_an_imu():
    log = imu_flight(VEHICLE, seconds=5.0)
    rare = without_pose(log, np.arange(len(log.t)) % 20 > 0)
    assert on_pose_clock(rare) is rare


def test_a_pose_and_an_imu_are_not_mixed():
    log = imu_flight(VEHICLE, seconds=5.0)
    with refused("expected the IMU in all of them"):
        RegressedFlights([pose_removed(log), replace(log, gyro=None, accelerometer=None)], VEHICLE)
