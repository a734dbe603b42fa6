"""The benchmark of half a second of flight: its model, its fit, and the page that shows them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from windwrench.studies.kept_results import DOCS, kept
from windwrench.studies.nanodrone_benchmark import (
    BEGIN,
    FITTED,
    GRAVITY,
    MASS,
    STEPS,
    Starts,
    fit,
    predicted,
    section,
    study,
)


def made_starts(count):
    """Random states, and rotors that swing about hover; what follows is not known yet."""
    rng = np.random.default_rng(1)
    states = np.zeros((count, 13))
    states[:, 6] = 1.0
    speeds = np.full((count, STEPS + 1, 4), np.sqrt(MASS * GRAVITY / (4.0 * BEGIN.thrust)))
    states[:, 3:6] = rng.normal(0.0, 1.0, (count, 3))
    turn = Rotation.from_rotvec(rng.normal(0.0, 0.3, (count, 3)))
    states[:, 6:10] = turn.as_quat(scalar_first=True)
    states[:, 10:13] = rng.normal(0.0, 1.0, (count, 3))
    speeds *= 1.0 + rng.normal(0.0, 0.05, (count, 1, 4))
    speeds *= 1.0 + np.cumsum(rng.normal(0.0, 0.006, speeds.shape), axis=1)
    flights = np.arange(count) % 4
    return Starts(flights, states, speeds, np.zeros((count, STEPS, 13)), np.zeros((count, 6)))


def test_known_coefficients_come_back():
    rng = np.random.default_rng(2)
    factors = rng.uniform(0.85, 1.15, len(FITTED))
    true = BEGIN._replace(
        **{n: f * getattr(BEGIN, n) for n, f in zip(FITTED, factors, strict=True)}
    )
    starts = made_starts(240)
    truth = predicted(true, starts)
    starts = starts._replace(truth=truth + rng.normal(0.0, 1e-3, truth.shape))
    found, deviations = fit(starts, FITTED, BEGIN, each=1)
    for name in FITTED:
        assert getattr(found, name) == pytest.approx(getattr(true, name), rel=0.01), name
        assert deviations[name] < 0.01 * abs(getattr(true, name))


def test_the_page_shows_the_kept_results():
    text = section(kept("identify/nanodrone.json"))
    assert text in (DOCS / "identify.md").read_text(encoding="utf-8")


def test_without_the_flights_the_study_says_so(tmp_path, capsys):
    study(tmp_path, None, tmp_path / "out.json")
    assert "skipped" in capsys.readouterr().out
    assert not (tmp_path / "out.json").exists()
