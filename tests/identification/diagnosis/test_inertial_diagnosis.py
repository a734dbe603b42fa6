"""Diagnoses of logs without a pose: what the IMU shows is named, and the rest is listed."""

from dataclasses import replace

import pytest

from tests.support.imu_flights import imu_flight, pose_removed
from windwrench.dynamics import load_vehicle
from windwrench.dynamics.vehicle import EffectSetting
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.diagnosis.regression import Flights
from windwrench.identification.report.files import report_data
from windwrench.runtime.errors import InputError

VEHICLE = load_vehicle("ardrone2")
WEAK = EffectSetting("rotor_efficiency", {"e2": -0.06})


@pytest.mark.slow
def test_a_weak_rotor_is_named_without_a_pose():
    """With its size, by gyro and rotor speeds; what needs a pose is listed and not named."""
    log = pose_removed(imu_flight(VEHICLE, (WEAK,), seconds=20.0))
    found = diagnose([log], VEHICLE)
    assert [effect.name for effect in found.effects] == ["rotor_efficiency"]
    (effect,) = found.effects
    assert effect.coefficients["e2"] == pytest.approx(-0.06, abs=0.005)
    assert {"gyro", "rotor speeds"} <= set(effect.channels)
    assert not {"position", "attitude"} & set(effect.channels)
    assert {"world_tilt", "marker_offset", "clock_offset", "rotor_drag"} <= set(found.needs_pose)
    data = report_data(found)
    assert data["effects"][0]["channels"] == list(effect.channels)
    assert any("An IMU alone does not show" in text for text in found.advice)
    assert found.probabilities.names.keys() == {WEAK.name}
    assert found.probabilities.names[WEAK.name] > 0.3


def test_what_a_few_positions_add():
    """Drag is identifiable beside ten positions a second, and not by the IMU alone; effects on the
    pose itself are in neither.
    """
    log = imu_flight(VEHICLE, seconds=15.0, trajectory="fast")
    alone, placed = (Flights([pose_removed(log, n)], VEHICLE) for n in (0, 20))
    pose_effects = {"world_tilt", "marker_offset", "clock_offset", "attitude_gain"}
    assert pose_effects <= alone.needs_pose & placed.needs_pose
    assert {"rotor_drag", "wind", "fan_jet"} <= alone.needs_pose
    assert "rotor_drag" not in placed.not_identifiable
    assert not {"rotor_efficiency", "motor_lag", "inertia"} & alone.not_identifiable


def test_a_pose_and_an_imu_are_not_mixed():
    """Logs of which one has no pose and another no IMU have nothing in common."""
    log = imu_flight(VEHICLE, seconds=5.0)
    with pytest.raises(InputError, match="expected the IMU in all of them"):
        Flights([pose_removed(log), replace(log, gyro=None, accelerometer=None)], VEHICLE)
