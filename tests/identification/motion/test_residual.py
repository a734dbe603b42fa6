"""The motion that a log shows, by its poses or by an IMU, whether its pose was filtered, and the
residual, which is Newton's and Euler's balance.
"""

from dataclasses import replace
from math import nan

import numpy as np
import pytest
from numpy.linalg import norm
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from scipy.signal import butter, sosfilt, sosfiltfilt
from scipy.spatial.transform import Rotation

from tests.support.flown import VEHICLE, recorded, resting
from tests.support.imu_flights import imu_flight
from tests.support.outcomes import refused
from tests.support.sizes import rms
from windwrench import _core
from windwrench.dynamics import EffectSetting, load_vehicle, preset_names
from windwrench.dynamics.effects import compile_effects
from windwrench.evidence.residual_wrench import residual_wrench
from windwrench.evidence.trials.logged_poses import FILTERS
from windwrench.evidence.trials.practice_flights import fly_practice
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.motion.inertial_fusion import ImuPiece, Readings, fuse
from windwrench.identification.motion.inertial_signals import inertial_signals
from windwrench.identification.motion.noise_spectrum import (
    filtering_notes,
    noise_spectra,
    pose_was_filtered,
)
from windwrench.identification.motion.sensor_noise import noisy_logs
from windwrench.identification.motion.signals import log_signals
from windwrench.identification.motion.smoothing import high_pass, lagged, low_pass, robust_std

AMENDED = VEHICLE.with_effects(
    EffectSetting("mass", {"dm": 0.05}),
    EffectSetting("inertia", {"jx": 0.1, "jy": -0.2, "jz": 0.3}),
    EffectSetting("com_offset", {"cx": 0.01, "cy": 0.003, "cz": -0.02}),
)


def test_the_residual_is_newton_and_euler():
    (flown,) = log_signals(fly_practice(VEHICLE, seconds=6.0, seed=1))
    body = compile_effects(AMENDED).vehicle
    rotors = body.rotor_wrench(flown.rotor_speeds)
    R = flown.rotation
    omega = flown.angular_velocity
    alpha = flown.angular_acceleration
    centre = np.cross(alpha, body.com) + np.cross(omega, np.cross(omega, body.com))
    acceleration = (
        flown.acceleration
        + np.array([0.0, 0.0, AMENDED.gravity])
        + np.einsum("nij,nj->ni", R, centre)
    )
    force = body.mass * acceleration - R[:, :, 2] * rotors[:, :1]
    momentum = omega @ body.inertia.T
    thrust = rotors[:, :1] * [0.0, 0.0, 1.0]
    torque = alpha @ body.inertia.T + np.cross(omega, momentum)
    torque -= rotors[:, 1:] - np.cross(body.com, thrust)
    assert_allclose(residual_wrench(flown, AMENDED), np.column_stack([force, torque]), atol=1e-10)


@pytest.mark.parametrize("shape", [(10, 1), (500,), (500, 2), (500, 3, 3)])
def test_the_low_pass_is_that_of_scipy(shape):
    x = np.cumsum(default_rng(0).standard_normal(shape), axis=0)
    for cutoff in (1.0, 5.0, 40.0):
        there = sosfiltfilt(butter(2, cutoff / 100.0, output="sos"), x, axis=0)
        assert_allclose(low_pass(x, cutoff, 0.005), there)


def test_the_size_of_white_noise_is_read_behind_a_high_pass_and_through_outliers():
    noise = 0.02 * default_rng(0).standard_normal((20_000, 1))
    assert robust_std(noise) == pytest.approx(0.02, rel=0.02)
    assert robust_std(high_pass(noise, 0.25)) == pytest.approx(0.02, rel=0.03)
    noise[::50] += 1.0
    assert robust_std(noise) == pytest.approx(0.02, rel=0.05)


@pytest.mark.parametrize("lag", [0.004, 0.03, 0.2])
def test_a_first_order_lag_has_made_63_per_cent_of_a_step_after_its_time(lag):
    """At rest before the step, and each sample held over the period that ends there."""
    period = 0.005
    rest = np.array([300.0, -1.0])
    step = np.array([100.0, 2.0])
    x = rest + np.outer(np.arange(200) >= 20, step)
    since = np.maximum(period * (np.arange(200) - 19), 0.0)
    made = rest + np.outer(1.0 - np.exp(-since / lag), step)
    assert_allclose(lagged(x, lag, period), made, rtol=1e-12)
    assert_array_equal(lagged(x, 0.0, period), x)


def test_a_gap_ends_a_piece_and_a_lost_sample_does_not():
    log = recorded(seconds=12.0)
    valid = np.ones(len(log.t), dtype=bool)
    valid[500:503] = False
    valid[1200:1300] = False
    pieces = log_signals(replace(log, valid=valid))
    assert [round(piece.t[-1] - piece.t[0], 1) for piece in pieces] == [6.0, 5.5]
    with refused("3 s"):
        log_signals(replace(log, valid=np.arange(len(log.t)) < 300))


