"""The speed command measures what it says; how fast it is belongs to benchmarks, not to tests."""

from windwrench.benchmarks.speed import HEADER, Contender, filters, flights, measure, rows_of, write_markdown


def test_medians_and_ratios_are_taken_round_by_round(tmp_path):
    values = iter([1.0, 10.0, 2.0, 10.0, 3.0, 60.0])
    figures = measure([Contender("one", "s", "x", lambda: next(values), reference=True),
                       Contender("two", "s", "y", lambda: next(values))], rounds=3)
    assert figures[0].value == (2.0, 1.0, 3.0)
    assert figures[1].value == (10.0, 10.0, 60.0)
    assert figures[1].ratio == (10.0, 5.0, 20.0)
    write_markdown(figures, 3, tmp_path / "speed.md")
    page = (tmp_path / "speed.md").read_text()
    assert "| two | 10.00 s | 10.00 - 60.00 | 10 (5 - 20) | y |" in page
    assert all(len(row) == len(HEADER) for row in rows_of(figures))


def test_every_contender_runs():
    for figure in measure([*filters(), *flights()], rounds=1):
        assert figure.value[0] > 0, figure.contender.name
