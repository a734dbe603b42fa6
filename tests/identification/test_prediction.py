"""How well a model predicts a flight, and logs with their sensing effects taken out."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.support.flown import VEHICLE, recorded, settings, without_pose
from windwrench.dynamics.effects import parse_setting
from windwrench.envs.plant import PlantSettings
from windwrench.identification import predict
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.motion.residual import residual_wrench
from windwrench.identification.motion.sensing_effects import undo_log_sensing
from windwrench.identification.motion.signals import log_signals
from windwrench.identification.motion.smoothing import low_pass
from windwrench.identification.prediction import (
    nis_without_wrench_state,
    prediction_errors,
    rollout_error,
)
from windwrench.runtime.errors import InputError

QUIET = PlantSettings(disturbance_force=0.0, disturbance_torque=0.0)
SEGMENTS = [(3.0, 11.0), (15.0, 24.0)]


def fly(trajectory="excite", seconds=25.0, background=QUIET, **effects):
    return recorded(trajectory, seconds, 3, background, **effects)


@pytest.fixture(scope="module")
def clean():
    return fly()


def residual_rms(log):
    pieces = []
    for signals in log_signals(log):
        edge = round(0.6 / signals.period)
        pieces.append(low_pass(residual_wrench(signals, VEHICLE), 4.0, signals.period)[edge:-edge])
    return np.sqrt(np.mean(np.concatenate(pieces) ** 2, axis=0))


@pytest.mark.parametrize(
    "effects",
    [
        {"clock_offset": {"dt": 0.03}},
        {
            "marker_offset": {"mx": 0.02, "my": -0.02, "mz": 0.05},
            "clock_offset": {"dt": -0.02},
            "world_tilt": {"ax": 0.03, "ay": -0.03},
            "attitude_gain": {"g": 0.05},
        },
    ],
)
def test_a_log_without_its_sensing_effects_leaves_the_residual_of_a_clean_flight(clean, effects):
    floor, log = residual_rms(clean), fly(**effects)
    before = residual_rms(log) / floor
    after = residual_rms(undo_log_sensing(log, VEHICLE.with_effects(*settings(effects)))) / floor
    assert np.max(before) > 2.0
    # a loop that sees late poses flies livelier than the clean flight, which leaves more behind at
    # the plant's time step
    assert np.max((np.square(after) - 1.0)[before > 1.5] / np.square(before[before > 1.5])) < 0.03
    assert np.max(after[before < 1.5]) < 1.2


def test_a_delayed_pose_is_not_made_up_after_a_gap():
    late = {"clock_offset": {"dt": -0.03}}
    log = without_pose(fly(seconds=8.0, **late), slice(800, 900))
    corrected = undo_log_sensing(log, VEHICLE.with_effects(*settings(late)))
    np.testing.assert_array_equal(np.flatnonzero(~corrected.valid), [*range(6), *range(800, 906)])
    assert np.isnan(corrected.position[905]).all()
    # the pose of a row is the log's of 6 rows before, and the turn rates are the row's own
    np.testing.assert_allclose(corrected.position[906:], log.position[900:-6], atol=1e-12)
    np.testing.assert_array_equal(corrected.rotor_speeds, log.rotor_speeds)


@pytest.mark.parametrize(
    ("name", "trajectory", "ratio"),
    [
        ("rotor_drag", "excite", 0.25),
        ("ground_effect", "ground", 0.5),
        ("motor_lag", "excite", 0.3),  # rotors with a memory
        ("slung_payload", "excite", 0.3),  # a wrench with a state of its own
        ("com_offset", "excite", 0.1),  # the body
        ("clock_offset", "excite", 0.3),  # the log
    ],
)
def test_the_missing_effect_brings_prediction_back_to_the_flight(name, trajectory, ratio):
    effect = parse_setting(name, VEHICLE)
    log = fly(trajectory, background=None, **{name: effect.coefficients})
    whole = VEHICLE.with_effects(effect)
    assert rollout_error(log, whole, SEGMENTS) < ratio * rollout_error(log, VEHICLE, SEGMENTS)
    assert nis_without_wrench_state(log, whole, SEGMENTS) < nis_without_wrench_state(
        log, VEHICLE, SEGMENTS
    )


def test_predictions_start_where_a_whole_horizon_follows(clean):
    log = without_pose(clean, slice(2000, 2100))
    made = predict(log, VEHICLE, horizon_s=0.25, every=7)
    n, steps = len(made.start), 50
    assert made.period == pytest.approx(0.005)
    assert (
        made.position.shape == made.velocity.shape == made.angular_velocity.shape == (n, steps, 3)
    )
    assert made.quaternion.shape == (n, steps, 4)
    assert made.start[0] == 0
    assert set(np.diff(made.start[made.start < 1950])) == {7}
    assert not np.any((made.start > 1999 - steps) & (made.start < 2100))
    ends = made.start + steps
    assert ends.max() < len(log.t)
    assert log.valid[ends].all()
    inside = (made.start > 200) & (ends < 1900)
    off = made.position[inside, -1] - log.position[ends[inside]]
    assert np.sqrt(np.mean(np.sum(off**2, axis=1))) < 0.02  # the pose's noise is 0.005 m an axis
    turned = np.abs(np.sum(made.quaternion[inside, -1] * log.quaternion[ends[inside]], axis=1))
    assert 2 * np.degrees(np.arccos(np.minimum(turned, 1.0))).mean() < 2.0
    ahead = made.position[:, 1:] - made.position[:, :-1]
    np.testing.assert_allclose(ahead, 0.005 * made.velocity[:, 1:], atol=2e-3)


def test_only_whole_predictions_inside_a_segment_count(clean):
    push = replace(
        clean,
        position=clean.position + np.where(clean.t > 20.0, 0.5, 0.0)[:, None] * [1.0, 0.0, 0.0],
    )
    before = rollout_error(clean, VEHICLE, [(4.0, 19.5)])
    assert rollout_error(push, VEHICLE, [(4.0, 19.5)]) == pytest.approx(before, rel=0.02)
    assert rollout_error(push, VEHICLE, [(19.2, 20.7)]) > 0.3
    assert math.isnan(rollout_error(clean, VEHICLE, [(4.0, 4.9)]))
    assert math.isnan(rollout_error(clean, VEHICLE, []))


def test_errors_of_predictions_are_those_of_the_motion():
    """In hover 0.04 kg too little is g dm / m of acceleration, and nothing changes."""
    log = fly("hover", 12.0, mass={"dm": 0.04})
    found = prediction_errors([log, log], VEHICLE, 0.5, [[(2.0, 11.0)], [(2.0, math.inf)]])
    fall = VEHICLE.gravity * 0.04 / VEHICLE.mass
    assert found.horizon[[0, -1]] == pytest.approx([0.005, 0.5])
    assert found.starts == 35 + 38  # up to 10.5 s, and to 0.6 s before the end
    position, velocity, attitude, _ = found.model
    assert velocity[-1] == pytest.approx(0.5 * fall, rel=0.1)
    assert position[-1] == pytest.approx(0.125 * fall, rel=0.1)
    assert attitude[-1] < 0.02
    assert found.still[0, -1] < 0.2 * position[-1]
    assert found.still[1, -1] < 0.2 * velocity[-1]


def test_a_turn_at_one_rate_is_no_change():
    t = np.arange(1500) * 0.005
    half = 0.4 * t
    turned = np.column_stack([np.cos(half), 0.0 * t, 0.0 * t, np.sin(half)])
    speeds = np.full((1500, 4), VEHICLE.hover_rate)
    log = FlightLog(t, np.outer(t, [1.0, -0.5, 0.2]), turned, speeds)
    found = prediction_errors([log], VEHICLE)
    assert np.all(found.still < 2e-3)
    assert np.all(found.model < 2e-3)
    with pytest.raises(InputError, match=r"flight: expected poses at one rate, unbroken for 4 s"):
        prediction_errors([replace(log, name="flight")], VEHICLE, 3.0, [[(0.0, 2.0)]])
