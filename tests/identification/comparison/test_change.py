"""What changed between two sets of flights: drawn trims, simulated flights and measured ones."""

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.linalg import solve
from numpy.random import default_rng
from typer.testing import CliRunner

from tests.support.data_paths import excerpt
from tests.support.flown import VEHICLE, recorded
from tests.support.sizes import rms
from windwrench.cli import app
from windwrench.identification.comparison.change import NOWHERE, SOMETHING_ELSE, compare
from windwrench.identification.comparison.sessions import FLIGHT_STD, SESSION_STD, difference
from windwrench.identification.comparison.trim import Trim, trim_of_log
from windwrench.identification.comparison.words import change_headline, write_change

ROTORS = (
    "rotor 1 (front-left)",
    "rotor 2 (rear-left)",
    "rotor 3 (rear-right)",
    "rotor 4 (front-right)",
)
# left - right, front - rear, diagonals, total of thrusts
MIX = np.array([[1, 1, -1, -1], [1, -1, -1, 1], [1, -1, 1, -1], [1, 1, 1, 1]]) / 1.0


def drawn(rng, count, moved=(0.0, 0.0, 0.0, 0.0), sessions=1):
    """Flights of one vehicle, ``count`` in each session, which scatter as the settings say, with
    the four numbers moved.
    """
    out = []
    for session in range(sessions):
        middle = np.array([0.02, -0.03, 0.05, 0.0]) + moved
        middle += np.array(SESSION_STD) * rng.standard_normal(4)
        for i in range(count):
            numbers = middle + np.array(FLIGHT_STD) * rng.standard_normal(4)
            thrust = solve(MIX, np.append(numbers[:3], 1.0)) * np.exp(numbers[3])
            total = thrust.sum()
            out.append(Trim(f"{session}, {i}", 20.0, thrust / total, total, np.zeros(4)))
    return out


def test_flights_without_a_change_are_never_given_a_sure_one():
    """Of 60 pairs of sets at most one, and most are said to be unchanged."""
    rng = default_rng(1)
    found = [compare(drawn(rng, 1), drawn(rng, 2)) for _ in range(60)]
    assert sum(c.sure and c.place != NOWHERE for c in found) <= 1
    assert sum(c.place == NOWHERE for c in found) > 55
    assert all(sum(c.probabilities.values()) == pytest.approx(1.0) for c in found)


def stated(found):
    """Return a difference's four numbers and their deviations, over its hypotheses."""
    mean, variance, log = found
    return np.exp(log) @ mean, np.sqrt(np.exp(log) @ variance)


def test_more_sessions_make_an_answer_surer_and_more_flights_of_one_do_not():
    rng = default_rng(4)
    after = drawn(rng, 1, (0.06, -0.06, -0.06, 0.06))  # rotor 2 is asked for more
    one, more, apart = (
        stated(difference(after, drawn(rng, count, sessions=sessions)))[1]
        for count, sessions in ((1, 1), (6, 1), (1, 6))
    )
    assert (apart < 0.8 * one).all()
    assert (more > 0.8 * one).all()


def test_a_session_ends_where_the_battery_was_changed():
    """Flights with two batteries know their vehicle better than as many with one."""
    after, *flights = drawn(default_rng(5), 5)

    def std(volts):
        known = [replace(x, voltage=v) for x, v in zip(flights, volts, strict=True)]
        return stated(difference([after], known))[1]

    assert (std([12.4, 12.0, 12.4, 12.0]) < 0.95 * std([12.4, 12.2, 12.0, 11.8])).all()


def test_a_named_session_is_one_and_what_it_is_off_by_cancels():
    """Of 60 pairs each: the spread of the difference is what its deviation says."""
    rng = default_rng(8)
    for day in ("mon", "tue"):
        scores = []
        for _ in range(60):
            *before, first, second = drawn(rng, 5)
            if day == "tue":
                first, second = drawn(rng, 2)
            before = [replace(trim, session="mon") for trim in before]
            mean, size = stated(
                difference([replace(x, session=day) for x in (first, second)], before)
            )
            scores.append(mean / size)
            assert (size < 2.5 * np.array(FLIGHT_STD)).all() == (day == "mon")
        assert 0.8 < rms(scores) < 1.2


