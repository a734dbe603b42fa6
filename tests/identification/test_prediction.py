"""How well a model predicts a flight, and logs with their sensing effects taken out."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.linalg import norm
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from tests.support.flown import VEHICLE, recorded, resting, settings, without_pose
from tests.support.imu_flights import imu_flight
from tests.support.outcomes import refused
from tests.support.sizes import rms
from windwrench.dynamics.effects import parse_setting
from windwrench.envs.plant import PlantSettings
from windwrench.evidence.residual_wrench import residual_wrench
from windwrench.identification import predict
from windwrench.identification.causal_states import causal_states
from windwrench.identification.motion.sensing_effects import undo_log_sensing
from windwrench.identification.motion.signals import log_signals
from windwrench.identification.motion.smoothing import likeliest_speeds, low_pass
from windwrench.identification.prediction import (
    errors_of_models,
    nis_without_wrench_state,
    rollout_error,
)

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
    return rms(np.concatenate(pieces), axis=0)


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
    floor = residual_rms(clean)
    log = fly(**effects)
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
    assert_array_equal(np.flatnonzero(~corrected.valid), [*range(6), *range(800, 906)])
    assert np.isnan(corrected.position[905]).all()
    # the pose of a row is the log's of 6 rows before, and the turn rates are the row's own
    assert_allclose(corrected.position[906:], log.position[900:-6], atol=1e-12)
    assert_array_equal(corrected.rotor_speeds, log.rotor_speeds)
    assert_allclose(corrected.voltage[6:], log.voltage[:-6], rtol=1e-9)


# rotors with a memory, a wrench with a state of its own, and the log
@pytest.mark.parametrize("name", ["motor_lag", "slung_payload", "clock_offset"])
def test_the_missing_effect_brings_prediction_back_to_the_flight(name):
    effect = parse_setting(name, VEHICLE)
    log = fly(background=None, **{name: effect.coefficients})
    whole = VEHICLE.with_effects(effect)
    assert rollout_error(log, whole, SEGMENTS) < 0.3 * rollout_error(log, VEHICLE, SEGMENTS)
    assert nis_without_wrench_state(log, whole, SEGMENTS) < nis_without_wrench_state(
        log, VEHICLE, SEGMENTS
    )


def test_predictions_start_where_a_whole_horizon_follows(clean):
    log = without_pose(clean, slice(2000, 2100))
    made = predict(log, VEHICLE, horizon_s=0.25, every=7)
    n = len(made.start)
    steps = 50
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
    turned = abs(np.sum(made.quaternion[inside, -1] * log.quaternion[ends[inside]], axis=1))
    assert 2 * np.degrees(np.arccos(np.minimum(turned, 1.0))).mean() < 2.0
    ahead = made.position[:, 1:] - made.position[:, :-1]
    assert_allclose(ahead, 0.005 * made.velocity[:, 1:], atol=2e-3)


LATE = {"clock_offset": {"dt": -0.03}}


@pytest.mark.parametrize(
    "kind", ["pose", "gap", "jitter", "imu", "late", "commands", "wrong inertia"]
)
def test_nothing_after_a_start_changes_its_prediction(kind):
    log = imu_flight(VEHICLE, seconds=8.0) if kind == "imu" else fly(seconds=8.0)
    vehicle = VEHICLE
    if kind == "gap":
        log = without_pose(log, slice(700, 760))
    elif kind == "jitter":
        log = replace(log, t=log.t + default_rng(0).uniform(-1e-3, 1e-3, len(log.t)))
    elif kind == "commands":
        log = replace(log, commanded=True)
    elif kind == "late":
        vehicle = VEHICLE.with_effects(*settings(LATE))
    elif kind == "wrong inertia":
        vehicle = replace(VEHICLE, inertia=2.0 * VEHICLE.inertia)
    for k in (20, 300, 900):
        later = np.arange(len(log.t)) > k
        rng = default_rng(k)
        moved = {"position": log.position + rng.normal(0.0, 5.0, 3)}
        moved["quaternion"] = np.roll(log.quaternion, 1, axis=1)
        for sensor in ("gyro", "accelerometer"):
            if (read := getattr(log, sensor)) is not None:
                moved[sensor] = read + rng.normal(0.0, 5.0, read.shape)
        moved = {name: np.where(later[:, None], x, getattr(log, name)) for name, x in moved.items()}
        before, after = (predict(x, vehicle, 0.3, 10) for x in (log, replace(log, **moved)))
        assert_array_equal(before.start, after.start)
        known = before.start <= k
        assert known.any()
        for name in ("position", "velocity", "quaternion", "angular_velocity"):
            x = getattr(before, name)
            y = getattr(after, name)
            assert_allclose(x[known], y[known], rtol=0.0, atol=1e-9)
            assert abs(x[~known] - y[~known]).max() > 0.1


def test_a_state_is_taken_as_it_is():
    """Without thrust, and about a principal axis, what follows is known exactly."""
    rng = default_rng(0)
    n = 400
    t = 0.01 * np.arange(n) + rng.uniform(-1e-4, 1e-4, n)
    log = resting(t, rotor_speeds=np.zeros((n, 4)), name="falling")
    state = rng.normal(size=(n, 13))
    state[:, 3:7] /= norm(state[:, 3:7], axis=1)[:, None]
    state[:, 10:12] = 0.0
    state[30:40, 8] = np.nan
    made = predict(log, VEHICLE, 0.2, 5, state)
    assert_array_equal(made.start, np.setdiff1d(np.arange(0, n - 20, 5), [30, 35]))
    begun = state[made.start, None]
    after = made.period * np.arange(1, 21)[:, None]
    fall = np.array([0.0, 0.0, -VEHICLE.gravity])
    position = begun[..., :3] + after * (begun[..., 7:10] + 0.5 * after * fall)
    assert_allclose(made.position, position, atol=1e-9)
    assert_allclose(made.velocity, begun[..., 7:10] + after * fall, atol=1e-9)
    rate = np.broadcast_to(begun[..., 10:], made.angular_velocity.shape)
    assert_allclose(made.angular_velocity, rate, atol=1e-9)
    turn = Rotation.from_rotvec((after * rate).reshape(-1, 3))
    first = np.broadcast_to(begun[..., 3:7], made.quaternion.shape).reshape(-1, 4)
    turned = Rotation.from_quat(first, scalar_first=True) * turn
    found = Rotation.from_quat(made.quaternion.reshape(-1, 4), scalar_first=True)
    assert np.max((turned.inv() * found).magnitude()) < 1e-9


def test_a_state_of_another_form_is_refused(clean):
    log = replace(clean, name="flight")
    state = np.tile(np.eye(1, 13, 3), (len(log.t), 1))
    with refused(r"flight: state has shape \(10, 13\); expected \(5001, 13"):
        predict(log, VEHICLE, state=state[:10])
    state[7, 3:7] *= 2.0
    with refused(r"the quaternion of row 7 has length 2; expected 1"):
        predict(log, VEHICLE, state=state)


@pytest.mark.parametrize(("inertia", "most"), [(1.0, 0.045), (1.6, 0.2)])
def test_a_start_knows_the_flight_whatever_the_model(inertia, most):
    """The angular velocity of a differentiated pose has 1.4 rad/s of noise."""
    log = imu_flight(VEHICLE)
    vehicle = replace(VEHICLE, inertia=inertia * VEHICLE.inertia)
    (signals,) = log_signals(log)
    velocity = low_pass(signals.velocity, 4.0, signals.period)
    for known in (log, replace(log, gyro=None, accelerometer=None)):
        off = causal_states(known, vehicle)[200:-200, 7:]
        off = off - np.column_stack([velocity, log.gyro - [0.01, -0.005, 0.008]])[200:-200]
        speed, rate = (np.sqrt(np.mean(np.sum(x**2, axis=1))) for x in (off[:, :3], off[:, 3:]))
        assert speed < 0.02
        assert rate < (most if known.gyro is None else 0.004)


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
    (found,) = errors_of_models([log, log], [VEHICLE], 0.5, [[(2.0, 11.0)], [(2.0, 99.0)]])
    fall = VEHICLE.gravity * 0.04 / VEHICLE.mass
    assert found.horizon[[0, -1]] == pytest.approx([0.005, 0.5])
    assert found.starts == 73  # 35 and 38, up to 10.5 s, and to 0.6 s before the end
    position, velocity, attitude, _ = found.model
    assert velocity[-1] == pytest.approx(0.5 * fall, rel=0.1)
    assert position[-1] == pytest.approx(0.125 * fall, rel=0.1)
    assert attitude[-1] < 0.025  # of this, 0.02 is the start's angular velocity
    assert found.still[0, -1] < 0.2 * position[-1]
    assert found.still[1, -1] < 0.2 * velocity[-1]
    # commands of another day: the flight so far tells their thrust
    log = replace(log, commanded=True)
    (found,) = errors_of_models([log], [VEHICLE])
    assert found.model[1, -1] < 0.3 * velocity[-1]
    # by states of one's own, too, and not by lone rows of them
    rest = np.zeros((len(log.t), 13))
    rest[:, 2:4] = 1.0
    lone = np.full_like(rest, np.nan)
    lone[::200] = rest[0]
    shown, unknown = (predict(log, VEHICLE, 0.5, 200, x).velocity[5:, -1, 2] for x in (rest, lone))
    assert np.abs(shown).max() < 0.1 * fall
    assert np.abs(unknown).max() > 0.4 * fall


def test_a_turn_at_one_rate_is_no_change():
    t = np.arange(1500) * 0.005
    half = 0.4 * t
    turned = np.column_stack([np.cos(half), 0.0 * t, 0.0 * t, np.sin(half)])
    log = resting(t, position=np.outer(t, [1.0, -0.5, 0.2]), quaternion=turned)
    (found,) = errors_of_models([log], [VEHICLE])
    assert (found.still < 2e-3).all()
    assert (found.model < 2e-3).all()
    with refused(r"flight: expected a pose, unbroken for 4 s"):
        errors_of_models([replace(log, name="flight")], [VEHICLE], 3.0, [[(0.0, 2.0)]])


def test_models_are_compared_from_the_same_starts(clean):
    """A vehicle with 1,000 kg m2 keeps the body rate of its start: of another's filters here."""
    heavy = replace(VEHICLE, inertia=1e3 * np.eye(3))
    own, kept = errors_of_models([clean], [VEHICLE, heavy])
    assert_array_equal(kept.still, own.still)
    assert kept.model[3] == pytest.approx(own.still[3], rel=1e-3)
    assert (own.model[:, -1] < kept.model[:, -1]).all()


def test_noise_of_measured_speeds_is_taken_out():
    waves = [np.sin(2.0 * np.pi * f * 0.005 * np.arange(2000) + f) for f in (0.7, 1.5, 3.0, 5.0)]
    true = 1000.0 + 40.0 * np.transpose(waves)
    assert_allclose(likeliest_speeds(true, 0.005), true, atol=0.5)
    seen = true + 20.0 * default_rng(0).standard_normal(true.shape)
    assert np.square(likeliest_speeds(seen, 0.005) - true).mean() < 0.25 * 20.0**2
