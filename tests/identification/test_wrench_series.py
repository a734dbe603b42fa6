"""The wrench along a log: by its poses, and by an IMU."""

import csv
from dataclasses import replace
from math import nan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.linalg import inv, norm
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from tests.support.flown import noisy, resting, without_pose
from tests.support.imu_flights import imu_flight, pose_removed
from tests.support.outcomes import noted, refused
from tests.support.vehicles import VEHICLE
from windwrench.dynamics.vehicle import EffectSetting
from windwrench.estimator import WrenchUKF
from windwrench.estimator.row_steps import steps_between
from windwrench.identification.inertial_wrench import _two_sided
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.logs.flight_phases import (
    FLIGHT,
    GROUND,
    LANDING,
    TAKE_OFF,
    flight_phases,
)
from windwrench.identification.wrench_series import (
    GATE,
    counts,
    estimate_log,
    truth_rmse,
    tune_to_log,
    write_wrench,
)
from windwrench.identification.wrench_track import write_mcap

WRENCH = [f"{kind}{axis}" for kind in "ft" for axis in "xyz"]
HEADER = ["t", *WRENCH, *(f"std_{name}" for name in WRENCH), "nis", "status"]


def held_flight(t, lift=0.3, lost=None):
    """A vehicle at rest in the air while something carries ``lift`` N of its weight."""
    log = resting(
        t,
        rotor_speeds=np.full((len(t), 4), VEHICLE.hover_rate * np.sqrt(1 - lift / VEHICLE.weight)),
        name="held",
        source="held.csv",
        force=np.tile([0.0, 0.0, lift], (len(t), 1)),
        torque=np.zeros((len(t), 3)),
    )
    position, quaternion = noisy(VEHICLE.mocap, default_rng(0), log.position, log.quaternion)
    log = replace(log, position=position, quaternion=quaternion)
    return log if lost is None else without_pose(log, lost)


def finite(series):
    return np.isfinite(series.state[:, :19]).all() and np.isfinite(series.std).all()


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), jitter=st.floats(0.0, 0.9), share=st.floats(0.0, 0.9))
def test_uneven_times_and_lost_poses_give_a_finite_wrench(seed, jitter, share):
    rng = default_rng(seed)
    t = np.cumsum(0.01 * (1 + jitter * rng.uniform(-1, 1, 300)))
    lost = rng.random(300) < share
    lost[rng.integers(300)] = False
    series = estimate_log(held_flight(t, lost=lost), VEHICLE)
    assert finite(series)
    assert_array_equal(np.isfinite(series.nis), ~lost & (np.arange(300) > np.argmin(lost)))


@pytest.mark.parametrize("with_imu", [False, True])
def test_a_log_is_the_calls_of_a_filter(with_imu):
    """To the last bit: with late rows, lost and wild poses, and sensors read in some rows."""
    rng = default_rng(2)
    t = np.cumsum(rng.choice([0.005, 0.012], 400))
    log = held_flight(t, lost=slice(150, 220))
    log.position[300:320] += 0.2
    if with_imu:
        gyro, force = 0.02 * rng.standard_normal((2, 400, 3)) + np.array([[0.0], [9.81]])[:, None]
        gyro[::3] = nan
        force[::2] = nan
        log = replace(log, gyro=gyro, accelerometer=force * [0.0, 0.0, 1.0])
    found = estimate_log(log, VEHICLE)
    ukf = WrenchUKF(VEHICLE, None, log.period, GATE)
    ukf.reset(log.position[0], log.quaternion[0])
    for k in range(1, 400):
        for step in steps_between(t[k] - t[k - 1], ukf.period):
            ukf.predict(0.5 * (log.rotor_speeds[k - 1] + log.rotor_speeds[k]), step)
        sensors = [x[k] for x in (log.gyro, log.accelerometer) if x is not None]
        read = [x if np.isfinite(x).all() else None for x in sensors]
        if any(x is not None for x in read):
            ukf.correct_imu(*read)
        if log.valid[k]:
            ukf.correct(log.position[k], log.quaternion[k])
        now = ukf.estimate
        assert_array_equal(found.state[k, :19], now.state[:19])
        assert_array_equal(found.std[k], now.std)
        assert_array_equal(found.loads[k], ukf.record["load"][0])
        assert found.status[k] == now.status
    assert found.restarts[-1] == now.restarts


def test_a_gap_widens_the_band_and_is_bridged():
    t = 0.005 * np.arange(2000)
    t[1000:] += 1.0
    series = estimate_log(held_flight(t), VEHICLE)
    assert (series.std[1000, 15:] > 1.05 * series.std[999, 15:]).all()
    # at its default noise the filter has lost the attitude in a second
    assert (series.restarts[-1], series.status[1000]) == (1, "restarted")
    assert "the filter restarted at t = 6 s: after a gap" in series.notes[0]
    assert finite(series)
    # one prediction of a second instead of 200 would leave the attitude's covariance no meaning
    assert_allclose(series.force[1400:].mean(axis=0), [0, 0, 0.3], atol=0.05)