@pytest.mark.parametrize(
    ("place", "moved"),
    [
        ("left", (0.1, 0.0, 0.0, 0.1)),
        ("all rotors", (0.0, 0.0, 0.0, 0.15)),
        # two rotors that are weaker, of which neither shares a side with the other
        (SOMETHING_ELSE, (0.0, 0.0, 0.25, -0.25)),
    ],
)
def test_what_is_no_rotors_change_is_told_from_one(place, moved):
    rng = default_rng(3)
    found = [compare(drawn(rng, 3, moved), drawn(rng, 3)) for _ in range(12)]
    assert np.mean([c.place == place for c in found]) > 0.9
    assert ("otherwise than" in change_headline(found[0])) == (place == SOMETHING_ELSE)


@pytest.mark.parametrize("rotor", range(4))
def test_a_weak_rotor_and_a_weight_are_named_at_their_place(rotor):
    rng = default_rng(2)
    left, front = MIX[:2, rotor]
    weak = 0.08 * MIX[:, rotor]
    weight = 0.1 * np.array([left, front, 0, 1])
    places = [compare(drawn(rng, 3, x), drawn(rng, 3)) for x in [weak] * 3 + [weight] * 3]
    assert np.mean([c.place == ROTORS[rotor] for c in places]) > 0.8
    assert not any(c.sure and c.place != ROTORS[rotor] for c in places)


@pytest.fixture(scope="module")
def before():
    return [trim_of_log(recorded("gentle", 12.0, s), VEHICLE) for s in (1, 2, 3)]


@pytest.mark.parametrize(
    ("effects", "place"),
    [
        ({"rotor_efficiency": {"e3": -0.12}}, ROTORS[2]),
        # a tenth of the weight, at the left
        ({"mass": {"dm": 0.0429}, "com_offset": {"cy": 0.0115}}, "left"),
    ],
)
def test_simulated_changes_are_named_without_a_true_model(before, effects, place, tmp_path):
    after = [trim_of_log(recorded("gentle", 12.0, s, **effects), VEHICLE) for s in (4, 5, 6)]
    change = compare(after, before)
    assert change.place == place
    data, picture = write_change(change, tmp_path)
    said = json.loads(data.read_bytes())
    assert said["headline"] == change_headline(change)
    assert place in said["headline"]
    assert picture.stat().st_size > 500
    assert compare(before, before).place == NOWHERE


def test_another_battery_voltage_makes_the_total_less_certain():
    rng = default_rng(7)
    after = drawn(rng, 3, (0.0, 0.0, 0.0, 0.13))
    before = drawn(rng, 3)
    assert compare(after, before).probabilities["all rotors"] > 0.8
    low = [replace(trim, voltage=10.5) for trim in after]
    high = [replace(trim, voltage=12.0) for trim in before]
    assert compare(low, high).probabilities["all rotors"] < 0.7


@pytest.mark.measured
def test_measured_flights_of_two_folders_are_two_sessions(tmp_path):
    """By links to two shipped pieces; ``test_demo.py`` compares them with one that carries more."""
    paths = []
    for day, log in zip(("mon", "tue"), sorted(excerpt("crazypad").glob("normal*")), strict=True):
        (tmp_path / day).mkdir()
        paths.append(tmp_path / day / "log.csv.gz")
        paths[-1].symlink_to(log)
    words = ["compare", "--reader", "crazypad", "--out", tmp_path, "--by-folder", paths[0]]
    result = CliRunner().invoke(app, [*map(str, words), "--against", str(paths[1])])
    assert result.exit_code == 0, result.output
    said = "".join(result.output.splitlines())
    assert f"session {tmp_path}/tue: 0 after, 1 before" in said
    assert json.loads((tmp_path / "change.json").read_bytes())["place"] == NOWHERE
