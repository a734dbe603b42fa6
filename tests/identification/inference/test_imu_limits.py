"""What an accelerometer's bias hides, and what the errors of a fusion add to deviations."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.support.imu_flights import imu_flight, pose_removed
from tests.support.searches import VEHICLE, searched
from windwrench.dynamics.effects import get
from windwrench.dynamics.vehicle import EffectSetting
from windwrench.identification.inference.imu_limits import (
    hidden_by_bias,
    hidden_causes,
    with_errors_of_fusion,
)
from windwrench.identification.inference.search import SEARCH, FittedEffects

FORCE = {"fx": 0.2, "fy": 0.2}


@pytest.mark.parametrize(("trajectory", "hidden"), [("yaw", True), ("excite", False)])
def test_a_tilted_thrust_axis_shows_where_thrust_changes(trajectory, hidden):
    """A bias does the same as long as thrust is steady. Torques and inertia it does not touch."""
    log = pose_removed(imu_flight(VEHICLE, trajectory=trajectory, turbulence=1.0))
    search, nothing = searched(log, ["thrust_axis_tilt", "com_offset", "rate_damping"])
    assert hidden_by_bias(search, nothing) == ({"thrust_axis_tilt"} if hidden else set())


def test_an_unknown_heading_is_in_the_deviation_of_a_steady_force():
    flown = imu_flight(VEHICLE, (EffectSetting("constant_force", FORCE),), trajectory="yaw")
    begun = {"constant_force": {**FORCE, "fz": 0.0}}
    search, fit = searched(pose_removed(flown), ["constant_force", "com_offset"], **begun)
    wider = with_errors_of_fusion(search, fit)
    assert wider.setting == fit.setting
    first = np.searchsorted(flown.t, search.flights.logs[0].t[0])
    start = Rotation.from_quat(flown.quaternion[first], scalar_first=True).as_euler("ZYX")[0]
    truth = Rotation.from_euler("z", -start).apply([0.2, 0.2, 0.0])
    found = np.array([fit.setting["constant_force"][name] for name in ("fx", "fy")])
    error = np.abs(found - truth[:2])
    std, more = (
        np.array([of.std["constant_force", name] for name in ("fx", "fy")]) for of in (fit, wider)
    )
    assert error.max() > 3.0 * std.max()  # what the balance alone says
    assert np.all(error < 3.0 * more)
    assert np.all(more < 0.1)


def test_a_name_is_doubted_where_a_cause_that_does_not_show_would_look_like_it():
    """Rotors in each other's wake lose thrust: without a pose that is a larger mass. A mass
    that is much larger than what they make of it is not doubted for them.
    """
    wake = {c.name: c.typical[0] for c in get("rotor_interaction").coefficients}
    flown = imu_flight(VEHICLE, (EffectSetting("rotor_interaction", wake),), trajectory="excite")
    search, fit = searched(pose_removed(flown), ["mass"], mass={"dm": 0.03})
    assert any("rotor_interaction" in text for text in hidden_causes(search, fit))
    heavy = FittedEffects({"mass": {"dm": 0.3}}, fit.std)
    assert not any("rotor_interaction" in text for text in hidden_causes(search, heavy))


def test_noise_of_rotor_speeds_is_averaged_and_is_no_lag():
    """An IMU is so quiet that what rotor speeds are wrong by shows in it. A lag averages them as
    well; it must be left no gain by it.
    """
    log = pose_removed(imu_flight(VEHICLE, trajectory="fast", seconds=30.0))
    noise = np.random.default_rng(0).normal(0.0, 3.0, log.rotor_speeds.shape)
    spreads, gained = [], []
    for flown in (log, replace(log, rotor_speeds=log.rotor_speeds + noise)):
        search, nothing = searched(flown, ["motor_lag"])
        fit = search.refit(nothing)
        spreads.append(fit.setting[""]["rotor_spread"])
        lag = search.refit(FittedEffects({**fit.setting, "motor_lag": {"tau": 0.01}}))
        gained.append(search.deviance(fit.setting) - search.deviance(lag.setting))
    assert spreads[0] < 0.3 * spreads[1]
    assert max(gained) < SEARCH.least_deviance_reduction
