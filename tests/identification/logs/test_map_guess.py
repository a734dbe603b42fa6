"""Maps that are guessed: right, or marked as a guess, never silently wrong."""

from dataclasses import replace
from math import nan, pi

import numpy as np
import pytest
import yaml
from numpy.random import default_rng
from numpy.testing import assert_allclose

from tests.support.outcomes import noted
from tests.support.random_tables import fields_of, flight, random_table, save
from windwrench.dynamics import load_vehicle
from windwrench.identification.logs import map_guess
from windwrench.identification.logs import table as table_module
from windwrench.identification.logs.column_names import Group
from windwrench.identification.logs.log_map import parse_map
from windwrench.identification.logs.magnitudes import motor_unit
from windwrench.identification.logs.map_guess import guess_map
from windwrench.identification.logs.map_text import map_yaml
from windwrench.identification.logs.mapped_log import map_table
from windwrench.identification.logs.reading import read_log
from windwrench.identification.logs.text_table import open_table


@pytest.fixture(scope="module")
def flown():
    """A lively flight."""
    return flight("ardrone2", "excite", 1, 10.0)


def guessed(path, name=""):
    return guess_map(open_table(path), load_vehicle(name) if name else None)


def test_the_map_that_is_written_is_the_map_that_was_guessed(tmp_path, flown):
    for seed in range(2):
        written = random_table(flown, default_rng(seed))
        found = guessed(save(written, tmp_path / "table.csv"))
        text = map_yaml(found)
        again = parse_map(yaml.safe_load(text), "map")
        assert fields_of(again) == fields_of(found.log_map)
        assert text.count("# GUESS") == len(found.doubts)


def test_pose_and_motors_in_rows_of_their_own_are_read(tmp_path, flown):
    """A logger that writes each message in a row leaves the other columns empty."""
    rows = ["t,x,y,z,qw,qx,qy,qz,rpm1,rpm2,rpm3,rpm4"]
    for k, t in enumerate(flown.t):
        pose = [*flown.position[k], *flown.quaternion[k]] if k % 2 else [""] * 7
        speeds = [""] * 4 if k % 2 else flown.rotor_speeds[k] * 30.0 / pi
        rows.append(",".join(map(str, [t, *pose, *speeds])))
    path = tmp_path / "sparse.csv"
    path.write_text("\n".join(rows))
    assert not guessed(path).doubts


def columns_of(log, names, is_ned=False):
    """Return a flight's columns under names of time, position, quaternion, velocity, accelerometer,
    gyro and rotors (rad/s), in this order; a name such as ``c%`` is that of all, by their numbers.
    """
    down = np.array([1.0, -1.0, -1.0]) if is_ned else np.ones(3)
    turned = log.quaternion * (np.array([1.0, 1.0, -1.0, -1.0]) if is_ned else 1.0)
    velocity = np.gradient(log.position, log.t, axis=0)
    parts = [log.t[:, None], log.position * down, turned, velocity * down]
    parts += [log.accelerometer * down, log.gyro * down, log.rotor_speeds]
    values = np.hstack(parts)
    listed = names.split() if "%" not in names else [names.replace("%", str(i)) for i in range(21)]
    return dict(zip(listed, values.T, strict=True))


def table_of(columns, path):
    """Write columns as CSV."""
    rows = np.column_stack(list(columns.values()))
    np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    return path


_QUATERNION = "qw qx qy qz"
_SENSORS = "vx vy vz ax ay az gx gy gz"
NAMES = f"t x y z {_QUATERNION} {_SENSORS} "  # and four motors behind
_PX4 = "/fmu/out/"
_VICON = "/vicon/drone/transform/"


def each(stem, ends):
    """Return the names of columns that differ in their last letter."""
    return " ".join(stem + end for end in ends)


@pytest.mark.parametrize(
    "names",
    [
        f"t n e d {_QUATERNION} {_SENSORS} w1 w2 w3 w4",
        f"t x_ned y_ned z_ned {_QUATERNION} {_SENSORS} motor_0 motor_1 motor_2 motor_3",
        f"t px py pz {_QUATERNION} vx vy vz ax ay az angular_velocities_0 angular_velocities_1 "
        "angular_velocities_2 w1 w2 w3 w4",
        f"__time {each(_VICON + 'translation/', 'xyz')} {each(_VICON + 'rotation/', 'wxyz')} "
        f"{_SENSORS} {each('/motors/angular_velocities_', '0123')}",
        f"__time {each(_PX4 + 'vehicle_odometry/position.0', '012')} "
        f"{each(_PX4 + 'vehicle_odometry/q.0', '0123')} "
        f"{each(_PX4 + 'vehicle_odometry/velocity.0', '012')} "
        f"{each(_PX4 + 'sensor_combined/accelerometer_m_s2.0', '012')} "
        f"{each(_PX4 + 'sensor_combined/gyro_rad.0', '012')} "
        f"{each(_PX4 + 'esc_status/rotor_speed.0', '0123')}",
        "time_s uav_x_place uav_y_place uav_z_place uav_w_turn uav_x_turn uav_y_turn uav_z_turn "
        f"{_SENSORS} rotor1_rate rotor2_rate rotor3_rate rotor4_rate",
        "c%",  # names that say nothing: the numbers do
    ],
)
def test_parts_are_found_by_what_their_numbers_obey(tmp_path, flown, names):
    columns = columns_of(flown, names, is_ned=True)
    listed = list(columns)
    found = guessed(table_of(columns, tmp_path / "a.csv"), "ardrone2")
    log_map = found.log_map
    assert not found.missing
    assert (log_map.world, log_map.body) == ("ned", "frd")
    parts = {"position": 1, "attitude": 4, "accelerometer": 11, "gyro": 14, "rotors": 17}
    for name, first in parts.items():
        part = log_map.sections[name]
        assert list(part.columns) == listed[first : first + len(part.columns)]
    assert log_map.rotors.unit == "rad/s"


