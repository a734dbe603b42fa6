"""The speed command measures what it says; how fast it is belongs to benchmarks, not to tests."""

import pytest

from tests.support.paths import ROOT
from windwrench.dynamics import InputError
from windwrench.runtime.provenance import commit, made_by
from windwrench.speed.contenders import (
    HEADER,
    Contender,
    Section,
    filters,
    measure,
    rows_of,
    write_markdown,
)
from windwrench.speed.environment_profile import profile
from windwrench.speed.flight_speed import flights
from windwrench.speed.growth import over_formats, over_logs, over_steps, over_threads, over_vehicles
from windwrench.speed.history import append_history, read_history


def test_medians_and_ratios_are_taken_round_by_round(tmp_path):
    values = iter([1.0, 10.0, 2.0, 10.0, 3.0, 60.0])
    figures = measure(
        [
            Contender("one", "s", "x", lambda: next(values), reference=True),
            Contender("two", "s", "y", lambda: next(values)),
        ],
        rounds=3,
    )
    assert figures[0].value == (2.0, 1.0, 3.0)
    assert figures[1].value == (10.0, 10.0, 60.0)
    assert figures[1].ratio == (10.0, 5.0, 20.0)
    write_markdown(figures, 3, tmp_path / "speed.md")
    page = (tmp_path / "speed.md").read_text()
    command = "windwrench speed --rounds 3 --markdown docs/speed.md"
    assert made_by(command, [commit()]) in page.splitlines()
    assert "| two | 10.00 s | 10.00 - 60.00 | 10 (5 - 20) | y |" in page
    assert all(len(row) == len(HEADER) for row in rows_of(figures))


def test_a_history_grows_and_a_spoiled_one_is_refused(tmp_path):
    figures = measure([Contender("one", "s", "x", lambda: 2.0, reference=True)], rounds=1)
    path = tmp_path / "history.json"
    for count in (1, 2):
        append_history(figures, 1, path)
        entries = read_history(path)
        assert len(entries) == count
    assert entries[0]["figures"]["one"] == {
        "unit": "s",
        "median": 2.0,
        "least": 2.0,
        "largest": 2.0,
        "ratio": 1.0,
    }
    path.write_text("{}")
    with pytest.raises(InputError, match="expected a JSON list"):
        append_history(figures, 1, path)
    assert path.read_text() == "{}"


def test_the_kept_history_has_the_figures_of_the_page():
    page = (ROOT / "docs/speed.md").read_text(encoding="utf-8")
    entries = read_history(ROOT / "docs/speed-history.json")
    of_page = [e for e in entries if f"commit {e['commit']}" in page]
    assert of_page
    for name in ("WrenchUKF", "FanTracking, 1 environment"):
        figure = of_page[-1]["figures"][name]
        digits = 1 if figure["median"] < 100 else 0
        assert f"| {name} | {figure['median']:.{digits}f} {figure['unit']} |" in page


def test_every_contender_runs():
    # crazyflow compiles for half a minute
    for figure in measure(
        [*filters(), *(c for c in flights((2, 3)) if "crazyflow" not in c.name)], rounds=1
    ):
        assert figure.value[0] > 0, figure.contender.name


def test_a_page_holds_the_sections(tmp_path):
    figures = measure([Contender("one", "s", "x", lambda: 1.0, reference=True)], rounds=1)
    write_markdown(
        figures,
        1,
        tmp_path / "speed.md",
        [Section("Growth", ["n", "us"], [["1", "2.5"]], "In words.")],
    )
    page = (tmp_path / "speed.md").read_text()
    assert "## Growth\n\n| n | us |\n| --- | --- |\n| 1 | 2.5 |\n\nIn words.\n" in page


@pytest.mark.parametrize("estimator", ["ukf", "constant-gain"])
def test_the_profile_s_parts_sum_to_the_whole_or_less_than_rounding_above(estimator):
    section = profile(1, estimator)
    *parts, whole = [float(row[1]) for row in section.rows]
    assert len(parts) == 7
    assert all(part >= 0 for part in parts)
    assert sum(parts) > 0.9 * whole
    assert f"filter ({estimator})" in [row[0] for row in section.rows]


@pytest.mark.slow
def test_growth_is_measured_for_each_count_and_part():
    section = over_vehicles(1, (1, 8), (1, 2))
    assert [row[0] for row in section.rows] == ["1", "2", "8"]
    assert float(section.rows[0][1]) > 0
    assert section.rows[2][2] == ""
    assert [row[0] for row in over_steps(2000, 2).rows] == ["1,000", "2,000"]
    (row,) = over_threads(1, (3,)).rows
    assert all(float(cell) > 0 for cell in row)
    assert [row[0] for row in over_formats(1, 2.0).rows] == ["csv", "csv.gz", "parquet"]
    (row,) = over_logs((20.0,)).rows
    assert row[0] == "20"
    assert 100 < float(row[3]) < 1000  # MB
