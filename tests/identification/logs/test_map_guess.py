"""Maps that are guessed: right, or marked as a guess, never silently wrong."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from tests.support.random_tables import fields_of, flight, random_table, save
from windwrench.dynamics import load_vehicle
from windwrench.identification.logs.column_names import Group
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.logs.log_map import parse_map
from windwrench.identification.logs.map_guess import Guess, guess_map, map_yaml, motor_unit
from windwrench.identification.logs.tables import open_table
from windwrench.runtime.errors import InputError


@pytest.fixture(scope="module")
def flown() -> FlightLog:
    """A lively flight."""
    return flight("ardrone2", "excite", 1, 15.0)


def guessed(path: Path, name: str = "") -> Guess:
    table = open_table(path)
    return guess_map(table, load_vehicle(name) if name else None)


def test_the_map_that_is_written_is_the_map_that_was_guessed(
    tmp_path: Path, flown: FlightLog
) -> None:
    for seed in range(4):
        written = random_table(flown, np.random.default_rng(seed))
        found = guessed(save(written, tmp_path / "table.csv"))
        text = map_yaml(found)
        again = parse_map(yaml.safe_load(text), "map")
        assert fields_of(again) == fields_of(found.log_map)
        assert text.count("# GUESS") == len(found.doubts)


def test_pose_and_motors_in_rows_of_their_own_are_read(tmp_path: Path, flown: FlightLog) -> None:
    """A logger that writes each message in a row leaves the other columns empty."""
    rows = ["t,x,y,z,qw,qx,qy,qz,rpm1,rpm2,rpm3,rpm4"]
    for k, t in enumerate(flown.t):
        pose = [*flown.position[k], *flown.quaternion[k]] if k % 2 else [""] * 7
        speeds = [""] * 4 if k % 2 else flown.rotor_speeds[k] * 30.0 / np.pi
        rows.append(",".join(map(str, [t, *pose, *speeds])))
    path = tmp_path / "sparse.csv"
    path.write_text("\n".join(rows))
    assert not guessed(path).doubts


def test_a_table_without_a_time_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("a,b\n0,1\n0,2\n0,2\n")
    with pytest.raises(InputError, match="no column looks like a time"):
        guessed(path)


@pytest.mark.parametrize(
    ("name", "highest", "expected"),
    [("duty", 80.0, ("commands", "percent")), ("m", 80.0, None), ("m", 120.0, ("rotors", "Hz"))],
)
def test_percents_are_not_silently_taken_for_turns_a_second(
    name: str, highest: float, expected: tuple[str, str] | None
) -> None:
    """Numbers below 100 that would carry the weight in Hz may be percents all the same."""
    vehicle = load_vehicle("ardrone2")
    hover = np.sqrt(vehicle.weight / vehicle.k.sum()) / (2.0 * np.pi)
    values = np.full((100, 4), hover)
    values[0] = highest
    group = Group(tuple(f"{name}{i}" for i in range(1, 5)), name, numbered=True)
    kind, unit, sure, why = motor_unit(group, values, vehicle)
    if expected is None:
        assert not sure
        assert "percents" in why
    else:
        assert (kind, unit) == expected
