"""A fleet's files: strict numbers, a table, and a page that a real browser shows, sorts and
searches.
"""

import csv
import json
import re
from pathlib import Path

import pytest

from tests.support.alike import strict_json
from tests.support.browser import look, needs_browser
from tests.support.diagnoses import fleet_row
from windwrench.identification.fleet.drift import fleet_of
from windwrench.identification.fleet.files import fleet_data, write_fleet
from windwrench.identification.fleet.manifest import FleetLog
from windwrench.identification.fleet.outcomes import Outcomes
from windwrench.identification.fleet.page import change_in_words, changes, headline
from windwrench.identification.fleet.running import rows

HOSTILE = "<script>alert('x')</script>&\"=1+1"


def diagnosed(who, flight, *masses):
    row = fleet_row(who, flight, *masses)
    return row | {"log": f"{who}/flight{flight}.csv", "time": None}


FLIGHTS = [
    *(diagnosed("alpha", i, (0.01 * i + 0.001 * (i % 3), 0.002)) for i in range(1, 11)),
    *(diagnosed("beta", i) for i in range(1, 4)),
    diagnosed("beta", 4, (0.02, None, True, ["thrust_scale"])),
    {
        "id": HOSTILE,
        "flight": 1,
        "log": HOSTILE,
        "time": 3.0,
        "status": "refused",
        "kind": "died",
        "reason": f"{HOSTILE}: its process died",
    },
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet")
    written = write_fleet(fleet_of(FLIGHTS), FLIGHTS, folder, "windwrench diagnose")
    assert [path.name for path in written] == [
        "fleet.html",
        "fleet.json",
        "fleet.csv",
        "fleet.png",
    ]
    return folder


def test_the_first_sentence_says_what_changed():
    fleet = fleet_of(FLIGHTS)
    assert headline(fleet) == (
        "15 logs of 3 vehicles, 1 refused: effects changed from flight to flight on alpha."
    )
    (change,) = changes(fleet)
    assert re.fullmatch(
        r"alpha: dm of mass went from 0\.01\d* to 0\.1\d* kg over 10 flights, 0\.0[\d.]+ "
        r"\[0\.0[\d.]+, 0\.0[\d.]+\] a flight \(adjusted p = [\d.]+e−\d+\)\.",
        change_in_words(change),
    )
    calm = fleet_of(FLIGHTS[10:14])
    assert headline(calm).startswith("4 logs of 1 vehicle: no effect changed")
    assert headline(fleet_of(FLIGHTS[14:])).endswith("1 refused: none could be diagnosed.")


def test_the_numbers_are_strict_json(folder):
    data = strict_json(folder / "fleet.json")
    assert data["flights"] == FLIGHTS
    assert {key: data[key] for key in data if key != "flights"} == json.loads(
        json.dumps(fleet_data(fleet_of(FLIGHTS)))
    )
    alpha = next(one for one in data["trends"] if one["id"] == "alpha")
    assert (alpha["named_in"], alpha["sure_in"], alpha["among"]) == (10, 10, 10)
    assert alpha["drifts"]
    assert alpha["per_flight"] == pytest.approx(0.01, rel=0.1)


def test_the_table_has_a_line_a_coefficient_and_the_page_believes_no_name(folder):
    page = (folder / "fleet.html").read_text(encoding="utf-8")
    assert HOSTILE not in page
    assert page.count("<script") == 1
    assert not re.search(r"https?://|@import|url\(", page)
    with open(folder / "fleet.csv", newline="", encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    assert len(lines) == 15
    assert lines[0]["value"] == "0.011"
    assert lines[-1]["log"] == HOSTILE
    assert (lines[-1]["status"], lines[-1]["effect"]) == ("refused", "")
    assert lines[-2]["indistinguishable_from"] == "thrust_scale"


@needs_browser
@pytest.mark.parametrize(("width", "dark"), [(1200, False), (390, True)])
def test_a_browser_shows_the_page(folder, tmp_path, width, dark):
    page = (folder / "fleet.html").read_text(encoding="utf-8")
    found = look(page, width, tmp_path, dark)
    assert found["complaints"] == []
    assert found["scroll_width"] == found["width"]  # wide tables scroll by themselves
    assert (found["background"] == "rgb(20, 24, 30)") == dark
    assert "its process died" in found["text"]
    assert found["text"].count("drifts") == 1


CLICKS = Path(__file__).with_name("clicks.js").read_text(encoding="utf-8")


@needs_browser
def test_the_page_sorts_and_searches(folder, tmp_path):
    page = (folder / "fleet.html").read_text(encoding="utf-8")
    page = page.replace("</body>", f"<script>{{{CLICKS}}}</script></body>")
    found = look(page, 1200, tmp_path)
    told = re.search(r"told (\[.*\])", found["text"])[1]
    assert json.loads(told) == [
        ["1", "10"],
        [0, 1],
        ["1", "1", "2"],
        ["10", "9", "8"],
    ]


def test_flights_are_in_the_order_of_times_else_of_names(tmp_path):
    outcomes = Outcomes(tmp_path / "outcomes.jsonl")
    done = []
    for i, (name, who, time) in enumerate(
        [
            ("b10", "b", None),
            ("b9", "b", None),
            ("a1", "a", 5.0),
            ("a2", "a", 4.0),
            ("x", "", None),
        ]
    ):
        key = f"{i:032x}"
        outcomes.add(
            {"key": key, "status": "refused", "kind": "input", "reason": "?", "limit_s": 1}
        )
        done.append(FleetLog(name, name, "ardrone2", who, time=time, key=key))
    found = [(row["id"], row["flight"], row["log"]) for row in rows(done, outcomes)]
    assert found == [
        ("a", 1, "a2"),
        ("a", 2, "a1"),
        ("ardrone2", 1, "x"),
        ("b", 1, "b9"),
        ("b", 2, "b10"),
    ]
    assert "limit_s" not in rows(done, outcomes)[0]
