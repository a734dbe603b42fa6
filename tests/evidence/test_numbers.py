"""Every page that is made of kept results says what they say; figures in prose are those of
results, and probabilities those of kept flights.
"""

import json

import pytest

from tests.support.paths import ROOT
from windwrench.evidence import pages as rendering
from windwrench.evidence import quotes as quoting
from windwrench.evidence.kept_results import kept
from windwrench.evidence.pages import missing_sources
from windwrench.evidence.probabilities.__main__ import plan
from windwrench.evidence.probabilities.calibration import RESULTS, flights_of
from windwrench.evidence.probabilities.fitting import fit
from windwrench.evidence.probabilities.flights import WAYS_TO_LOG
from windwrench.identification.diagnosis.settings import DIAGNOSIS
from windwrench.identification.diagnosis.unknown import ABSORBED, PUSH

QUOTES, NOT_RESULTS = quoting.read_quotes()


@pytest.mark.parametrize("name", rendering.PAGES)
def test_a_page_holds_what_its_results_say(name):
    assert rendering.differing_lines(name) == []


def test_a_number_that_is_changed_on_a_page_is_seen(tmp_path, monkeypatch):
    text = (rendering.DOCS / "tasks.md").read_text(encoding="utf-8")
    row = next(line for line in text.splitlines() if line.startswith("|") and "0." in line)
    changed = row.replace("0.", "1.", 1)
    (tmp_path / "tasks.md").write_text(text.replace(row, changed, 1), encoding="utf-8")
    monkeypatch.setattr(rendering, "DOCS", tmp_path)
    assert rendering.differing_lines("tasks") == [f"-{row}", f"+{changed}"]


def test_figures_in_prose_are_those_of_their_results():
    assert quoting.wrong_quotes(QUOTES) == []
    assert QUOTES


@pytest.mark.parametrize("page", NOT_RESULTS)
def test_every_number_in_prose_has_a_source(page):
    assert quoting.unknown_numbers(page, QUOTES, NOT_RESULTS[page]) == []


def test_an_exception_that_is_not_needed_goes():
    for page, passages in NOT_RESULTS.items():
        text = quoting.prose((ROOT / page).read_text(encoding="utf-8"))
        assert [passage for passage in passages if passage not in text] == []


def test_a_figure_without_a_source_and_a_wrong_one_are_seen():
    page = QUOTES[0].page
    said = QUOTES[0].says
    text = (ROOT / page).read_text(encoding="utf-8") + "\nIt is 17 % better.\n"
    found = quoting.unknown_numbers(page, QUOTES, NOT_RESULTS[page], text)
    assert len(found) == 1
    assert "It is 17 % better." in found[0]
    wrong = quoting.Quote(page, said + " of 1000", ())
    assert quoting.wrong_quotes([wrong]) == [f"{page}: expected {wrong.says!r}"]


def test_a_quote_of_a_row_that_is_not_there_is_refused(tmp_path):
    value = {
        "from": "docs/results/tasks/felt_wrench.json",
        "where_in": "rows",
        "where": {"kind": "none"},
        "key": "x",
    }
    listed = {"quotes": {"README.md": [{"says": "{}", "values": [value]}]}, "not results": {}}
    path = tmp_path / "quotes.yaml"
    path.write_text(json.dumps(listed), encoding="utf-8")
    with pytest.raises(LookupError, match="0 rows with"):
        quoting.read_quotes(path)


def test_modules_that_pages_name_are_there():
    assert missing_sources() == []


def test_what_is_gone_is_seen(tmp_path, monkeypatch):
    text = "".join(
        f"`python -m evidence.{name}`, `evidence/{name}.py`" for name in ("pages", "gone")
    )
    (tmp_path / "page.md").write_text(text, encoding="utf-8")
    monkeypatch.setattr(rendering, "DOCS", tmp_path)
    assert missing_sources() == ["page.md names evidence.gone", "page.md names evidence/gone.py"]


def test_the_rule_of_a_sure_name_is_that_of_the_code():
    text = (rendering.DOCS / "diagnosis.md").read_text(encoding="utf-8")
    rule = " ".join(text.split()).replace(" %", "%")
    assert f"its printed probability is {DIAGNOSIS.least_sure_probability:.0%} or more" in rule
    assert f"has a probability of {DIAGNOSIS.most_unknown:.0%} at most" in rule
    assert f"the flight has {DIAGNOSIS.least_seconds:g} s" in rule
    assert f"in the mean {ABSORBED / (ABSORBED + 1.0):.0%}" in rule


def test_a_sure_name_is_printed_with_what_the_page_says_and_without_a_ceiling():
    flights = flights_of(kept(RESULTS)["flights"])
    named = [e for flight in flights for e in flight["named"]]
    sure = [e["probability"] for e in named if not e["tentative"]]
    assert min(sure) >= DIAGNOSIS.least_sure_probability
    assert max(sure) > 0.999


def test_the_weight_of_a_push_is_that_of_the_kept_flights():
    _, push = fit(flights_of(kept("results/unknown_weights.json.gz")))
    assert push == pytest.approx(PUSH, abs=0.02)


def test_a_run_has_flights_of_both_simulators_and_all_logs_and_none_twice():
    tasks = plan(20, "other.py")
    assert len(set(tasks)) == len(tasks) == 65
    assert {t[1] for t in tasks if t[0] == "own"} >= {"single", "pair", "nothing", "left out"}
    assert {t[1] for t in tasks if t[0] == "other.py"} == {"catalogue", "left out"}
    assert {t[3] for t in tasks if len(t) == 4} == set(WAYS_TO_LOG[1:])