@pytest.mark.parametrize("smooth", [False, True])
def test_wild_poses_are_refused_and_said(smooth):
    log = held_flight(0.005 * np.arange(1200))
    position = log.position.copy()
    position[500:1100:100] += [0.1, -0.1, 0.1]
    spoiled = replace(log, position=position)
    series = estimate_log(spoiled, VEHICLE, smooth=smooth)
    assert "6 of 1200 poses jump from those before and were refused" in series.notes[-1]
    assert counts(series)["rejected"] == 6
    clean = estimate_log(log, VEHICLE, smooth=smooth)
    assert abs(series.force - clean.force).max() < 0.03
    # no gate: each of them, and each way back, is a jump for good
    assert estimate_log(spoiled, VEHICLE, gate=None).restarts[-1] >= 6


def test_smoothing_is_the_filters_nis_with_a_narrower_band():
    lost = slice(400, 440)
    log = held_flight(0.005 * np.arange(1200), lost=lost)
    filtered = estimate_log(log, VEHICLE)
    smoothed = estimate_log(log, VEHICLE, smooth=True)
    assert np.allclose(filtered.nis, smoothed.nis, equal_nan=True)
    assert np.allclose(filtered.force[-1], smoothed.force[-1])
    inner = slice(100, -100)
    assert (smoothed.std[inner, 12:] < 0.9 * filtered.std[inner, 12:]).all()  # of noise
    # nothing crosses a new start
    t = np.concatenate([0.005 * np.arange(600), 20.0 + 0.005 * np.arange(600)])
    apart = held_flight(t, lost=slice(590, 610))
    found = estimate_log(apart, VEHICLE, smooth=True)
    first = {
        name: getattr(apart, name)[:590] for name in ("t", "position", "quaternion", "rotor_speeds")
    }
    alone = estimate_log(FlightLog(**first), VEHICLE, smooth=True)
    assert np.allclose(found.force[:590], alone.force, rtol=0, atol=1e-6)
    assert np.allclose(found.std_force[:590], alone.std_force, rtol=1e-6)


def test_rows_before_the_first_pose_have_a_wrench():
    series = estimate_log(held_flight(0.005 * np.arange(100), lost=slice(0, 30)), VEHICLE)
    assert finite(series)
    assert_array_equal(series.force[:31], 0.0)
    assert_array_equal(series.std_force[:30], np.tile(series.std_force[30], (30, 1)))


def test_a_log_without_a_pose_is_refused():
    with refused(r"held.csv: no row has a pose; expected at least one"):
        estimate_log(held_flight(0.005 * np.arange(10), lost=slice(0, 10)), VEHICLE)


def test_wrench_csv(tmp_path):
    log = held_flight(0.005 * np.arange(50), lost=slice(10, 20))
    series = estimate_log(log, VEHICLE)
    path = tmp_path / "new" / "folder" / "wrench.csv"
    write_wrench(series, path)
    assert [p.name for p in path.parent.iterdir()] == ["wrench.csv"]
    with path.open() as file:
        rows = list(csv.reader(file))
    assert rows[0] == HEADER
    values = np.array(rows[1:], dtype=float)
    assert_array_equal(values[:, 0], log.t)
    wrench = np.column_stack([series.force, series.torque])
    std = np.column_stack([series.std_force, series.std_torque])
    for found, known in ((values[:, 1:7], wrench), (values[:, 7:13], std)):
        assert_allclose(found, known, rtol=1e-8, atol=0.0)
    assert_allclose(values[:, 13], series.nis, rtol=1e-8)
    assert max(len(field.lstrip("-0.")) for row in rows[1:] for field in row[1:]) < 15
    (tmp_path / "file").write_text("")
    with refused("cannot be written"):
        write_wrench(series, tmp_path / "file" / "wrench.csv")


def test_a_track_of_the_wrench_is_a_bag_that_ros_s_reader_opens(tmp_path):
    log = held_flight(0.005 * np.arange(50))
    series = estimate_log(log, VEHICLE)
    path = tmp_path / "new" / "wrench.mcap"
    write_mcap(series, path)
    assert [p.name for p in path.parent.iterdir()] == ["wrench.mcap"]
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        assert set(reader.topics) == {"/wrench", "/wrench_std", "/pose"}
        read = [
            (c.topic, at, reader.deserialize(raw, c.msgtype)) for c, at, raw in reader.messages()
        ]
    wrench = [message.wrench for topic, _, message in read if topic == "/wrench"]
    assert_array_equal([w.force.x for w in wrench], series.force[:, 0])
    assert_array_equal([w.torque.z for w in wrench], series.torque[:, 2])
    poses = [(at, m.pose) for topic, at, m in read if topic == "/pose"]
    assert_allclose([1e-9 * at for at, _ in poses], log.t, atol=1e-9)
    assert_array_equal([p.orientation.w for _, p in poses], series.quaternion[:, 0])


