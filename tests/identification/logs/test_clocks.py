"""Times of a recording: wrong stamps, late rows, rollovers, and a file of two boots. Clocks of
sensors: a pose late or early against the rotor speeds, at any rate of rows and poses.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.ndimage import gaussian_filter1d

from tests.support.dataflash_writer import dataflash, imu, parm, rcou
from tests.support.flown import recorded, without_pose
from tests.support.model_flights import simulate_model
from tests.support.outcomes import noted, refused
from windwrench.dynamics import load_vehicle
from windwrench.estimator import UKFTuning
from windwrench.identification import diagnose
from windwrench.identification.logs import channels
from windwrench.identification.logs.channels import ROLLOVER, ChannelGroup, in_order
from windwrench.identification.logs.clocks import on_one_clock
from windwrench.identification.logs.flight_log import FlightLog, with_rows
from windwrench.identification.logs.pose_delay import answer_to_noise, pose_delay
from windwrench.identification.logs.reading import read_log
from windwrench.identification.motion.smoothing import resampled

T = 0.02 * np.arange(600)


def stamped(changes):
    t = T.copy()
    for row, time in changes.items():
        t[row] = time
    return t


@pytest.mark.parametrize(
    "wrong",
    [
        {100: T[100] + 40.0},
        {100: 1e12},
        {100: np.nan},
        {300: T[100] + 1e-3},
        {599: T[599] + 40.0},
        {0: T[0] - 40.0},
        {200: T[199]},
        {100: T[100] + 9.0, 101: T[101] + 9.0, 350: -3.0},
    ],
)
def test_a_wrong_stamp_costs_its_sample(wrong):
    rows, late = in_order(stamped(wrong))
    assert late == 0
    assert set(np.arange(600)) - set(rows.tolist()) == set(wrong)


def test_rows_that_were_written_late_are_sorted_in():
    order = np.arange(600)
    order[[100, 101]] = order[[101, 100]]
    order[[300, 303]] = order[[303, 300]]
    rows, late = in_order(T[order])
    assert late > 0
    assert np.array_equal(T[order][rows], T)


def test_a_clock_of_32_bits_goes_on_after_its_rollover():
    t = np.mod(T + ROLLOVER - 5.0, ROLLOVER)
    (found,), notes = channels.on_one_clock("log", [ChannelGroup(t, {"x": T})])
    assert_allclose(np.diff(found.t), 0.02, atol=1e-9)
    assert any("rolled over" in note for note in notes)


def boots():
    """A DataFlash log of two boots, of 4 and 8 s; the commands of the second are higher."""
    t = np.concatenate([T[:200] + 1.0, T[:400] + 0.5])
    name, letters, columns = rcou(t)
    high = np.arange(600) >= 200
    columns = {
        key: [v + 50 * h for v, h in zip(values, high, strict=True)] if key != "TimeUS" else values
        for key, values in columns.items()
    }
    return dataflash([parm(), imu(t), (name, letters, columns)])


def test_of_two_boots_the_longest_is_read_or_the_one_that_is_asked_for(write):
    path = write(boots(), "two.BIN")
    log = read_log(path)
    assert len(log.t) == 400
    assert noted(log, "2 pieces of 3.98, 7.98 s; piece 2 was read")
    first = read_log(path, piece=1)
    assert len(first.t) == 200
    assert first.command.mean() < log.command.mean() - 0.04
    assert noted(first, "piece 1 was read")
    with refused(r"two\.BIN: piece 3: it has 2; expected 1 to 2"):
        read_log(path, piece=3)


# rows a second, and rows a pose: more rows than rotor speeds, few poses, and few of both
FLOWN = [
    *(("ardrone2", *rates) for rates in ((200, 1), (1000, 10), (20, 1))),
    ("crazyflie", 100, 2),
    ("hummingbird", 50, 1),
]
OFFSETS = (-0.15, -0.04, 0.0, 0.1)
TICK = 0.005


@pytest.fixture(scope="module", params=["ardrone2"])
def flight(request):
    """A vehicle, and a flight of its own without anything missing."""
    vehicle = load_vehicle(request.param)
    return vehicle, recorded(seconds=30.0, seed=3, vehicle=vehicle)


def with_late_pose(log, late, rate=200, ratio=1):
    """Return a log of 200 Hz with the pose stamped ``late`` s late, in rows of a rate, with a pose
    in one row of a few.
    """
    rows = round(late / TICK)
    pose = {name: np.roll(getattr(log, name), rows, axis=0) for name in ("position", "quaternion")}
    at = np.arange(len(log.t))
    keep = (at >= abs(rows)) & (at < len(at) - abs(rows)) & (at % max(1, 200 // rate) == 0)
    log = with_rows(replace(log, **pose), keep)
    if rate > 200:
        many = rate // 200
        t = log.t[0] + np.arange((len(log.t) - 1) * many + 1) / rate
        pose = {name: np.full((len(t), x.shape[1]), np.nan) for name, x in pose.items()}
        for name, x in pose.items():
            x[::many] = getattr(log, name)
        log = FlightLog(t, **pose, rotor_speeds=resampled(t, log.t, log.rotor_speeds))
    return without_pose(log, np.arange(len(log.t)) % ratio != 0) if ratio > 1 else log


def said(notes):
    """Return the offset (s) in a note on the pose's clock, positive for a late pose."""
    (note,) = notes
    size, side = note.removeprefix("the pose is ").split(" s ")
    return float(size) * (1 if side.startswith("late") else -1)


