"""What changed between two sets of flights: drawn trims, simulated flights and measured ones."""

import csv
import gzip
import json

import numpy as np
import pytest

from tests.support.data_paths import DATA, SOURCES
from windwrench.dynamics import EffectSetting, InputError, load_vehicle
from windwrench.envs.recording import record_flight
from windwrench.identification.comparison.change import NOWHERE, ChangeSettings, compare, features
from windwrench.identification.comparison.trim import Trim, trim_of, trim_of_log
from windwrench.identification.comparison.words import headline, write_change
from windwrench.identification.logs.flight_log import FlightLog

ROTORS = (
    "rotor 1 (front-left)",
    "rotor 2 (rear-left)",
    "rotor 3 (rear-right)",
    "rotor 4 (front-right)",
)
# left - right, front - rear, diagonals, total of thrusts
MIX = np.array([[1, 1, -1, -1], [1, -1, -1, 1], [1, -1, 1, -1], [1, 1, 1, 1]]) / 1.0


def drawn(rng, count, moved=(0.0, 0.0, 0.0, 0.0), vehicle=(0.02, -0.03, 0.05, 0.0)):
    """Flights of one vehicle that scatter as the settings say, with the four numbers moved."""
    scatter = np.array(ChangeSettings().scatter)
    out = []
    for i in range(count):
        numbers = np.array(vehicle) + moved + scatter * rng.standard_normal(4)
        thrust = np.linalg.solve(MIX, np.append(numbers[:3], 1.0)) * np.exp(numbers[3])
        out.append(Trim(f"{i}", thrust, 20.0))
    return out


def test_the_four_numbers_of_drawn_flights_are_those_drawn():
    rng = np.random.default_rng(0)
    found = np.array([features(trim) for trim in drawn(rng, 2000)])
    np.testing.assert_allclose(found.mean(axis=0), [0.02, -0.03, 0.05, 0.0], atol=0.002)
    np.testing.assert_allclose(found.std(axis=0), ChangeSettings().scatter, rtol=0.06)


def test_flights_without_a_change_are_never_given_a_sure_one():
    """Of 300 pairs of sets at most one in a hundred, and most are said to be unchanged."""
    rng = np.random.default_rng(1)
    found = [compare(drawn(rng, 1), drawn(rng, 2)) for _ in range(300)]
    assert sum(c.sure and c.place != NOWHERE for c in found) <= 3
    assert sum(c.place == NOWHERE for c in found) > 280
    assert all(sum(c.places.values()) == pytest.approx(1.0) for c in found)


@pytest.mark.parametrize("rotor", range(4))
def test_a_weak_rotor_and_a_weight_are_named_at_their_place(rotor):
    rng = np.random.default_rng(2)
    left, front = ((1, 1), (1, -1), (-1, -1), (-1, 1))[rotor]
    weak = 0.08 * MIX[:, rotor] * [1, 1, 1, 0] + [0, 0, 0, 0.08]
    weight = 0.1 * np.array([left, front, 0, 1])
    places = []
    for moved in (weak, weight):
        for _ in range(15):
            places.append(compare(drawn(rng, 3, moved), drawn(rng, 3)))
    assert np.mean([c.place == ROTORS[rotor] for c in places]) > 0.9
    assert not any(c.sure and c.place != ROTORS[rotor] for c in places)


def test_a_side_and_the_whole_are_told_from_rotors():
    rng = np.random.default_rng(3)
    left = [compare(drawn(rng, 3, (0.1, 0.0, 0.0, 0.1)), drawn(rng, 3)) for _ in range(15)]
    assert np.mean([c.place == "left" for c in left]) > 0.9
    whole = [compare(drawn(rng, 3, (0.0, 0.0, 0.0, 0.15)), drawn(rng, 3)) for _ in range(15)]
    assert np.mean([c.place == "all rotors" for c in whole]) > 0.9