def still_log(rate, seconds=20.0, **channels):
    """A log of a vehicle at rest in the air, without any noise."""
    return resting(np.arange(round(rate * seconds)) / rate, **channels)


@pytest.mark.parametrize(("lost", "pieces"), [(2, 1), (4, 2)])
def test_at_20_hz_two_lost_samples_are_bridged_and_four_are_a_gap(lost, pieces):
    log = still_log(20.0)
    log.valid[200 : 200 + lost] = False
    assert len(log_signals(log)) == pieces


@pytest.mark.parametrize(
    ("own", "hidden", "added"), [(0.0, False, 0.0), (0.0, True, 1.0), (5.0, True, 5.0)]
)
def test_noise_that_a_filter_hid_is_what_the_vehicle_states_of_its_motion_capture(
    own, hidden, added
):
    """In units of the vehicle's."""
    log = still_log(200.0)
    stated = VEHICLE.mocap.sigma_pos_m
    noise = default_rng(1).standard_normal(log.position.shape)
    log = replace(log, position=own * stated * noise)
    (noisier,) = noisy_logs([log], VEHICLE, hidden)
    assert (noisier.position - log.position).std() == pytest.approx(added * stated, rel=0.05)


def test_an_imu_at_1_khz_tells_as_much_as_one_of_half_its_noise_at_250_hz():
    found = []
    for rate, size in ((1000.0, 2.0), (250.0, 1.0)):
        rng = default_rng(0)
        log = still_log(rate, 8.0)
        position = np.full_like(log.position, nan)
        tenth = slice(None, None, round(rate / 10.0))
        position[tenth] = 0.002 * rng.standard_normal(position[tenth].shape)
        gyro = 0.01 * size * rng.standard_normal(position.shape)
        force = [0.0, 0.0, GRAVITY] + 0.1 * size * rng.standard_normal(position.shape)
        (signals,) = inertial_signals(
            replace(
                log,
                position=position,
                quaternion=np.full_like(log.quaternion, nan),
                valid=np.zeros(len(log.t), dtype=bool),
                gyro=gyro,
                accelerometer=force,
            ),
            GRAVITY,
        )
        found.append(signals.std[-1, :6])
    assert_allclose(found[0], found[1], rtol=0.15)


@pytest.fixture(scope="module", params=["excite", "hover"])
def log(request):
    return recorded(request.param, 15.0, 5)


@pytest.mark.parametrize("name", list(FILTERS))
def test_what_was_filtered_is_recognised_and_what_was_not_is_not(log, name):
    filtered = FILTERS[name](log, VEHICLE)
    assert pose_was_filtered(filtered) == (name != "as measured")
    notes = filtering_notes(filtered)
    assert [note.partition(" filtered before the log was written")[0] for note in notes] == (
        [] if name == "as measured" else ["the position and attitude were"]
    )
    assert all("so the noise floor is a lower bound" in note for note in notes)


@pytest.mark.parametrize("seed", range(10))
def test_white_noise_is_level(seed):
    rng = default_rng(seed)
    n = 2000
    spin = 0.005 * rng.standard_normal((n, 3))
    quaternion = np.column_stack([np.sqrt(1.0 - np.sum(spin**2, axis=1)), spin])
    position = 0.001 * rng.standard_normal((n, 3)) + np.sin(np.arange(n) / 100.0)[:, None]
    speeds = 400.0 + rng.standard_normal((n, 4))
    noise = noise_spectra(FlightLog(np.arange(n) / 200.0, position, quaternion, speeds))
    assert [x.channel for x in noise] == ["position", "attitude", "rotor speeds"]
    for x in noise:
        assert abs(x.slope) < 0.5
        assert abs(x.fall - 1.0) < 0.25
        assert not x.filtered


def test_channels_are_asked_one_by_one(log):
    white = default_rng(1).standard_normal((len(log.t), 3))
    gyro = np.full_like(white, nan)  # not read in every row
    gyro[::2] = sosfilt(butter(2, 0.1, output="sos"), white[::2], axis=0)
    made = replace(log, accelerometer=white, gyro=gyro)
    (note,) = filtering_notes(made)
    assert note.startswith("the gyro was filtered before the log was written")
    assert "Its noise cannot be read from this log" in note
    assert not pose_was_filtered(made)


def test_a_log_that_is_short_or_still_says_nothing():
    still = still_log(100.0, 3.0)
    assert noise_spectra(still) == []
    assert filtering_notes(still) == ()