# phases


def hop(top, bounce):
    t, edges = (
        np.arange(0.0, 11.0, 0.01),
        np.array([2.0, 3.0, 8.0, 9.0]),
    )  # up, aloft, down, at rest
    height = 0.06 + np.interp(t, edges, [0.0, top, top, 0.0])
    height += bounce * np.exp(-(((t - edges[3] - 0.2) / 0.05) ** 2))
    turning = (t > 1.5) & (t < edges[3] + 0.4)
    return t, height, np.where(turning[:, None], VEHICLE.hover_rate, 0.0) * np.ones(4), edges


@pytest.mark.parametrize(("top", "bounce"), [(1.0, 0.0), (1.0, 0.1), (3.0, 0.2), (0.3, 0.0)])
def test_phases_of_a_hop(top, bounce):
    t, height, speeds, edges = hop(top, bounce)
    phases = flight_phases(t, height, speeds, VEHICLE)
    assert [phase.name for phase in phases] == [GROUND, TAKE_OFF, FLIGHT, LANDING, GROUND]
    assert_allclose([phase.end for phase in phases[:4]], edges, atol=0.3)
    assert phases[0].start == t[0]
    assert phases[-1].end == t[-1]


def test_a_log_that_was_filtered_before_it_was_written_has_no_tuning_to_fit():
    """A hover whose pose has no noise: neither pose noise nor walk is found."""
    t = 0.005 * np.arange(800)
    log = held_flight(t, lift=0.0)
    position = log.position[0] + 1e-7 * np.sin(t)[:, None]  # or each pose repeats the last one
    quaternion = np.tile(log.quaternion[0], (len(t), 1))
    with refused("filtered before it was written") as caught:
        tune_to_log(replace(log, position=position, quaternion=quaternion), VEHICLE)
    assert "\n" not in str(caught.value)


PUSH = EffectSetting("constant_force", {"fx": 0.0, "fy": 0.0, "fz": -0.4})


@pytest.fixture(scope="module")
def flown():
    """A flight of 15 s under a steady force."""
    return imu_flight(VEHICLE, (PUSH,), seconds=15.0)


def test_an_imu_alone_shows_a_vertical_force(flown):
    """Within its own deviations, which say that horizontal ones are worse known."""
    series = estimate_log(pose_removed(flown), VEHICLE)
    inner = slice(400, -400)
    assert abs(float(series.force[inner, 2].mean()) + 0.4) < 0.1
    z = abs(series.force - flown.force)[inner] / series.std[inner, 15:]
    assert (z.mean(axis=0) < 2.0).all()
    assert np.isnan(series.nis).all()
    assert noted(series, "no pose")


def test_an_imu_beside_the_pose_is_smoothed(flown):
    smoothed = truth_rmse(estimate_log(flown, VEHICLE, smooth=True), flown)
    filtered = truth_rmse(estimate_log(flown, VEHICLE), flown)
    assert (smoothed[0] < filtered[0]).all()
    assert (smoothed[1] < filtered[1]).all()


def test_gyro_and_accelerometer_of_a_log_sharpen_its_estimate(flown):
    """Sensors at 200 Hz beside a pose at 50 Hz, in a log whose other rows have no pose."""
    log = without_pose(flown, np.arange(len(flown.t)) % 4 > 0)
    force = log.accelerometer - [0.05, -0.1, 0.08]  # less its bias
    force[7::10] = nan  # not read
    log = replace(log, accelerometer=force)

    def errors(**less):
        series = estimate_log(replace(log, **less), VEHICLE)
        assert_array_equal(np.isfinite(series.nis[1:]), log.valid[1:])
        return [
            norm((x - y)[400:]) for x, y in ((series.force, log.force), (series.torque, log.torque))
        ]

    force, torque = errors(accelerometer=None, gyro=None)
    assert errors(gyro=None)[0] < 0.7 * force
    assert errors(accelerometer=None)[1] < 0.5 * torque


def test_a_tuning_needs_poses(flown):
    with refused("to fit a tuning to"):
        tune_to_log(pose_removed(flown), VEHICLE)


def test_the_force_is_the_posterior_of_a_walk():
    """Far from the ends, where the start is forgotten, a dense solution says the same."""
    rng = default_rng(0)
    n = 400
    walk = 0.01
    variance = 1.0
    y = np.cumsum(np.sqrt(walk) * rng.standard_normal(n)) + rng.standard_normal(n)
    found, std = _two_sided(y[:, None], np.eye(1), np.diag([walk]), variance)
    between = np.diff(np.eye(n), axis=0)
    covariance = inv(np.eye(n) / variance + between.T @ between / walk)
    inner = slice(150, 250)
    assert_allclose(found[inner, 0, 0], (covariance @ y / variance)[inner], atol=1e-5)
    assert std[0] == pytest.approx(np.sqrt(covariance[200, 200]), rel=1e-4)
