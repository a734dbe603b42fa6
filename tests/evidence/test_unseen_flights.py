"""The study of vehicles on flights that they have not seen."""

import numpy as np

from tests.support.data_paths import data_file
from windwrench.dynamics import load_vehicle
from windwrench.evidence.nanodrone_benchmark import WAYS
from windwrench.evidence.unseen_flights import groups_of, lost, page_rows, predicted, repeats
from windwrench.identification.logs.reading import read_log

NONE = [1.0, 2.0, 3.0, 4.0]


def row(group, errors, k):
    by_way = dict(zip(WAYS, (errors, [2.0, 2.0, 9.0, 9.0], NONE), strict=True))
    return {"of": "one flight", "group": [group], "errors": {"other": by_way}, "k": k}


def test_groups_are_neighbours_and_halves():
    assert groups_of("abc", 1) == [("one flight", x) for x in "abc"]
    assert [some for _, some in groups_of("abcde", 2)] == ["ab", "cd", "ace", "bd"]


def test_cells_are_ratios_to_the_better_simple_guess():
    """Of four errors 1.02, 4, 3 and 2 beside 1, 2, 3 and 4, one is lost."""
    rows = [row("a", [1.02, 4.0, 3.0, 2.0], [1.0, 0.9, 1.1])]
    assert lost({"set": rows}) == "1 of 4 (5–70 %)"
    ((_, said, _),) = page_rows({"set": rows})
    assert said == "3 of 4 (30–95 %); worst 2.00: velocity of other from a"


def test_intervals_of_repeats_are_compared_without_common_flights():
    rows = [row("a", NONE, [1.0, 0.9, 1.1]), row("b", NONE, [1.15, 1.05, 1.3])]
    rows += [row("c", NONE, [2.0, 1.9, 2.1]), row("a", NONE, [9.0, 8.0, 10.0])]
    assert repeats(rows[:3]) == (1, 3, 2.0)
    assert repeats([rows[0], rows[3]]) == (0, 0, 1.0)


def test_a_right_vehicle_is_nearer_than_no_change():
    log = read_log(data_file("hard_logs/healthy_pose_50hz_rows_200hz.csv.gz"))
    errors = predicted(log, load_vehicle("ardrone2"))
    vehicle, force, none = (np.array(errors[way]) for way in WAYS)
    assert (vehicle < 0.5 * none).all()
    assert force[0] < none[0]