@pytest.mark.parametrize(
    ("dropped", "field"),
    [("t", "time.column"), ("qw", "attitude.columns"), ("w1", "rotors.columns")],
)
def test_what_is_missing_is_left_open_beside_what_is_known(tmp_path, flown, dropped, field):
    columns = columns_of(flown, NAMES + "w1 w2 w3 w4")
    for name in [name for name in columns if name.startswith(("a", "g", "v"))]:
        del columns[name]
    if dropped == "t":
        del columns[dropped]
    else:  # without a number in it
        columns[dropped] = np.full(len(flown.t), nan)
    found = guessed(table_of(columns, tmp_path / "a.csv"))
    assert [f"{m.section}.{m.field}" for m in found.missing] == [field]
    written = yaml.safe_load(map_yaml(found))
    assert "?" in str(written[field.split(".")[0]])
    assert f"# choose {field}: " in map_yaml(found)
    assert written["position"]["columns"] == ["x", "y", "z"]


def test_of_a_huge_table_columns_are_read_whose_names_say_something(tmp_path, flown, monkeypatch):
    columns = columns_of(flown, NAMES + "rpm1 rpm2 rpm3 rpm4")
    columns |= {f"blob{name}": columns["vx"] for name in "abcdefgh"}
    path = table_of(columns, tmp_path / "a.csv")
    most = 25 * len(flown.t)
    for module in (map_guess, table_module):
        monkeypatch.setattr(module, "LIMITS", replace(module.LIMITS, table_numbers=most))
    assert not guessed(path).missing


@pytest.mark.parametrize("way", ["date", "time of day", "seconds and nanoseconds"])
def test_clocks_as_people_write_them(tmp_path, flown, way):
    columns = columns_of(flown, NAMES + "rpm1 rpm2 rpm3 rpm4")
    t = columns.pop("t")
    stamps = np.datetime64("2024-02-29T23:10:00", "us") + np.round(1e6 * t).astype("m8[us]")
    clock = {"time": [str(x).replace("T", " ") for x in stamps]}
    if way == "time of day":
        clock = {"time": [str(x).partition("T")[2] for x in stamps]}
    if way == "seconds and nanoseconds":
        whole = stamps.astype("M8[s]")
        clock = {"header.stamp.sec": [str(x) for x in whole.astype(np.int64)]}
        clock["header.stamp.nanosec"] = [f"{1000 * x}" for x in (stamps - whole).astype(np.int64)]
    rows = [",".join([*clock, *columns])]
    values = zip(*clock.values(), np.column_stack(list(columns.values())).tolist(), strict=True)
    rows += [",".join([*map(str, first), *map(repr, rest)]) for *first, rest in values]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(rows))
    found = guessed(path)
    assert not found.missing
    log = map_table(open_table(path), parse_map(yaml.safe_load(map_yaml(found)), "map"))
    assert_allclose(log.t, flown.t - flown.t[0], atol=2e-6)


def test_what_a_pilot_or_a_controller_wants_is_no_part(tmp_path, flown):
    """As RotorPy and the racing dataset of TII write them; rotors may be called r1 to r4."""
    columns = columns_of(flown, NAMES + "r1 r2 r3 r4")
    for name in ("ax", "ay", "az", "gx", "gy", "gz"):
        del columns[name]
    columns |= {f"{name}des": columns[name] for name in ("x", "qw", "qx", "qy", "qz", "r1")}
    columns |= {f"channels_{name}": 1500.0 + flown.t for name in ("roll", "pitch", "yaw")}
    found = guessed(table_of(columns | {"battery_percent": 80.0 - flown.t}, tmp_path / "a.csv"))
    assert found.log_map.attitude.columns == ("qw", "qx", "qy", "qz")
    assert found.log_map.accelerometer is None
    assert found.log_map.battery is None
    assert found.log_map.rotors.columns == ("r1", "r2", "r3", "r4")


