import warnings
from math import nan

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from tests.support.bad_inputs import table
from tests.support.outcomes import noted, refused
from windwrench.dynamics import load_vehicle
from windwrench.identification.logs.flight_log import POSE, FlightLog, write_log
from windwrench.identification.logs.reading import read_log


@pytest.fixture
def read(tmp_path):
    """Read a hover of an AR.Drone at 100 Hz, some cells changed."""

    def read_table(changes=(), rows=20, **how):
        path = tmp_path / "flight.csv"
        path.write_text(table(changes, rows))
        return read_log(path, vehicle=load_vehicle("ardrone2"), **how)

    return read_table


def assert_same(one, other):
    columns = ("t", "position", "rotor_speeds", "voltage", "force", "torque", "valid")
    for name in (*columns, "accelerometer", "gyro", "command"):
        a = getattr(one, name)
        b = getattr(other, name)
        assert (a is None) == (b is None)
        if a is not None:
            assert_array_equal(a, b)
    assert_allclose(one.quaternion, other.quaternion, atol=1e-15)


def test_a_good_log_reads(read):
    log = read({(3, "px"): "0.1", (3, "py"): "-0.2"})
    assert log.name == "flight"
    assert log.notes == ()
    assert log.valid.all()
    assert log.period == pytest.approx(0.01)
    assert_array_equal(log.position[3], [0.1, -0.2, 1.0])
    assert_array_equal(log.rotor_speeds[0], 390.5)
    assert log.voltage is None
    assert log.force is None
    with refused("piece 2: it has 1"):
        read(piece=2)


def test_a_short_gap_of_a_rotor_is_interpolated_and_counted(read):
    """One value that is not there is no reason to refuse a flight."""
    log = read({(2, "omega2"): "370", (3, "omega2"): "nan", (4, "omega2"): "380"})
    assert log.rotor_speeds[3, 1] == pytest.approx(375.0)
    assert log.notes == ("missing values interpolated: omega2 1 (over up to 0.02 s)",)


@pytest.mark.parametrize("missing", ["", "nan"])
def test_lost_poses_are_not_valid(read, missing):
    log = read({(k, name): missing for k in (0, 5, 6) for name in POSE})
    assert_array_equal(np.flatnonzero(~log.valid), [0, 5, 6])
    assert np.isnan(log.position[5]).all()
    assert "3 of 20 rows without a pose" in log.notes[0]


@pytest.mark.parametrize("every", [{"p": 5, "q": 2}, {"p": 4, "q": 1}, {"p": 1, "q": 3}])
def test_positions_and_attitudes_of_rates_of_their_own(read, every):
    changes = {}
    for k in range(200):
        half = 0.005 * k  # a turn about z at 1 rad/s
        row = {"px": f"{0.01 * k:.6f}", "qw": f"{np.cos(half):.9f}", "qz": f"{np.sin(half):.9f}"}
        row |= {name: "" for name in POSE if k % every[name[0]]}
        changes |= {(k, name): text for name, text in row.items()}
    log = read(changes, 200)
    t = log.t[log.valid]
    assert len(t) >= 200 // every["p"] - every["q"]
    assert_allclose(np.diff(t), 0.01 * every["p"], atol=1e-9)
    assert_allclose(log.position[log.valid, 0], t, atol=1e-6)
    turned = Rotation.from_quat(log.quaternion[log.valid], scalar_first=True).as_rotvec()[:, 2]
    assert_allclose(turned, t, atol=1e-6)
    assert noted(log, "columns: by the map windwrench")


def test_a_gap_in_time_is_a_note(read):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        log = read({(19, "t"): "1.18"})
    assert log.notes == (
        "1 gap(s) in time; the longest is 1 s, at t = 0.18 s (median step 0.01 s)",
    )


@pytest.mark.parametrize("step", [1e-310, 1e-25, 1e-9])
def test_one_short_step_is_a_flight_s(read, step):
    assert read({(1, "t"): repr(step)}).t[1] == step


def in_all(names, text):
    return {(k, name): text for k in range(20) for name in names}


SPEEDS = [f"omega{i}" for i in range(1, 5)]


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (in_all(SPEEDS, "3729"), "omega1..omega4 look like revolutions per minute"),
        (in_all(SPEEDS, "62.1"), "revolutions per second"),
        ({(k, "t"): f"{10 * k}" for k in range(20)}, "milliseconds"),
        ({(7, "px"): "2500"}, "millimetres"),
    ],
)
def test_other_units_are_doubted(read, changes, expected):
    with pytest.warns(UserWarning, match=expected):
        log = read(changes)
    assert expected in log.notes[-1]
    assert log.notes[-1].startswith("warning: ")


finite = st.floats(-1e3, 1e3, allow_subnormal=False)


@st.composite
def flight_logs(draw):
    count = draw(st.integers(2, 12))
    steps = draw(arrays(float, count, elements=st.floats(1e-3, 0.4)))
    quaternions = Rotation.from_rotvec(
        draw(arrays(float, (count, 3), elements=st.floats(-3, 3)))
    ).as_quat()
    valid = draw(arrays(bool, count))
    assume(valid.sum() != 1)  # beside an IMU in rows of its own, one pose is refused
    pose = np.where(
        valid[:, None],
        np.column_stack([draw(arrays(float, (count, 3), elements=st.floats(-9, 9))), quaternions]),
        nan,
    )
    optional = draw(st.booleans())
    commanded = draw(st.booleans())
    inertial = np.where(
        draw(arrays(bool, (count, 2, 1))),
        draw(arrays(float, (count, 2, 3), elements=finite)),
        nan,
    )
    read = np.isfinite(inertial[:, :, 0]).any(axis=0)
    return FlightLog(
        t=np.cumsum(steps),
        position=pose[:, :3],
        quaternion=pose[:, [6, 3, 4, 5]],
        valid=valid,
        rotor_speeds=np.full((count, 4), nan)
        if commanded
        else draw(arrays(float, (count, 4), elements=st.floats(0, 3e3))),
        command=draw(arrays(float, (count, 4), elements=st.floats(0, 1))) if commanded else None,
        voltage=draw(arrays(float, count, elements=st.floats(2.5, 20))) if optional else None,
        force=draw(arrays(float, (count, 3), elements=finite)) if optional else None,
        torque=draw(arrays(float, (count, 3), elements=finite)) if optional else None,
        accelerometer=inertial[:, 0] if read[0] else None,
        gyro=inertial[:, 1] if read[1] else None,
    )


@pytest.mark.parametrize("suffix", [".csv.gz", ".parquet"])
@settings(max_examples=30, deadline=None)
@given(log=flight_logs())
def test_a_written_log_reads_back_exactly(tmp_path_factory, suffix, log):
    path = tmp_path_factory.getbasetemp() / f"round_trip{suffix}"
    write_log(log, path)
    assert_same(read_log(path), log)