def flight(vehicle, *effects, seed=0):
    columns = record_flight(vehicle, effects, "gentle", 12.0, seed)
    return FlightLog(**columns, name=f"flight {seed}")


@pytest.mark.parametrize(
    ("effect", "place"),
    [
        (EffectSetting("rotor_efficiency", {"e3": -0.12}), ROTORS[2]),
        (EffectSetting("com_offset", {"cx": 0.0, "cy": 0.012, "cz": 0.0}), "left"),
    ],
)
def test_simulated_changes_are_named_without_a_true_model(effect, place, tmp_path):
    vehicle = load_vehicle("ardrone2")
    before = [trim_of_log(flight(vehicle, seed=s), vehicle) for s in (1, 2, 3)]
    after = [trim_of_log(flight(vehicle, effect, seed=s), vehicle) for s in (4, 5, 6)]
    change = compare(after, before)
    assert change.place == place
    data, picture = write_change(change, tmp_path)
    said = json.loads(data.read_text(encoding="utf-8"))
    assert said["headline"] == headline(change)
    assert place in said["headline"]
    assert picture.stat().st_size > 5000
    assert compare(before, before).place == NOWHERE


def test_flights_that_say_nothing_are_refused():
    vehicle = load_vehicle("ardrone2")
    t = 0.01 * np.arange(500)
    with pytest.raises(InputError, match="0 s of calm flight; expected at least 3 s"):
        trim_of("log.csv", t, np.ones((500, 4)), np.zeros(500, dtype=bool))
    with pytest.raises(InputError, match="expected four positive numbers"):
        trim_of("log.csv", t, np.zeros((500, 4)), np.ones(500, dtype=bool))
    with pytest.raises(InputError, match="at least one flight in each"):
        compare([], [Trim("a", np.ones(4), 5.0)])
    log = flight(vehicle, seed=1)
    still = FlightLog(log.t, log.position, log.quaternion, 0.0 * log.rotor_speeds, name="still")
    with pytest.raises(InputError, match="still: 0 s of calm flight"):
        trim_of_log(still, vehicle)


def crazypad(path):
    """The trim of a CrazyPAD flight; requests are linear in thrust, M4, M3, M2, M1 in our order."""
    with gzip.open(path, "rt", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    t, height, climb = (
        np.array([float(row[name]) for row in rows]) for name in ("t_s", "est_z_m", "est_vz_mps")
    )
    thrust = np.array([[float(row[f"motor_m{i}_0to65535"]) for i in (4, 3, 2, 1)] for row in rows])
    return trim_of(path.name, t, thrust, (height > 0.3) & (np.abs(climb) < 0.15))


@pytest.mark.measured
def test_measured_weights_and_cut_propellers():
    """CrazyPAD: each flight against the normal ones of the same vehicle."""
    folder = DATA / "crazypad"
    if not folder.is_dir():
        pytest.skip(f"needs {folder}: {SOURCES['crazypad']}")
    trims = {path.name: crazypad(path) for path in sorted(folder.glob("*.csv.gz"))}
    near = {"M1": ROTORS[3], "M2": ROTORS[2], "M3": ROTORS[1], "M4": ROTORS[0], "M3_M4": "left"}
    right, count = 0, 0
    for name, trim in trims.items():
        vehicle = "E8" if "E8" in name else "E9"
        normal = [
            other
            for key, other in trims.items()
            if "normal" in key and vehicle in key and key != name
        ]
        change = compare([trim], normal)
        if "normal" in name:
            assert change.place == NOWHERE, name
            continue
        what = name.split("__")[0].removesuffix("_3mm").split("near_")[-1]
        place = near[what.removeprefix("cut_propeller_")]
        likeliest = max((p for p in change.places if p != NOWHERE), key=change.places.__getitem__)
        right += likeliest == place
        count += 1
        assert not (change.sure and change.place != place), name
    assert right >= 0.8 * count