@pytest.mark.parametrize(("flight", "rate", "ratio"), FLOWN, indirect=["flight"])
def test_a_pose_on_another_clock_is_found_at_any_rate(flight, rate, ratio):
    vehicle, log = flight
    for late in OFFSETS:
        shifted = with_late_pose(log, late, rate, ratio)
        assert pose_delay(shifted, vehicle).seconds == pytest.approx(late, abs=0.003)
        mended, notes = on_one_clock(shifted, vehicle)
        if abs(late) >= 0.1 or late == -0.04:
            assert said(notes) == pytest.approx(late, abs=0.003)
            assert pose_delay(mended, vehicle).seconds == pytest.approx(0.0, abs=0.004)
        if late == 0.0:
            assert notes == ()
            assert mended is shifted


def test_a_late_pose_leaves_the_flight_as_it_was(flight):
    vehicle, log = flight
    mended, notes = on_one_clock(with_late_pose(log, 0.04), vehicle)
    assert "answer the pose's noise ahead of its rows" in notes[0]
    rows = slice(8, 8 + len(mended.t))  # the first 8 poses have no rotor speeds
    assert_allclose(mended.position, log.position[rows], rtol=0.0)
    assert_allclose(mended.rotor_speeds, log.rotor_speeds[rows], rtol=1e-9)


def test_a_vehicle_s_own_delay_is_no_clock(flight):
    vehicle, _ = flight
    for effects in (
        {"latency": {"d": 0.035}},
        {"motor_lag": {"tau": 0.05}},
        {"motor_lag": {"tau": 0.03}, "latency": {"d": 0.02}},
        {"clock_offset": {"dt": -0.02}},
    ):
        log = recorded(seconds=20.0, seed=5, vehicle=vehicle, **effects)
        assert on_one_clock(log, vehicle) == (log, ())


def test_turns_by_rough_rotors_are_no_answer_to_noise():
    vehicle, rng = load_vehicle("ardrone2"), np.random.default_rng(0)
    slow = gaussian_filter1d(rng.standard_normal((6000, 4)), 16.0, axis=0)
    speeds = vehicle.hover_rate + 12.0 * slow / slow.std() + 5.0 * rng.standard_normal(slow.shape)
    quiet = UKFTuning(1e-4, 1e-6, 1e-3, 1e-5, position_noise=0.001, attitude_noise=0.0005)
    t, speeds, position, quaternion = simulate_model(vehicle, quiet, speeds).log()
    flown = FlightLog(t, position, quaternion, speeds)
    for late in (0.0, 0.035):  # of a vehicle with a latency
        log = with_late_pose(flown, late)
        delay = pose_delay(log, vehicle).seconds
        assert delay == pytest.approx(late, abs=0.003)
        assert answer_to_noise(log, vehicle, delay) is None
        assert on_one_clock(log, vehicle) == (log, ())


def test_seldom_measured_rotor_speeds_are_no_clock(flight):
    vehicle, log = flight
    held = np.arange(len(log.t)) // 20 * 20
    log = replace(log, rotor_speeds=log.rotor_speeds[held], rates={"rotors": 10.0})
    assert pose_delay(log, vehicle).seconds == pytest.approx(-0.05, abs=0.01)
    assert on_one_clock(log, vehicle) == (log, ())


@pytest.mark.parametrize("late", [-0.3, 0.3])
def test_an_offset_at_the_bound_of_the_search_is_said(flight, late):
    vehicle, log = flight
    shifted = with_late_pose(log, late)
    mended, notes = on_one_clock(shifted, vehicle)
    assert mended is shifted
    assert "0.3 s or more" in notes[0]
    assert "the search ends there" in notes[0]


@pytest.mark.slow
@pytest.mark.parametrize(("rate", "ratio"), [(200, 1), (200, 2), (200, 3), (100, 1), (1000, 10)])
@pytest.mark.parametrize("late", [-0.15, -0.08, 0.0, 0.04, 0.08, 0.15])
def test_a_diagnosis_invents_nothing_on_another_clock(flight, rate, ratio, late):
    vehicle, log = flight
    mended, _ = on_one_clock(with_late_pose(log, late, rate, ratio), vehicle)
    assert diagnose([mended], vehicle).effects == ()
