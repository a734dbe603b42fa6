"""Maps: what the columns of somebody's table mean, and the flight log that follows."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.random import default_rng
from numpy.testing import assert_allclose

from tests.support.outcomes import noted, refused
from tests.support.random_tables import flight, random_table, save
from windwrench.dynamics import load_vehicle
from windwrench.identification.logs.flight_log import with_rows
from windwrench.identification.logs.log_map import load_map, map_names, parse_map
from windwrench.identification.logs.mapped_log import map_table
from windwrench.identification.logs.reading import read_log
from windwrench.identification.logs.text_table import open_table

GOOD = {
    "time": {"column": "t"},
    "position": {"columns": ["x", "y", "z"]},
    "attitude": {"columns": ["qx", "qy", "qz", "qw"], "order": "xyzw"},
    "rotors": {"columns": ["m1", "m2", "m3", "m4"], "unit": "rpm", "order": "betaflight"},
}


@pytest.fixture(scope="module")
def flown():
    """Six seconds of a simulated flight with an IMU, commands and a voltage."""
    return flight("ardrone2", "excite", 3, 6.0)


def assert_same(found, true):
    assert_allclose(found.t, true.t - true.t[0], atol=2e-6)
    if found.has_pose:
        assert_allclose(found.position, true.position, atol=1e-9)
        same = np.sum(found.quaternion * true.quaternion, axis=1)
        assert_allclose(np.abs(same), 1.0, atol=1e-9)
    if found.command is not None:
        assert_allclose(found.command, true.command, atol=1e-9)
    else:
        assert_allclose(found.rotor_speeds, true.rotor_speeds, rtol=1e-9)
    for name in ("accelerometer", "gyro", "voltage"):
        if getattr(found, name) is not None:
            assert_allclose(getattr(found, name), getattr(true, name), atol=1e-9)


@given(seed=st.integers(0, 2**32 - 1))
@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_any_convention_and_its_map_give_the_same_flight(tmp_path, flown, seed):
    """Separators, decimal commas, units, frames, quaternion and Euler orders, rotor orders."""
    rng = default_rng(seed)
    first = int(rng.integers(0, len(flown.t) - 60))
    rows = np.zeros(len(flown.t), bool)
    rows[first : first + 50] = True
    true = with_rows(flown, rows)
    true = replace(true, t=true.t - true.t[0])
    written = random_table(true, rng)
    found = map_table(open_table(save(written, tmp_path / "table.csv")), written.log_map)
    assert_same(found, true)
    assert found.has_pose == (written.log_map.position is not None)
    assert (found.gyro is None) == (written.log_map.gyro is None)


@pytest.mark.parametrize("name", map_names())
def test_each_map_that_ships_is_a_map(name):
    found = load_map(name)
    assert found.about
    assert found.name == name


def test_a_world_has_several_names():
    for name, meant in {"nwu": "enu", "flu": "enu", "FRD": "ned", "y_up": "y_up"}.items():
        assert parse_map({**GOOD, "world": name}, "map").world == meant


def table(path, columns, count=40):
    """Write a hover; a column is a number, or a list of fields."""
    good = {"t": [f"{0.01 * k:.2f}" for k in range(count)]}
    good |= {"x": 0.1, "y": 0.2, "z": 1.0, "qx": 0, "qy": 0, "qz": 0, "qw": 1}
    good |= dict.fromkeys(("m1", "m2", "m3", "m4"), 3600.0) | columns
    texts = [v if isinstance(v, list) else [str(v)] * count for v in good.values()]
    rows = [",".join(row) for row in zip(*texts, strict=True)]
    path.write_text("\n".join([",".join(good), *rows]) + "\n")
    return path


def test_a_map_file_is_taken_by_read_log(tmp_path):
    """Betaflight's motor 1 is the rear right one, the kit's rotor 3."""
    (tmp_path / "map.yaml").write_text(yaml.safe_dump(GOOD))
    log = read_log(table(tmp_path / "a.csv", {"m1": 3000.0}), map=tmp_path / "map.yaml")
    assert_allclose(log.rotor_speeds[0] * 30 / pi, [3600, 3600, 3000, 3600])


def mapped(path, stated=GOOD):
    return map_table(open_table(path), parse_map(stated, "m"))


def apart(first, empty=""):
    """Return 80 rows of a pose in every second row, from ``first`` on, and of rotors between."""
    pose = {
        name: [value if k % 2 == first else "" for k in range(80)]
        for name, value in zip(("x", "y", "z", "qx", "qy", "qz", "qw"), "0010001", strict=True)
    }
    speeds = [empty if k % 2 == first else f"{3600 + k}" for k in range(80)]
    return {**pose, **dict.fromkeys(("m1", "m2", "m3", "m4"), speeds)}


@pytest.mark.parametrize("own", [False, True])
@pytest.mark.parametrize(
    "steps",  # s between samples of pose, rotors and IMU
    [(0.01, 0.02, 0.0), (0.01, 0.016, 0.0), (0.01, 0.005, 0.0), (0.01, 0.02, 0.005)],
)
def test_channels_in_rows_of_their_own_meet_at_the_poses_times(tmp_path, own, steps):
    """As PlotJuggler and exports of bags write them, whatever the pattern of the rates."""
    kinds = {
        "px py pz qw qx qy qz": (0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0),
        "omega1 omega2 omega3 omega4": (400.0,) * 4,
        "ax ay az gx gy gz": (0.0, 0.0, 9.81, 0.0, 0.0, 0.0),
    }
    begins = (0.0, 0.0 if steps[1] == 0.016 else 0.003, 0.0007)
    rows = {}
    for (names, values), step, begin in zip(kinds.items(), steps, begins, strict=True):
        for t in np.arange(begin, 2.0, step) if step else ():
            row = rows.setdefault(round(float(t), 6), {})
            row |= dict(zip(names.split(), values, strict=True)) | (
                {"pz": t} if "pz" in names else {}
            )
    header = [
        name for names, step in zip(kinds, steps, strict=True) if step for name in names.split()
    ]
    lines = [",".join(map(str, [t, *(rows[t].get(n, "") for n in header)])) for t in sorted(rows)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join([",".join(["t", *header]), *lines]))
    found = load_map("windwrench")
    log = (
        read_log(path)
        if own
        else map_table(open_table(path), replace(found, name="m", rows="mixed"))
    )
    assert_allclose(np.diff(log.t), 0.01)
    assert log.valid.all()
    assert len(log.t) >= 195


def test_rows_of_one_time_are_one_row(tmp_path):
    t = [f"{0.01 * (k // 2):.2f}" for k in range(80)]
    found = mapped(table(tmp_path / "a.csv", {"t": t, **apart(1)}, 80))
    assert len(found.t) == 40
    assert found.valid.all()
    assert noted(found, "joined")


def test_a_time_that_goes_back_costs_its_row_and_many_are_refused(tmp_path):
    t = [f"{0.01 * k:.2f}" for k in range(40)]
    t[7] = "0.01"
    log = mapped(table(tmp_path / "a.csv", {"t": t}))
    assert len(log.t) == 39
    assert noted(log, "1 of 40 samples repeat a time or have one")
    t[1::3], t[2::3] = t[2::3], t[1::3]
    words = r"column t, row 3 \(line 4\): 0.01 s goes back from 0.02 s"
    with refused(words):
        mapped(table(tmp_path / "a.csv", {"t": t}))


COMMANDED = {
    **{k: v for k, v in GOOD.items() if k != "rotors"},
    "commands": {"columns": ["m1", "m2", "m3", "m4"], "unit": "us", "order": "px4-x"},
}


@pytest.mark.parametrize(("tilt", "needed"), [(0.0, 1.0), (pi / 3, 2.0)])
def test_commands_without_a_curve_say_what_is_assumed(tmp_path, tilt, needed):
    """At 1600 us each rotor carries a quarter of the weight, which is an assumption; at a tilt of
    60 degrees twice the weight flies level.
    """
    vehicle = load_vehicle("crazyflie")
    turn = {"qx": np.sin(tilt / 2), "qw": np.cos(tilt / 2)}
    path = table(tmp_path / "a.csv", {**turn, **dict.fromkeys(("m1", "m2", "m3", "m4"), 1600)})
    (tmp_path / "map.yaml").write_text(yaml.safe_dump(COMMANDED))
    log = read_log(path, vehicle=vehicle, map=tmp_path / "map.yaml")
    assert log.commanded
    assert_allclose(log.rotor_speeds, np.sqrt(needed) * vehicle.hover_rate)
    assert noted(log, "cannot be found from this log")


def test_commands_of_another_range_are_refused(tmp_path):
    with refused("expected motor commands from 1000 to 2000: state the"):
        mapped(table(tmp_path / "a.csv", {}), COMMANDED)


def test_rows_whose_times_were_rounded_are_even(tmp_path):
    """A value in every row has a time of its own."""
    path = table(tmp_path / "a.csv", {"t": [f"{0.005 * k:.2f}" for k in range(40)]})
    log = mapped(path)
    assert len(log.t) == 40
    assert_allclose(log.t, 0.005 * np.arange(40), atol=2e-3)
    assert noted(log, "the rows were taken as even in time")


def test_rows_written_twice_are_rows_once(tmp_path):
    """Two equal rows at one time are no two samples at rounded times."""
    twice = np.arange(40) // 2
    columns = {"t": 0.01 * twice, "x": np.sin(twice), "m1": 3600.0 + twice}
    changes = {name: [f"{x:.6f}" for x in column] for name, column in columns.items()}
    log = mapped(table(tmp_path / "a.csv", changes))
    assert_allclose(log.t, 0.01 * np.arange(20))
    assert noted(log, "20 row(s) repeat a time and were joined to the one row")


def test_columns_named_as_motors_are_said_where_they_are_left_out(tmp_path):
    more = {f"esc_{i}_rpm": 3600.0 for i in range(1, 5)} | dict.fromkeys(
        ("x1", "x2", "x3", "x4"), 1
    )
    log = mapped(table(tmp_path / "a.csv", more))
    assert noted(log, "columns named as motors' were left out: esc_1_rpm ...")
    assert not noted(mapped(table(tmp_path / "b.csv", {})), "left out")