def test_motion_capture_with_y_up(tmp_path, flown):
    """As OptiTrack writes poses: y up in the world and in the body, millimetres, w last. A table
    whose guess leaves no doubt is read at once.
    """
    x, y, z = 1e3 * flown.position.T
    w, qx, qy, qz = flown.quaternion.T
    columns = {"Frame": np.arange(len(flown.t)), "Time (Seconds)": flown.t}
    columns |= {"UAV Rotation X": qx, "UAV Rotation Y": qz, "UAV Rotation Z": -qy}
    columns |= {"UAV Rotation W": w, "UAV Position X": x}
    columns |= {"UAV Position Y": z, "UAV Position Z": -y}
    columns |= {f"w{i}": speed for i, speed in enumerate(flown.rotor_speeds.T, 1)}
    path = table_of(columns, tmp_path / "a.csv")
    found = guessed(path, "ardrone2")
    assert not found.doubts
    assert (found.log_map.world, found.log_map.body) == ("y_up", "y_up")
    log = read_log(path, vehicle=load_vehicle("ardrone2"))
    assert noted(log, "guessed without a doubt")
    assert_allclose(log.rotor_speeds, flown.rotor_speeds, atol=1e-6)
    assert_allclose(log.position, flown.position, atol=1e-9)
    alike = abs(np.sum(log.quaternion * flown.quaternion, axis=1))
    assert_allclose(alike, 1.0, atol=1e-9)


def test_more_than_four_rotors_that_move_are_no_guess_and_a_maps_doubt(tmp_path, flown):
    columns = columns_of(flown, NAMES + "w1 w2 w3 w4")
    rng = default_rng(0)
    good = guessed(table_of(columns, tmp_path / "quad.csv")).log_map
    columns |= {"w5": columns["w1"] + rng.standard_normal(len(flown.t)), "w6": columns["w2"]}
    path = table_of(columns, tmp_path / "hexa.csv")
    expected = "6 rotors turn (w1, w2, w3, w4, w5, w6); expected the four of a quadrotor"
    assert expected in guessed(path).lacks
    # a map is a person's word
    assert (
        f"warning: {expected}. The map's four were taken" in map_table(open_table(path), good).notes
    )
    servo = 450.0 + 50.0 * np.sin(0.7 * flown.t)  # of a gimbal, on an output beside
    idle = {"w5": servo, "w6": 0.0 * servo}
    assert not guessed(table_of(columns | idle, tmp_path / "servo.csv")).missing
    columns |= {"w5": 0.0 * flown.t, "w6": 0.0 * flown.t}  # of an autopilot that has outputs left
    assert not guessed(table_of(columns, tmp_path / "idle.csv")).missing


def test_units_are_told_by_physics_not_by_names(tmp_path, flown):
    """Speeds lift with their square, pulses stand on an offset, and no name is believed that the
    numbers contradict.
    """
    columns = columns_of(flown, NAMES + "m1 m2 m3 m4")
    speeds = {name: columns.pop(name) for name in ("m1", "m2", "m3", "m4")}
    most = max(float(x.max()) for x in speeds.values())

    def unit_of(names, scale, offset=0.0, vehicle=""):
        values = [offset + scale * x for x in speeds.values()]
        made = columns | {names.replace("%", str(i + 1)): x for i, x in enumerate(values)}
        found = guessed(table_of(made, tmp_path / "a.csv"), vehicle)
        part = found.log_map.rotors or found.log_map.commands
        sure = all(r.field != "unit" or r.section == "gyro" for r in found.doubts)
        return f"{part.unit}{'' if sure else '?'}"

    assert unit_of("m%", 800.0 / most, 1000.0) == "us"
    assert unit_of("m%", 1900.0 / most) == "rad/s?"  # of the size of pulses, but no offset
    assert unit_of("pwm_%", np.round(255.0) / most) == "counts?"
    assert unit_of("rpm%", 1.0, vehicle="ardrone2") == "rad/s?"
    for name in "xyz":
        columns[f"a{name} [m/s2]"] = columns.pop(f"a{name}") / 9.80665
        columns[f"{name} [mm]"] = columns.pop(name)
    found = guessed(table_of(columns | speeds, tmp_path / "g.csv"))
    assert found.log_map.accelerometer.unit == "g"
    assert found.log_map.position.unit == "m"
    for unit in ("m/s2", "mm"):
        assert any(f"though the columns' names say {unit}" in r.why for r in found.doubts)


@pytest.mark.parametrize(
    ("name", "highest", "expected"),
    [("duty", 80.0, ("commands", "percent")), ("m", 80.0, None), ("m", 120.0, ("rotors", "Hz"))],
)
def test_percents_are_not_silently_taken_for_turns_a_second(name, highest, expected):
    """Numbers below 100 that would carry the weight in Hz may be percents all the same."""
    vehicle = load_vehicle("ardrone2")
    hover = np.sqrt(vehicle.weight / vehicle.k.sum()) / (2.0 * pi)
    values = np.full((100, 4), hover)
    values[0] = highest
    group = Group(tuple(f"{name}{i}" for i in range(1, 5)), name)
    kind, unit, sure, why = motor_unit(group, values, vehicle)
    if expected is None:
        assert not sure
        assert "percents" in why
    else:
        assert (kind, unit) == expected
