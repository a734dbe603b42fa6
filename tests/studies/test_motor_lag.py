"""The lag by thrust alone, on a flight whose motors are known, and the table of a measured one."""

import re

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from windwrench.studies.motor_lag.__main__ import study
from windwrench.studies.motor_lag.page import MARKS, tables
from windwrench.studies.motor_lag.study import MODELS, fitted, lagged, outcomes
from windwrench.studies.numbers.rendering import DOCS, kept
from windwrench.studies.page_tables import marks

PERIOD, LAG, OFFSET = 0.005, 0.07, 0.012


@pytest.fixture(scope="module")
def flight():
    """Commands of 21 s, and the specific force of thrust that follows them late."""
    rng = np.random.default_rng(5)
    slow = lagged(rng.normal(size=(4200, 4)), 0.05, PERIOD)
    command = 0.5 + 0.15 * slow / slow.std()
    steps = np.arange(len(command))
    late = np.stack([np.interp(steps - OFFSET / PERIOD, steps, x) for x in command.T], axis=1)
    force = lagged((late + 2.0 * late**2).sum(axis=1), LAG, PERIOD)
    return command, force + 0.05 * rng.normal(size=len(force))


def test_the_model_that_is_true_finds_lag_and_offset(flight):
    (lag, offset), (lag_width, offset_width), left = fitted(*flight, PERIOD, "thrust", True)
    assert abs(lag - LAG) < max(lag_width, 1e-3) < 0.01
    assert abs(offset - OFFSET) < max(offset_width, 5e-4) < 0.005
    assert left == pytest.approx(0.05, rel=0.1)


def test_without_an_offset_the_lag_takes_it_and_explains_less(flight):
    (lag, offset), _, left = fitted(*flight, PERIOD, "thrust", False)
    assert lag > LAG + 0.5 * OFFSET
    assert offset == 0.0
    assert left > 0.055


def test_each_model_is_kept_with_its_figures(flight):
    found = outcomes(*flight, PERIOD)
    assert [(one["on"], one["offset_fitted"]) for one in found] == list(MODELS)
    true = found[MODELS.index(("thrust", True))]
    assert abs(true["lag_s"] - LAG) < true["lag_half_width_s"]
    assert true["residual_rms_mps2"] == min(one["residual_rms_mps2"] for one in found)
    rows = tables([{"log": "a", **one} for one in found]).splitlines()[4:]
    assert f"| {1e3 * true['lag_s']:.0f} ± " in rows[-1]
    assert ["| none |" in row for row in rows] == [True, False, True, False]


def run(*given):
    app = typer.Typer()
    app.command()(study)
    return CliRunner().invoke(app, [str(x) for x in given])


def test_the_pages_table_is_made_from_the_kept_results_without_logs(tmp_path):
    committed = (DOCS / "identify.md").read_text(encoding="utf-8")
    text = tables(kept("identify/motor_lag.json"))
    begin, end = marks(MARKS)
    assert committed.count(f"{begin}\n\n{text}\n\n{end}") == 1
    page = tmp_path / "page.md"
    emptied = re.sub(f"{begin}.*{end}", f"{begin}\n{end}", committed, flags=re.DOTALL)
    page.write_text(emptied, encoding="utf-8")
    shown = run("--done", "--results", DOCS / "identify" / "motor_lag.json", "--page", page)
    assert shown.exit_code == 0
    assert shown.output == f"{text}\n"
    assert page.read_text(encoding="utf-8") == committed


def test_neither_logs_nor_kept_results_and_both_are_refused():
    assert run().exit_code == 2
    assert run("--done", "log10").exit_code == 2