@pytest.mark.parametrize("vehicle", preset_names())
@pytest.mark.parametrize("trajectory", ["hover", "fast"])
def test_a_rotor_s_own_lag_is_no_filter(vehicle, trajectory):
    log = recorded(trajectory, 15.0, 5, vehicle=load_vehicle(vehicle))
    assert filtering_notes(log) == ()
    smoothed = sosfilt(butter(1, 0.2, output="sos"), log.rotor_speeds, axis=0)
    (note,) = filtering_notes(replace(log, rotor_speeds=np.abs(smoothed)))
    assert note.startswith("the rotor speeds were filtered before the log was written")


GRAVITY = VEHICLE.gravity
HEADING = Rotation.from_euler("z", 2.0)


@pytest.fixture(scope="module")
def flown():
    """A flight with noisy and biased sensors, seen from a world that is turned by 2 rad: the log,
    and velocity and attitude by its poses, smoothed.
    """
    log = imu_flight(VEHICLE, seconds=40.0, trajectory="yaw")
    (signals,) = log_signals(log)
    velocity = low_pass(signals.velocity, 4.0, signals.period)
    turned = replace(log, position=HEADING.apply(log.position))
    return turned, HEADING.apply(velocity), HEADING.as_matrix() @ signals.rotation


def fused_of(log, *positions):
    piece = ImuPiece(log.t, log.gyro, log.accelerometer, GRAVITY, (0.005, 0.1))
    return fuse(piece, *positions)


def test_an_imu_alone_keeps_the_vertical(flown):
    """Tilt within some mrad, as it says; heading from zero, and velocity not known."""
    log, _, rotation = flown
    fused = fused_of(log)
    at = np.searchsorted(log.t, fused.t - 1e-9)
    error = norm(fused.rotation.as_matrix()[:, 2] - rotation[at][:, 2], axis=1)
    assert rms(error) < 0.02
    assert np.mean(error < 2.5 * np.hypot(fused.std[:, 0], fused.std[:, 1])) > 0.95
    assert abs(fused.rotation[0].as_euler("ZYX")[0]) < 0.1
    assert (fused.std[:, 3:6] > 4.0).all()


def test_ten_positions_a_second_show_heading_velocity_and_biases(flown):
    log, velocity, rotation = flown
    every = slice(None, None, 20)
    positions = Readings(log.t[every], log.position[every], VEHICLE.mocap.sigma_pos_m)
    fused = fused_of(log, positions)
    at = np.searchsorted(log.t, fused.t - 1e-9)
    off = (Rotation.from_matrix(rotation[at]).inv() * fused.rotation).as_rotvec()
    assert np.abs(off).max() < 0.02
    z = (fused.linear[:, :3] - velocity[at]) / fused.std[:, 3:6]
    assert 0.3 < rms(z) < 2.0
    middle = len(at) // 2
    assert_allclose(fused.linear[middle, 6:9], [0.01, -0.005, 0.008], atol=0.002)
    assert_allclose(fused.linear[middle, 9:], [0.05, -0.1, 0.08], atol=0.03)


def test_the_smoother_of_an_imu_is_least_squares_over_all_knots():
    rng, knots, size = default_rng(3), 6, 15
    F = np.eye(size) + 0.2 * rng.standard_normal((knots - 1, size, size))
    defect = rng.standard_normal((knots - 1, size))
    noise, prior, prior_std = rng.uniform(0.5, 2.0, (3, size))
    at, first = np.array([0, 2, 2, 5]), np.array([3, 6, 0, 6])
    late, off, variances = rng.uniform(-0.1, 0.1, 4), rng.standard_normal((4, 3)), np.full(4, 0.3)
    x, std = np.zeros((2, knots, size))
    x[0], std[0] = prior, prior_std
    readings = at, first, late, off, variances
    assert _core.smooth_inertial_motion(F, defect, noise, *readings, x, std)
    # one row for each statement on all states (knots * size), in its standard deviations
    every = np.eye(knots * size).reshape(knots, size, -1)
    rows, values = [every[0] / prior_std[:, None]], [prior / prior_std]
    for k in range(knots - 1):
        rows.append((every[k + 1] - F[k] @ every[k]) / np.sqrt(noise)[:, None])
        values.append(defect[k] / np.sqrt(noise))
    for k, i, behind, z in zip(at, first, late, off, strict=True):
        moved = behind * every[k, 3:6] if i == 6 else 0.0
        rows.append((every[k, i : i + 3] + moved) / np.sqrt(0.3))
        values.append(z / np.sqrt(0.3))
    A = np.vstack(rows)
    assert_allclose(x.ravel(), np.linalg.lstsq(A, np.concatenate(values))[0], atol=1e-10)
    assert_allclose(std.ravel(), np.sqrt(np.diag(np.linalg.inv(A.T @ A))), atol=1e-10)
